//! The images to train on.
//!
//! In: training views. Out: their images as one word for each pixel, decoded in parallel ([`TrainingImages`]): in
//! memory as many as have room; the others are read again whenever they are needed
//! ([`Prefetch`](super::prefetch::Prefetch)). The result of training does not depend on which images are in memory.

use crate::offline::dataset::selection::{camera_numbers, even_moments};
use crate::offline::dataset::{CoveredImage, DatasetError, TrainingView};
use crate::offline::engine::EngineError;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::{Pictures, room_for_images};
use crate::offline::train::error::TrainError;
use crate::offline::train::gpu::require_bindings;
use crate::offline::work::{Progress, proceed};
use crate::renderer::Headless;
use crate::scene::TrainedWith;
use crate::view::View;
use glam::UVec2;
use rayon::prelude::*;
use std::borrow::Cow;

/// Images that are decoded between two reports of progress.
const AT_ONCE: usize = 16;

/// A view with its image, if that is in memory.
#[derive(Debug)]
pub(crate) struct Shot {
    pub view: View,
    pub name: String,
    pub image: Option<CoveredImage>,
}

/// Most bytes of images in memory.
#[derive(Debug, Clone, Copy)]
pub struct ImageRoom {
    /// Of the images that a training from pictures begins with, which are in memory in any case.
    pub first: u64,
    /// Of all images.
    pub all: u64,
}

impl ImageRoom {
    /// The room for the images that a training begins with, on every machine: the Gaussians of the first step depend on
    /// these images.
    const FIRST: u64 = 2 << 30;

    /// Returns the room that the memory of the system leaves.
    pub fn of_system() -> Self {
        Self { first: Self::FIRST, all: room_for_images() }
    }
}

/// Training views with their images, for one run of training or several.
#[derive(Debug)]
pub struct TrainingImages {
    /// The views that are trained on.
    pub(crate) views: Vec<TrainingView>,
    pub(crate) shots: Vec<Shot>,
    /// The views on which the best step is chosen.
    pub(crate) validation: Vec<Shot>,
    validation_views: Vec<TrainingView>,
    /// Indices of the views whose images a training begins with.
    first: Vec<usize>,
}

impl TrainingImages {
    /// Checks that there is memory for the images that these views need in any case, and that the GPU can train on
    /// them, before any of them is loaded.
    ///
    /// # Errors
    /// The needed and the available memory, or the limit of the GPU.
    pub(crate) fn require_room(
        views: &[TrainingView],
        validation: &[TrainingView],
        headless: &Headless,
    ) -> Result<(), EngineError> {
        let (pictures, purpose) = (needed(views, validation, ImageRoom::of_system()), Purpose::Dataset);
        require_bindings(headless, pictures.largest()).map_err(|reason| EngineError::Limit { reason, purpose })?;
        pictures.require(Some(headless), purpose)
    }

    /// Loads the images of the views to train on and of those to validate on, which may be none, as many as have room.
    /// Begins the task "loading images", twice.
    ///
    /// # Errors
    /// Images that are missing or damaged, and those that are needed in any case if they are larger than the memory
    /// that is available.
    pub fn load(
        views: Vec<TrainingView>,
        validation: &[TrainingView],
        trained_with: &TrainedWith,
        room: ImageRoom,
        progress: &mut dyn Progress,
    ) -> Result<Self, TrainError> {
        needed(&views, validation, room).require_loaded(Purpose::Dataset)?;
        let shots = |views: &[TrainingView]| -> Vec<Shot> {
            let shot = |view: &TrainingView| Shot {
                view: view.camera.view(view.time, trained_with.optics()),
                name: view.name.clone(),
                image: None,
            };
            views.iter().map(shot).collect()
        };
        let first = first(&views, room);
        let (shots, validation_shots) = (shots(&views), shots(validation));
        let mut images =
            Self { shots, validation: validation_shots, validation_views: validation.to_vec(), first, views };
        images.fill(room, progress)?;
        Ok(images)
    }

    /// Loads as many images as have room: those that a training begins with, those of validation, then the others.
    fn fill(&mut self, room: ImageRoom, progress: &mut dyn Progress) -> Result<(), TrainError> {
        let mut left = self.first.iter().fold(room.all, |left, &index| left.saturating_sub(bytes(&self.views[index])));
        let mut fitting = |views: &[TrainingView], wanted: &mut dyn Iterator<Item = usize>| -> Vec<usize> {
            let mut fits = |index: &usize| {
                let fits = bytes(&views[*index]) <= left;
                left = left.saturating_sub(bytes(&views[*index]));
                fits
            };
            wanted.take_while(|index| fits(index)).collect()
        };
        let validated = fitting(&self.validation_views, &mut (0..self.validation.len()));
        let is_other = |index: &usize| self.first.binary_search(index).is_err();
        let others = fitting(&self.views, &mut (0..self.views.len()).filter(is_other));
        let trained = [&self.first[..], &others].concat();
        load(&mut self.shots, &self.views, &trained, progress)?;
        load(&mut self.validation, &self.validation_views, &validated, progress)?;
        let (there, count) = (self.in_memory(), self.shots.len() + self.validation.len());
        if there < count {
            progress.note(&format!(
                "{there} of {count} images are in memory, which has no room for more; the others are read whenever they are needed"
            ));
        }
        Ok(())
    }

