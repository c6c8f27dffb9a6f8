//! The dataset that a verb works with.
//!
//! In: `--data DIR`, sizes, a split. Out: its views inside the capture's time interval.

use super::values;
use crate::cli::output::failure::Failure;
use crate::offline::dataset::splits::open_split;
use crate::offline::dataset::{Dataset, DatasetError, Split, SplitOptions, Splits, TrainingView, Validation};
use crate::offline::store::outputs::Files;
use crate::offline::work::Progress;
use crate::scene::TrainedWith;
use glam::UVec2;
use std::path::{Path, PathBuf};

/// Where the training views are.
#[derive(clap::Args)]
#[command(next_help_heading = "Training data")]
pub(crate) struct DataArgs {
    /// Folder of the dataset that the capture was trained on: `transforms_train.json` (Blender, D-NeRF),
    /// `transforms.json` (nerfstudio), `poses_bounds.npy` (N3V), `sparse/0` (COLMAP) and others (docs/command.md).
    /// Cameras and times are enough unless results are compared with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Picture size [default: w and h of the camera file, else that of the first image found beside it, after
    /// --resolution].
    #[arg(long, value_name = "WxH", value_parser = values::size, requires = "data")]
    size: Option<UVec2>,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with = "size", requires = "data")]
    resolution: Option<i32>,
    /// Read every view at time 0, as of a scene at rest; images in subfolders of a COLMAP dataset are then no frames of
    /// cameras.
    #[arg(id = "static", long = "static", requires = "data")]
    is_static: bool,
}

impl DataArgs {
    /// Returns whether a folder is given.
    pub(crate) fn is_given(&self) -> bool {
        self.data.is_some()
    }

    /// Adds the files of the folder, if one is given, to those that the verb reads.
    pub(crate) fn add_to(&self, files: Files) -> Files {
        self.data.iter().fold(files, |files, folder| files.reads_data(folder))
    }

    /// Returns the training views within the capture's time interval, undivided.
    ///
    /// # Errors
    /// No folder is given, or it cannot be used.
    pub(crate) fn open(
        &self,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Vec<TrainingView>, Failure> {
        let options = self.options(Validation::None);
        Ok(open_split(self.folder()?, Split::Train, &options, trained_with, progress).map_err(or_give_size)?.views)
    }

    /// Returns the views to train on and those to validate on.
    ///
    /// # Errors
    /// No folder is given, or it cannot be used.
    pub(crate) fn divide(
        &self,
        validation: ValidationArgs,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Splits, Failure> {
        let options = self.options(validation.validation);
        Splits::open(self.folder()?, &options, trained_with, progress).map_err(or_give_size)
    }

    /// Returns how the views are read and divided.
    fn options(&self, validation: Validation) -> SplitOptions {
        SplitOptions { size: self.size, resolution: self.resolution, validation, is_static: self.is_static }
    }

    fn folder(&self) -> Result<&Path, Failure> {
        self.data.as_deref().ok_or_else(|| {
            Failure::new(
                "the training views are needed: give --data DIR, the folder of the dataset that the capture was trained on",
            )
        })
    }
}

/// How validation views are found.
#[derive(Debug, Clone, Copy, clap::Args)]
#[command(next_help_heading = "Validation")]
pub(crate) struct ValidationArgs {
    /// Validation views, on which every choice is made and nothing is trained before: those of the dataset's own split
    /// `val` (file), whole cameras, blocks of time (times), or none; auto takes the first of these that the data
    /// allows.
    #[arg(long, value_name = "VIEWS", default_value = "auto", value_parser = values::one_of(&Validation::NAMES))]
    pub validation: Validation,
    /// Skip the check that the images show the capture.
    #[arg(long)]
    pub trust_images: bool,
}

/// Returns the failure of a verb that has the option `--size`, which is a further remedy for an unknown size.
pub(super) fn or_give_size(error: DatasetError) -> Failure {
    match &error {
        DatasetError::SizeUnknown { .. } => Failure::new(format!("{error}, or give --size WxH")),
        _ => error.into(),
    }
}

/// Where the training and test views are.
#[derive(clap::Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct SplitArgs {
    /// Folder of the dataset, with `transforms_train.json` and `transforms_test.json` (Blender, D-NeRF),
    /// `transforms.json` (nerfstudio), `poses_bounds.npy` (N3V), `sparse/0` (COLMAP) and others (docs/command.md); gs4d
    /// info DIR describes it.
    #[arg(long, value_name = "DIR")]
    pub data: PathBuf,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub resolution: Option<i32>,
    /// Read every view at time 0, as of a scene at rest; images in subfolders of a COLMAP dataset are then no frames of
    /// cameras.
    #[arg(id = "static", long = "static")]
    pub is_static: bool,
}

impl SplitArgs {
    /// Adds the files of the folder to those that the verb reads.
    pub(crate) fn add_to(&self, files: Files) -> Files {
        files.reads_data(&self.data)
    }

    /// Returns the views of a split; see [`open_split`].
    ///
    /// # Errors
    /// A split that is missing or cannot be used.
    pub(crate) fn open(
        &self,
        split: Split,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Dataset, DatasetError> {
        open_split(&self.data, split, &self.options(Validation::None), trained_with, progress)
    }

    /// Returns how the views are read and divided.
    pub(crate) fn options(&self, validation: Validation) -> SplitOptions {
        SplitOptions { size: None, resolution: self.resolution, validation, is_static: self.is_static }
    }

    /// Returns the views to train on and those to validate on.
    ///
    /// # Errors
    /// A folder that cannot be used, or does not allow such validation views.
    pub(crate) fn divide(
        &self,
        validation: ValidationArgs,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Splits, DatasetError> {
        Splits::open(&self.data, &self.options(validation.validation), trained_with, progress)
    }
}
