//! The splits of a dataset, limited to the time interval of a capture.
//!
//! In: a dataset folder, a split, the settings the capture was trained with. Out: the views of that split inside the
//! capture's time interval, or an even share of them.

use super::dataset::selection::even_share;
use super::dataset::{CameraOptions, Dataset, DatasetError, Split, TrainingView};
use super::progress::Progress;
use crate::scene::TrainedWith;
use std::path::Path;

/// Every split with its name.
pub const SPLIT_NAMES: [(&str, Split); 3] = [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)];

/// Returns the name of a split.
pub fn split_name(split: Split) -> &'static str {
    SPLIT_NAMES.iter().find(|(_, other)| *other == split).map_or("test", |(name, _)| name)
}

/// Opens a split. Views outside the time interval are dropped, as in training, and their number is reported as a note.
/// `resolution` is a divisor of the picture size or a target width in pixels, as in training; `None` keeps the size.
///
/// # Errors
/// A split that is missing or cannot be used.
pub fn open_split(
    folder: &Path,
    split: Split,
    resolution: Option<i32>,
    trained_with: &TrainedWith,
    progress: &mut dyn Progress,
) -> Result<Dataset, DatasetError> {
    let options = CameraOptions { resolution, ..CameraOptions::default() };
    let all = Dataset::open(folder, split, &options)?;
    let [first, last] = trained_with.time_interval;
    let outside = all.views.iter().filter(|view| !(first..=last).contains(&view.time)).count();
    if outside == 0 {
        return Ok(all);
    }
    progress.note(&format!(
        "note: {outside} of {} views lie outside the time interval {first} to {last} and are left out; \
         was the capture converted without --time-interval?",
        all.views.len()
    ));
    Dataset::open(folder, split, &CameraOptions { time_interval: Some([first, last]), ..options })
}

/// Returns an even share of at most `count` views, in their order; `None` returns all.
pub fn share(views: Vec<TrainingView>, count: Option<usize>) -> Vec<TrainingView> {
    match count {
        Some(count) => even_share(&views, count).into_iter().map(|index| views[index].clone()).collect(),
        None => views,
    }
}