    /// Returns the views that a training begins with, with their images.
    pub(crate) fn first(&self) -> impl Iterator<Item = (&View, &CoveredImage)> {
        self.first.iter().filter_map(|&index| {
            let Shot { view, image, .. } = &self.shots[index];
            image.as_ref().map(|image| (view, image))
        })
    }

    /// Returns all views that are trained on.
    pub(crate) fn all_views(&self) -> impl Iterator<Item = &View> {
        self.shots.iter().map(|shot| &shot.view)
    }

    /// Returns whether an image that a training begins with does not cover all pixels.
    pub(crate) fn has_gaps(&self) -> bool {
        self.first().any(|(_, image)| image.has_gaps)
    }

    /// Returns views of validation with their images, some at a time.
    pub(crate) fn validated(&self) -> impl Iterator<Item = Result<Vec<(&View, Cow<'_, CoveredImage>)>, DatasetError>> {
        let parts = self.validation.chunks(AT_ONCE).zip(self.validation_views.chunks(AT_ONCE));
        parts.map(|(shots, views)| {
            let images: Vec<_> = shots.par_iter().zip(views).map(|(shot, view)| image_of(shot, view)).collect();
            shots.iter().zip(images).map(|(shot, image)| Ok((&shot.view, image?))).collect()
        })
    }

    /// Returns the camera of each view that is trained on, numbered from 0.
    pub(crate) fn cameras(&self) -> Vec<u32> {
        camera_numbers(&self.views)
    }

    /// Returns the validation view in the middle, or that of training if there is none for validation, with its image.
    pub(crate) fn shown(&self) -> Result<Option<(&View, Cow<'_, CoveredImage>)>, DatasetError> {
        let (shots, views) = match self.validation.is_empty() {
            true => (&self.shots, &self.views),
            false => (&self.validation, &self.validation_views),
        };
        let middle = shots.len() / 2;
        let both = shots.get(middle).zip(views.get(middle));
        both.map(|(shot, view)| Ok((&shot.view, image_of(shot, view)?))).transpose()
    }

    /// Returns the number of images in memory, with those of validation.
    pub fn in_memory(&self) -> usize {
        self.shots.iter().chain(&self.validation).filter(|shot| shot.image.is_some()).count()
    }

    /// Returns the number of views that are trained on.
    pub fn len(&self) -> usize {
        self.shots.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.shots.is_empty()
    }
}

/// Loads the images of views with these indices. Begins the task "loading images".
fn load(
    shots: &mut [Shot],
    views: &[TrainingView],
    indices: &[usize],
    progress: &mut dyn Progress,
) -> Result<(), TrainError> {
    progress.begin("loading images", indices.len());
    for some in indices.chunks(AT_ONCE) {
        proceed(progress)?;
        let loaded: Vec<_> = some.par_iter().map(|&index| views[index].load_covered()).collect();
        for (&index, image) in some.iter().zip(loaded) {
            shots[index].image = Some(image?);
            progress.advance();
        }
    }
    progress.finish();
    Ok(())
}

/// Returns the image of a view, from memory or from its file.
fn image_of<'a>(shot: &'a Shot, view: &TrainingView) -> Result<Cow<'a, CoveredImage>, DatasetError> {
    match &shot.image {
        Some(image) => Ok(Cow::Borrowed(image)),
        None => view.load_covered().map(Cow::Owned),
    }
}

/// Returns the largest number of images that are read ahead of the steps that need them.
pub(crate) fn ahead() -> usize {
    2 * rayon::current_num_threads()
}

/// Returns the size of an image in memory.
fn bytes(view: &TrainingView) -> u64 {
    view.camera.size.as_u64vec2().element_product().saturating_mul(size_of::<[u8; 4]>() as u64)
}

/// Returns the indices of the views whose images a training begins with, ascending.
fn first(views: &[TrainingView], room: ImageRoom) -> Vec<usize> {
    let largest = views.iter().map(bytes).max().unwrap_or(0).max(1);
    even_moments(views, usize::try_from(room.first / largest).unwrap_or(usize::MAX).max(1))
}

/// Returns the images that are in memory in any case: those that a training begins with, and those that are read ahead.
fn needed(views: &[TrainingView], validation: &[TrainingView], room: ImageRoom) -> Pictures {
    let sizes: Vec<UVec2> = first(views, room).into_iter().map(|index| views[index].camera.size).collect();
    let others = views.len() + validation.len() - sizes.len();
    let largest = views.iter().chain(validation).map(|view| view.camera.size).max_by_key(|size| size.element_product());
    let ahead = std::iter::repeat_n(largest.unwrap_or_default(), others.min(ahead()));
    Pictures::trained(sizes.into_iter().chain(ahead))
}
