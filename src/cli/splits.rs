//! The views of a dataset that a verb works with: those it trains on, those it is measured by.
//!
//! In: `--data DIR` and a split. Out: the views of that split inside the capture's time interval.

use super::failure::Failure;
use super::report::note;
use crate::offline::dataset::selection::even_share;
use crate::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use crate::scene::TrainedWith;
use std::path::PathBuf;

/// Where the training and test views are.
#[derive(clap::Args)]
#[command(next_help_heading = "Data")]
pub struct SplitArgs {
    /// Folder of the dataset, with `transforms_train.json` and `transforms_test.json`.
    #[arg(long, value_name = "DIR")]
    pub data: PathBuf,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub resolution: Option<i32>,
}

/// Names of the splits.
pub const SPLITS: [(&str, Split); 3] = [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)];

impl SplitArgs {
    /// The views of a split. The trainer drops what lies outside the time interval, and so does this.
    ///
    /// # Errors
    /// A split that is not there or cannot be used.
    pub fn open(&self, split: Split, trained: &TrainedWith) -> Result<Dataset, Failure> {
        let options = CameraOptions { resolution: self.resolution, ..CameraOptions::default() };
        let all = Dataset::open(&self.data, split, &options)?;
        let [first, last] = trained.time_interval;
        let outside = all.views.iter().filter(|view| !(first..=last).contains(&view.time)).count();
        if outside == 0 {
            return Ok(all);
        }
        note(&format!(
            "note: {outside} of {} views lie outside the time interval {first} to {last} and are left out; \
             was the capture converted without --time-interval?",
            all.views.len()
        ));
        Ok(Dataset::open(&self.data, split, &CameraOptions { time_interval: Some([first, last]), ..options })?)
    }
}

/// An even share of at most `count` views, in their order; all without a count.
pub fn share(views: Vec<TrainingView>, count: Option<usize>) -> Vec<TrainingView> {
    match count {
        Some(count) => even_share(&views, count).into_iter().map(|index| views[index].clone()).collect(),
        None => views,
    }
}

/// The name of a split.
pub fn split_name(split: Split) -> &'static str {
    SPLITS.iter().find(|(_, other)| *other == split).map_or("test", |(name, _)| name)
}
