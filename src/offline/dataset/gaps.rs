//! Whether images have gaps.
//!
//! In: training views. Out: whether a pixel of an image is transparent, or not covered by its mask.

use super::{DatasetError, TrainingView};
use crate::offline::work::{Progress, proceed};
use rayon::prelude::*;

/// Images that are decoded between two checks for an interruption.
const AT_ONCE: usize = 16;

/// Returns whether an image has gaps. Images are decoded until the first that has some. Begins the task "looking for
/// gaps".
///
/// # Errors
/// An image that is missing or cannot be decoded, an interruption.
pub(crate) fn have_gaps(views: &[TrainingView], progress: &mut dyn Progress) -> Result<bool, DatasetError> {
    let has_gaps = |view: &TrainingView| view.load_covered().map(|image| image.has_gaps);
    progress.begin("looking for gaps", views.len().div_ceil(AT_ONCE));
    let mut found = false;
    for some in views.chunks(AT_ONCE) {
        proceed(progress)?;
        found = some.par_iter().map(has_gaps).try_reduce(|| false, |a, b| Ok(a || b))?;
        if found {
            break;
        }
        progress.advance();
    }
    progress.finish();
    Ok(found)
}
