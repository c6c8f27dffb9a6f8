//! Whether images have gaps.
//!
//! In: training views. Out: whether a pixel of an image is transparent, or not covered by its mask.

use super::dataset::{DatasetError, TrainingView};
use super::{OfflineError, Progress, proceed};
use rayon::prelude::*;

/// Images that are decoded between two looks whether the user has asked to end.
const AT_ONCE: usize = 16;

/// Returns whether an image has gaps. Images are decoded until the first that has some. Begins the task "looking for gaps".
///
/// # Errors
/// An image that is missing or cannot be decoded, an interruption.
pub(crate) fn have_gaps(views: &[TrainingView], progress: &mut dyn Progress) -> Result<bool, OfflineError> {
    let has_gaps = |view: &TrainingView| view.load_covered().map(|image| image.has_gaps);
    progress.begin("looking for gaps", views.len().div_ceil(AT_ONCE));
    let mut found = false;
    for some in views.chunks(AT_ONCE) {
        proceed(progress)?;
        found = some.par_iter().map(has_gaps).try_reduce(|| false, |a, b| Ok::<bool, DatasetError>(a || b))?;
        if found {
            break;
        }
        progress.advance();
    }
    progress.finish();
    Ok(found)
}
