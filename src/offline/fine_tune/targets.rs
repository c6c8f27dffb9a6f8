//! The images to train on, in memory.
//!
//! In: training views. Out: their images as one word for each pixel, decoded once, in parallel ([`TrainingImages`]).

use crate::offline::dataset::selection::camera_numbers;
use crate::offline::dataset::{CoveredImage, TrainingView};
use crate::offline::memory_check::{BY_RESOLUTION, Pictures};
use crate::offline::{OfflineError, Progress, proceed};
use crate::renderer::Headless;
use crate::scene::TrainedWith;
use crate::view::View;
use rayon::prelude::*;

/// Images that are decoded between two reports of progress.
const AT_ONCE: usize = 16;

/// A view with its image.
#[derive(Debug)]
pub(super) struct Shot {
    pub view: View,
    pub name: String,
    pub image: CoveredImage,
}

/// Training views with their images, for one run of fine-tuning or several.
#[derive(Debug)]
pub struct TrainingImages {
    /// The views that are trained on.
    pub(super) views: Vec<TrainingView>,
    pub(super) shots: Vec<Shot>,
    /// The views on which the best step is chosen.
    pub(super) validation: Vec<Shot>,
}

impl TrainingImages {
    /// Checks that there is memory for the images of these views, and that the GPU can train on them, before any of them is loaded.
    ///
    /// # Errors
    /// What is needed, what is available, and the remedy.
    pub(crate) fn require_room(
        views: &[TrainingView],
        validation: &[TrainingView],
        headless: &Headless,
    ) -> Result<(), OfflineError> {
        Pictures::trained(views, validation).require(Some(headless), BY_RESOLUTION)
    }

    /// Loads the images of the views to train on and of those to validate on, which may be none. Begins the task "loading
    /// images", twice.
    ///
    /// # Errors
    /// Images that are missing, damaged or, together, larger than the memory that is available.
    pub fn load(
        views: Vec<TrainingView>,
        validation: &[TrainingView],
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        Pictures::trained(&views, validation).require_loaded(BY_RESOLUTION)?;
        let mut shots = |views: &[TrainingView]| -> Result<Vec<Shot>, OfflineError> {
            let images = load(views, progress)?;
            let shot = |(view, image): (&TrainingView, CoveredImage)| Shot {
                view: view.camera.view(view.time, trained_with.raster_fov),
                name: view.name.clone(),
                image,
            };
            Ok(views.iter().zip(images).map(shot).collect())
        };
        let (shots, validation) = (shots(&views)?, shots(validation)?);
        Ok(Self { views, shots, validation })
    }

    /// Returns the views that are trained on, with their images.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (&View, &CoveredImage)> {
        self.shots.iter().map(|shot| (&shot.view, &shot.image))
    }

    /// Returns the camera of each view that is trained on, numbered from 0.
    pub(super) fn cameras(&self) -> Vec<u32> {
        camera_numbers(&self.views)
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

/// Loads the images of all views. Begins the task "loading images".
///
/// # Errors
/// Images that are missing or damaged.
fn load(views: &[TrainingView], progress: &mut dyn Progress) -> Result<Vec<CoveredImage>, OfflineError> {
    progress.begin("loading images", views.len());
    let mut images = Vec::with_capacity(views.len());
    for some in views.chunks(AT_ONCE) {
        proceed(progress)?;
        let loaded: Vec<_> = some.par_iter().map(TrainingView::load_covered).collect();
        for image in loaded {
            images.push(image?);
            progress.advance();
        }
    }
    progress.finish();
    Ok(images)
}
