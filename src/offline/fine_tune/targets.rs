//! The images to train on, in memory.
//!
//! In: training views. Out: their images as one word for each pixel, decoded once, in parallel.

use crate::offline::dataset::{CoveredImage, TrainingView};
use crate::offline::{OfflineError, Progress};
use rayon::prelude::*;

/// Most bytes of images that are kept.
const LIMIT: u64 = 32 << 30;

/// Images that are decoded between two reports of progress.
const AT_ONCE: usize = 16;

/// Loads the images of all views. Begins the task "loading images".
///
/// # Errors
/// Images that are missing, damaged or, together, too large.
pub(super) fn load(views: &[TrainingView], progress: &mut dyn Progress) -> Result<Vec<CoveredImage>, OfflineError> {
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
