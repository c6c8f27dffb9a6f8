//! The views of a dataset by purpose: training, validation, test.
//!
//! In: a dataset folder, how validation views are found, the settings that the capture was trained with. Out: one
//! object ([`Splits`]) with the views to train on and those to validate on, inside the capture's time interval. Choices
//! are made on the validation views alone, and nothing is trained on these before. Test views are opened by
//! [`Splits::test`], for evaluations and reports.

use super::selection::even_subset;
use super::validation::{HeldOut, hold_out};
use super::{CameraOptions, Clock, Dataset, DatasetError, Split, TrainingView, Validation};
use crate::offline::work::progress::Progress;
use crate::scene::{Origin, TrainedWith};
use glam::UVec2;
use std::fmt;
use std::path::{Path, PathBuf};

/// Most validation views that are measured for a choice: an even subset of those held out.
const MEASURED: usize = 24;

/// Every split with its name.
pub const SPLIT_NAMES: [(&str, Split); 3] = [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)];

/// Returns the name of a split.
pub fn split_name(split: Split) -> &'static str {
    SPLIT_NAMES.iter().find(|(_, other)| *other == split).map_or("test", |(name, _)| name)
}

/// How the cameras of a dataset are read, and how its validation views are found. Default: as the files say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SplitOptions {
    /// Picture size, pixels; `None` takes that of the files.
    pub size: Option<UVec2>,
    /// Divisor of the picture size or target width, as in training; `None` keeps the size.
    pub resolution: Option<i32>,
    /// How validation views are found.
    pub validation: Validation,
    /// Whether the scene is at rest: every view has time 0.
    pub is_static: bool,
}

impl SplitOptions {
    /// Returns how cameras are read, with all times and an origin of their own.
    fn cameras(&self) -> CameraOptions {
        let Self { size, resolution, is_static, .. } = *self;
        CameraOptions { size, resolution, is_static, ..CameraOptions::default() }
    }
}

/// The views of a dataset by purpose.
#[derive(Debug, Clone, PartialEq)]
pub struct Splits {
    /// The views to train on, and to score with, before the choice.
    pub train: Vec<TrainingView>,
    /// The views that choices are made on: at most 24 of those held out. Empty if nothing could be held out.
    pub validation: Vec<TrainingView>,
    /// How the validation views were found.
    pub by: Validation,
    /// Views held out, measured or not.
    pub held_out: usize,
    /// File of points to begin training with, if the dataset names or has one. It may not exist.
    pub points: Option<PathBuf>,
    /// The meaning of the times of the views.
    pub(crate) clock: Clock,
    folder: PathBuf,
    options: SplitOptions,
}

impl Splits {
    /// Opens the training split of a folder and divides it. Views outside the time interval are dropped, as in
    /// training.
    ///
    /// # Errors
    /// A split that is missing or cannot be used, validation views that the dataset does not allow.
    pub fn open(
        folder: &Path,
        options: &SplitOptions,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Self, DatasetError> {
        let Dataset { views, points, clock, .. } = open_split(folder, Split::Train, options, trained_with, progress)?;
        let HeldOut { train, validation, by } = match Self::of_file(folder, options, trained_with, progress)? {
            Some(validation) => HeldOut { train: views, validation, by: Validation::File },
            None => hold_out(&views, options.validation).ok_or_else(|| {
                let (folder, validation) = (folder.to_owned(), options.validation);
                DatasetError::NoValidation { folder, validation }
            })?,
        };
        let held_out = validation.len();
        let validation = subset(validation, Some(MEASURED));
        let (folder, options) = (folder.to_owned(), *options);
        Ok(Self { train, validation, by, held_out, points, clock, folder, options })
    }

    /// Returns the views of the dataset's own split `val` if they are used: if it exists with its images, the options
    /// allow it, and the original does not test on it.
    fn of_file(
        folder: &Path,
        options: &SplitOptions,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Option<Vec<TrainingView>>, DatasetError> {
        let is_test = Split::Test.resolved(folder) == Split::Val;
        let exists = Dataset::has(folder, Split::Val);
        let wanted = match options.validation {
            Validation::File => true,
            Validation::Auto => exists && !is_test,
            Validation::Cameras | Validation::Times | Validation::None => false,
        };
        if !wanted {
            return Ok(None);
        }
        let dataset = open_split(folder, Split::Val, options, trained_with, progress)?;
        match dataset.require_images() {
            Ok(()) => Ok(Some(dataset.views)),
            Err(error) if options.validation == Validation::File => Err(error),
            Err(error) => {
                progress.note(&format!("note: the dataset's own split val is not used: {error}"));
                Ok(None)
            }
        }
    }

    /// Returns every view that may be trained on once all choices have been made: those to train on and, unless they
    /// come from a file of their own, those held out.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn all_training(
        &self,
        trained_with: &TrainedWith,
        progress: &mut dyn Progress,
    ) -> Result<Vec<TrainingView>, DatasetError> {
        match self.by {
            Validation::Cameras | Validation::Times => {
                Ok(open_split(&self.folder, Split::Train, &self.options, trained_with, progress)?.views)
            }
            Validation::Auto | Validation::File | Validation::None => Ok(self.train.clone()),
        }
    }

    /// Opens the test views, which no choice may look at.
    ///
    /// # Errors
    /// A split that is missing or cannot be used.
    pub fn test(&self, trained_with: &TrainedWith, progress: &mut dyn Progress) -> Result<Dataset, DatasetError> {
        open_split(&self.folder, Split::Test, &self.options, trained_with, progress)
    }
}

/// A sentence on how the views were divided.
impl fmt::Display for Splits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (train, held_out, measured) = (self.train.len(), self.held_out, self.validation.len());
        let by = match self.by {
            Validation::File => "of the dataset's own split val",
            Validation::Cameras => "of whole cameras held out",
            Validation::Times => "of blocks of time held out",
            Validation::Auto | Validation::None => return write!(f, "{train} views to train on, none to validate on"),
        };
        write!(f, "{train} views to train on, {held_out} to validate on {by}")?;
        if measured < held_out { write!(f, " ({measured} measured)") } else { Ok(()) }
    }
}

/// Returns the origin of a capture that is trained on a dataset, and reports the assumptions about the dataset as
/// notes.
///
/// # Errors
/// A training split that is missing or cannot be used.
pub(crate) fn origin_of(
    folder: &Path,
    options: &SplitOptions,
    progress: &mut dyn Progress,
) -> Result<Origin, DatasetError> {
    let found = Dataset::open_undecoded(folder, Split::Train, &options.cameras())?;
    found.note(progress);
    Ok(found.origin)
}

/// Opens a split for a capture, from whose origin places and times are counted. Views outside the time interval are
/// dropped, as in training, and their number is reported as a note, as are the assumptions about the dataset.
///
/// # Errors
/// A split that is missing or cannot be used.
pub fn open_split(
    folder: &Path,
    split: Split,
    options: &SplitOptions,
    trained_with: &TrainedWith,
    progress: &mut dyn Progress,
) -> Result<Dataset, DatasetError> {
    let options = CameraOptions { origin: Some(trained_with.origin), ..options.cameras() };
    let all = Dataset::open_with_progress(folder, split, &options, progress)?;
    all.note(progress);
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

/// Returns an even subset of at most `count` views, in their order; `None` returns all.
pub fn subset(views: Vec<TrainingView>, count: Option<usize>) -> Vec<TrainingView> {
    match count {
        Some(count) => even_subset(&views, count).into_iter().map(|index| views[index].clone()).collect(),
        None => views,
    }
}
