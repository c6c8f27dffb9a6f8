//! The images to train on, in memory.
//!
//! In: training views. Out: their images as one word for each pixel, decoded once, in parallel ([`TrainingImages`]).

use crate::offline::dataset::selection::hold_out;
use crate::offline::dataset::{CoveredImage, TrainingView};
use crate::offline::{OfflineError, Progress};
use crate::scene::TrainedWith;
use crate::view::View;
use rayon::prelude::*;

/// Most bytes of images that are kept.
const LIMIT: u64 = 32 << 30;

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
    /// The views that tell which parameters are the best.
    pub(super) held_out: Vec<Shot>,
}

impl TrainingImages {
    /// Holds out an even share of the views, as [`FineTuneSettings::held_out`](super::FineTuneSettings::held_out) says, and loads the images of
    /// all. Begins the task "loading images", twice.
    ///
    /// # Errors
    /// Images that are missing, damaged or, together, too large.
    pub fn load(
        views: &[TrainingView],
        held_out: usize,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        let (views, held_out) = hold_out(views, held_out);
        Self::load_apart(views, &held_out, trained_with, progress)
    }

    /// As [`load`](Self::load), with views that have been held out.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_apart(
        views: Vec<TrainingView>,
        held_out: &[TrainingView],
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        let mut shots = |views: &[TrainingView]| -> Result<Vec<Shot>, OfflineError> {
            let images = load(views, progress)?;
            let shot = |(view, image): (&TrainingView, CoveredImage)| Shot {
                view: view.camera.view(view.time, trained_with.raster_fov),
                name: view.name.clone(),
                image,
            };
            Ok(views.iter().zip(images).map(shot).collect())
        };
        let (shots, held_out) = (shots(&views)?, shots(held_out)?);
        Ok(Self { views, shots, held_out })
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
/// Images that are missing, damaged or, together, too large.
fn load(views: &[TrainingView], progress: &mut dyn Progress) -> Result<Vec<CoveredImage>, OfflineError> {
    let bytes: u64 = views.iter().map(|view| 4 * u64::from(view.camera.size.x) * u64::from(view.camera.size.y)).sum();
    if let (true, Some(view)) = (bytes > LIMIT, views.first()) {
        let gigabytes = bytes >> 30;
        return Err(OfflineError::at(
            &view.image,
            format!(
                "is one of {} images of {gigabytes} GiB together: give a --resolution, or fewer views",
                views.len()
            ),
        ));
    }
    progress.begin("loading images", views.len());
    let mut images = Vec::with_capacity(views.len());
    for some in views.chunks(AT_ONCE) {
        let loaded: Vec<_> = some.par_iter().map(TrainingView::load_covered).collect();
        for image in loaded {
            images.push(image?);
            progress.advance();
        }
    }
    progress.finish();
    Ok(images)
}
