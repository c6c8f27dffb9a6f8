//! The images to train on.
//!
//! In: training views. Out: their images as one word for each pixel, decoded in parallel ([`TrainingImages`]): in
//! memory as many as have room; the others are read again whenever they are needed
//! ([`Prefetch`](super::prefetch::Prefetch)). The result of training does not depend on which images are in memory. The
//! same images at a reduced size ([`TrainingImages::at`]).

use super::reduced::{Coarse, Detail};
use super::shot::{Shot, bytes};
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
use std::sync::Arc;

/// Images that are decoded between two reports of progress.
const AT_ONCE: usize = 16;

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
#[derive(Debug, Clone)]
pub struct TrainingImages {
    /// The views that are trained on.
    pub(crate) views: Vec<TrainingView>,
    pub(crate) shots: Vec<Shot>,
    /// The views on which the best step is chosen.
    pub(crate) validation: Vec<Shot>,
    validation_views: Vec<TrainingView>,
    /// Indices of the views whose images a training begins with.
    first: Vec<usize>,
    /// Whether an image that a training begins with does not cover all pixels.
    has_gaps: bool,
    /// Most bytes of all images in memory.
    room: u64,
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
        let mut images = Self::unread(views, validation, trained_with, room)?;
        let first = images.first.clone();
        images.fill(&first, room.all, progress)?;
        Ok(images.with_gaps())
    }

    /// Returns these images, which know whether one of those that a training begins with has gaps.
    fn with_gaps(self) -> Self {
        let has_gaps = self.first().any(|(_, image)| image.has_gaps);
        Self { has_gaps, ..self }
    }

    /// Loads the images that a training begins with; the others are loaded at the sizes that are trained on
    /// ([`Coarse`]). Begins the task "loading images".
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_first(
        views: Vec<TrainingView>,
        validation: &[TrainingView],
        trained_with: &TrainedWith,
        room: ImageRoom,
        progress: &mut dyn Progress,
    ) -> Result<Self, TrainError> {
        let mut images = Self::unread(views, validation, trained_with, room)?;
        load(&mut images.shots, &images.views, &images.first, progress)?;
        Ok(images.with_gaps())
    }

    /// Returns the views, with no image in memory.
    fn unread(
        views: Vec<TrainingView>,
        validation: &[TrainingView],
        trained_with: &TrainedWith,
        room: ImageRoom,
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
        Ok(Self {
            shots,
            validation: validation_shots,
            validation_views: validation.to_vec(),
            first,
            views,
            has_gaps: false,
            room: room.all,
        })
    }

    /// Returns the views with their images at the size of this detail, as many in memory as have room beside these.
    /// Images that are in memory here at that size are shared. Begins the task "loading images", twice, if images are
    /// loaded.
    ///
    /// # Errors
    /// An image that has become unreadable, an interruption.
    pub(crate) fn at(&self, coarse: &Coarse, detail: Detail, progress: &mut dyn Progress) -> Result<Self, TrainError> {
        let in_memory = self.shots.iter().chain(&self.validation).filter_map(|shot| shot.image.as_ref());
        let held = in_memory.fold(0, |held: u64, image| held.saturating_add(bytes(image.size)));
        let mut images = self.clone();
        for shot in images.shots.iter_mut().chain(&mut images.validation) {
            shot.view.size = coarse.size(shot.view.size, detail);
        }
        if !images.shots.iter().chain(&images.validation).all(Shot::is_ready) {
            images.fill(&[], self.room.saturating_sub(held), progress)?;
        }
        Ok(images)
    }

    /// Loads the images that are not in memory at their size, as many as have room: those that are wanted in any case,
    /// ascending, those of validation, then the others.
    fn fill(&mut self, in_any_case: &[usize], room: u64, progress: &mut dyn Progress) -> Result<(), TrainError> {
        let mut left = in_any_case.iter().fold(room, |left, &index| left.saturating_sub(self.shots[index].bytes()));
        let mut fitting = |shots: &[Shot], wanted: &mut dyn Iterator<Item = usize>| -> Vec<usize> {
            let mut fits = |index: &usize| {
                let fits = shots[*index].bytes() <= left;
                left = left.saturating_sub(shots[*index].bytes());
                fits
            };
            let mut wanted: Vec<usize> = wanted.filter(|&index| !shots[index].is_ready()).collect();
            // Those that are in memory at a larger size need not be read.
            wanted.sort_by_key(|&index| shots[index].image.is_some());
            wanted.into_iter().take_while(|index| fits(index)).collect()
        };
        let validated = fitting(&self.validation, &mut (0..self.validation.len()));
        let is_other = |index: &usize| in_any_case.binary_search(index).is_err();
        let others = fitting(&self.shots, &mut (0..self.shots.len()).filter(is_other));
        let trained = [in_any_case, &others].concat();
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
            image.as_deref().map(|image| (view, image))
        })
    }

    /// Returns all views that are trained on.
    pub(crate) fn all_views(&self) -> impl Iterator<Item = &View> {
        self.shots.iter().map(|shot| &shot.view)
    }

    /// Returns whether an image that a training begins with does not cover all pixels.
    pub(crate) fn has_gaps(&self) -> bool {
        self.has_gaps
    }

    /// Returns the image of a view that is trained on, at the size of the view, from memory or from its file.
    ///
    /// # Errors
    /// An image that has become unreadable.
    pub(crate) fn image(&self, index: usize) -> Result<Arc<CoveredImage>, DatasetError> {
        self.shots[index].image(&self.views[index])
    }

    /// Returns views of validation with their images, some at a time.
    pub(crate) fn validated(&self) -> impl Iterator<Item = Result<Vec<(&View, Arc<CoveredImage>)>, DatasetError>> {
        let parts = self.validation.chunks(AT_ONCE).zip(self.validation_views.chunks(AT_ONCE));
        parts.map(|(shots, views)| {
            let images: Vec<_> = shots.par_iter().zip(views).map(|(shot, view)| shot.image(view)).collect();
            shots.iter().zip(images).map(|(shot, image)| Ok((&shot.view, image?))).collect()
        })
    }

    /// Returns the camera of each view that is trained on, numbered from 0.
    pub(crate) fn cameras(&self) -> Vec<u32> {
        camera_numbers(&self.views)
    }

    /// Returns the validation view in the middle, or that of training if there is none for validation, with its image.
    pub(crate) fn shown(&self) -> Result<Option<(&View, Arc<CoveredImage>)>, DatasetError> {
        let (shots, views) = match self.validation.is_empty() {
            true => (&self.shots, &self.views),
            false => (&self.validation, &self.validation_views),
        };
        let middle = shots.len() / 2;
        let both = shots.get(middle).zip(views.get(middle));
        both.map(|(shot, view)| Ok((&shot.view, shot.image(view)?))).transpose()
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

/// Loads the images of views with these indices, at the sizes of the views. Begins the task "loading images".
fn load(
    shots: &mut [Shot],
    views: &[TrainingView],
    indices: &[usize],
    progress: &mut dyn Progress,
) -> Result<(), TrainError> {
    progress.begin("loading images", indices.len());
    for some in indices.chunks(AT_ONCE) {
        proceed(progress)?;
        let there = &*shots;
        let loaded: Vec<_> = some.par_iter().map(|&index| there[index].image(&views[index])).collect();
        for (&index, image) in some.iter().zip(loaded) {
            shots[index].image = Some(image?);
            progress.advance();
        }
    }
    progress.finish();
    Ok(())
}

/// Returns the largest number of images that are read ahead of the steps that need them.
pub(crate) fn ahead() -> usize {
    2 * rayon::current_num_threads()
}

/// Returns the indices of the views whose images a training begins with, ascending.
fn first(views: &[TrainingView], room: ImageRoom) -> Vec<usize> {
    let largest = views.iter().map(|view| bytes(view.camera.size)).max().unwrap_or(0).max(1);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use crate::view::Camera;
    use glam::Vec3;
    use std::path::Path;

    /// Writes plain images of 8 by 4 pixels, and returns their views.
    fn views(folder: &Path) -> Vec<TrainingView> {
        let view = |index: u8| {
            let size = UVec2::new(8, 4);
            let camera = Camera::look_at(Vec3::X * (4.0 + f32::from(index)), Vec3::ZERO, Vec3::Z, 0.7, size);
            let image = folder.join(format!("{index}.png"));
            let pixels = image::RgbImage::from_pixel(size.x, size.y, image::Rgb([10 * index, 20, 30]));
            pixels.save(&image).expect("the folder can be written to");
            let (name, correction) = (index.to_string(), Default::default());
            TrainingView { name, camera, time: 0.0, original: size, image, mask: None, correction }
        };
        (0..4).map(view).collect()
    }

    #[test]
    fn images_of_a_size_are_reduced_from_memory_and_whole_ones_are_shared() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (views, coarse) = (views(folder.path()), Coarse { whole_up_to: 4, ..Coarse::default() });
        let room = ImageRoom { first: 1 << 20, all: 1 << 20 };
        let given =
            TrainingImages::load(views[..3].to_vec(), &views[3..], &TrainedWith::default(), room, &mut NoProgress);
        let given = given.expect("the images were just written");
        for view in &views {
            std::fs::remove_file(&view.image).expect("the image was just written");
        }
        let half = given.at(&coarse, Detail::Half, &mut NoProgress).expect("all images are in memory");
        let of_half = half.image(2).expect("it is in memory");
        assert_eq!((half.shots[2].view.size, of_half.size), (UVec2::new(4, 2), UVec2::new(4, 2)), "half of each side");
        assert_eq!(of_half.texels[7], [20, 20, 30, 255], "the mean of a plain image");
        assert_eq!(half.validation[0].view.size, UVec2::new(4, 2), "validation too");
        let whole = given.at(&coarse, Detail::Whole, &mut NoProgress).expect("all images are in memory");
        let [own, shared] = [&given, &whole].map(|images| images.image(2).expect("it is in memory"));
        assert!(Arc::ptr_eq(&own, &shared), "no image is twice in memory");
    }

    #[test]
    fn images_without_room_are_read_at_the_size_of_the_step() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (views, coarse) = (views(folder.path()), Coarse { whole_up_to: 4, ..Coarse::default() });
        let load = |all: u64| {
            let room = ImageRoom { first: 1, all };
            TrainingImages::load_first(views.clone(), &[], &TrainedWith::default(), room, &mut NoProgress)
        };
        // A whole image has 128 bytes, a quarter of its sides 8.
        for (room, expected) in [(0, 1), (128 + 2 * 8, 3), (1 << 20, 4)] {
            let given = load(room).expect("the images were just written");
            assert_eq!(given.in_memory(), 1, "only the image that a training begins with");
            let quarter = given.at(&coarse, Detail::Quarter, &mut NoProgress).expect("the images are there");
            assert_eq!(quarter.in_memory(), expected, "as many as {room} bytes hold");
            for index in 0..4 {
                let image = quarter.image(index).expect("the image is there");
                let color = [10 * index as u8, 20, 30, 255];
                assert_eq!((image.size, &image.texels[..]), (UVec2::new(2, 1), &[color; 2][..]), "image {index}");
            }
        }
    }
}
