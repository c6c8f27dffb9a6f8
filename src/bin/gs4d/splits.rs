//! The views of a dataset that a verb measures against.
//!
//! In: `--data DIR`, a split and how its images are read. Out: the views of that split, inside the capture's time interval, and
//! the settings of an evaluation.

use crate::failure::Failure;
use crate::report::note;
use crate::values;
use bevy_gs4d::dataset::{CameraOptions, Dataset, ImageMode, Split, TrainingView};
use bevy_gs4d::metrics::{EvaluationSettings, MetricSet};
use bevy_gs4d::scene::TrainedWith;
use std::path::PathBuf;

/// Where the training and test views are.
#[derive(clap::Args)]
#[command(next_help_heading = "Data")]
pub struct DataArgs {
    /// Folder of the dataset, with transforms_train.json and transforms_test.json.
    #[arg(long, value_name = "DIR")]
    pub data: PathBuf,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub resolution: Option<i32>,
    /// How the trainer loaded images: in-memory (D-NeRF: transparent ones are multiplied by alpha twice) or dataloader (N3V)
    /// [default: dataloader for captures of intrinsics cameras, else in-memory].
    #[arg(long, value_name = "MODE", value_parser = values::one_of(&IMAGE_MODES))]
    image_mode: Option<ImageMode>,
}

const IMAGE_MODES: [(&str, ImageMode); 2] =
    [("in-memory", ImageMode::InMemory), ("dataloader", ImageMode::Dataloader)];

/// Names of the splits.
pub const SPLITS: [(&str, Split); 3] = [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)];

impl DataArgs {
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

    /// How the images of the data are compared with this capture.
    pub fn settings(&self, trained: &TrainedWith, metrics: MetricSet) -> EvaluationSettings {
        let settings = EvaluationSettings::of(trained, metrics);
        EvaluationSettings { images: self.image_mode.unwrap_or(settings.images), ..settings }
    }
}

/// An even subset of at most `count` views, in their order; all without a count.
pub fn even(mut views: Vec<TrainingView>, count: Option<usize>) -> Vec<TrainingView> {
    let all = views.len();
    let Some(count) = count.filter(|count| *count < all) else { return views };
    let mut index = 0;
    // The k-th view kept is the one in the middle of the k-th of `count` equal parts.
    let kept: Vec<usize> = (0..count).map(|k| (2 * k + 1) * all / (2 * count)).collect();
    views.retain(|_| {
        index += 1;
        kept.binary_search(&(index - 1)).is_ok()
    });
    views
}

/// The name of a split.
pub fn split_name(split: Split) -> &'static str {
    SPLITS.iter().find(|(_, other)| *other == split).map_or("test", |(name, _)| name)
}
