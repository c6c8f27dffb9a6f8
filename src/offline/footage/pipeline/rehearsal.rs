//! A short training on the dataset, which tells what quality can be expected.
//!
//! In: the folder of a dataset that has been written, with its points; a GPU. Out: [`Rehearsed`]: the PSNR of the
//! cameras that were held out. Test cameras are not looked at, and the capture is not kept.

use super::output::Unfinished;
use super::source::Source;
use crate::offline::dataset::splits::SplitOptions;
use crate::offline::dataset::{Split, Validation};
use crate::offline::engine::GpuSettings;
use crate::offline::footage::FootageError;
use crate::offline::footage::verdict::Rehearsal;
use crate::offline::store::results::Store;
use crate::offline::train::{Start, StartSettings, TrainError, TrainSettings, TrainedCapture, Training, Usual};
use crate::offline::work::{Interrupted, Progress};
use glam::UVec2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Number of steps, and of Gaussians.
const STEPS: usize = 1000;
const GAUSSIANS: usize = 30_000;
/// Longest side of the pictures, pixels.
const LONGEST: u32 = 320;
/// Least width of the pictures, pixels. Smaller resolutions divide the size.
const NARROWEST: u32 = 16;
/// The folder, the package in it, and the ending of the folder of states beside it; all are removed at the end.
const FOLDER: &str = "rehearsal";
const PACKAGE: &str = "rehearsal.gs4d";
const STATES: &str = ".train";

/// What a short training has reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Rehearsed {
    /// PSNR of the views held out, dB.
    db: f32,
    /// Number of views held out that were measured.
    views: usize,
}

impl Rehearsed {
    /// Trains on the dataset in the folder `out`; `None`, with a note, if no capture can begin from its views. At least
    /// two cameras are to train on. Begins the tasks of a training.
    ///
    /// # Errors
    /// No GPU, or one that fails; a folder that cannot be written to; an interruption.
    pub(super) fn of(
        source: &Source,
        has_points: bool,
        out: &Path,
        progress: &mut dyn Progress,
    ) -> Result<Option<Self>, FootageError> {
        let folder = Unfinished::begin(out, FOLDER)?;
        let package = folder.path("", PACKAGE)?;
        match train(&settings(source, has_points, out), &package, progress) {
            Ok(TrainedCapture { interrupted: true, .. }) => Err(Interrupted.into()),
            Ok(TrainedCapture { tuned, .. }) => {
                let db = tuned.best.psnr.map(|db| db as f32).filter(|db| db.is_finite());
                Ok(db.map(|db| Self { db, views: tuned.validation }))
            }
            Err(error @ TrainError::Start { .. }) => {
                progress.note(&format!("note: nothing is rehearsed: {error}"));
                Ok(None)
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Returns the result as evidence for the verdict.
    pub(super) fn evidence(self) -> Rehearsal {
        let Self { db, views } = self;
        Rehearsal { db, views }
    }
}

/// Trains a capture, which is written to `package` as long as it improves.
fn train(settings: &TrainSettings, package: &Path, progress: &mut dyn Progress) -> Result<TrainedCapture, TrainError> {
    let mut headless = GpuSettings::default().open()?;
    let store = Store::beside(package, STATES)?;
    Training::open(settings, progress)?.run(&mut headless, &store, Some(package), progress)
}

/// Returns the settings of the training.
fn settings(source: &Source, has_points: bool, out: &Path) -> TrainSettings {
    let trained = source.shots.iter().filter(|shot| shot.split == Split::Train);
    let resolution = width(trained.map(|shot| shot.view.camera.size));
    let splits = SplitOptions { resolution, validation: Validation::Cameras, ..SplitOptions::default() };
    let start = if has_points { Start::Points } else { Start::Auto };
    TrainSettings {
        start: StartSettings { gaussians: GAUSSIANS, start, ..StartSettings::default() },
        tuning: TrainSettings::tuning(STEPS),
        ..TrainSettings::usual(out.to_owned(), splits, &Usual::PLAIN)
    }
}

/// Returns the width at which no picture of these sizes has a side of more than 320 pixels; `None` if none has one.
fn width(sizes: impl Iterator<Item = UVec2>) -> Option<i32> {
    let long = sizes.filter(|size| size.max_element() > LONGEST);
    let widths = long.map(|size| (size.x * LONGEST / size.max_element()).max(NARROWEST));
    widths.min().and_then(|width| i32::try_from(width).ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::dataset::Clock;

    #[test]
    fn pictures_are_reduced_to_320_pixels_on_their_longer_side() {
        let sizes = |sizes: &[[u32; 2]]| width(sizes.iter().copied().map(UVec2::from));
        assert_eq!(sizes(&[[1080, 1920], [1088, 1920]]), Some(180), "of portraits the height counts");
        assert_eq!(sizes(&[[640, 360], [100, 80]]), Some(320), "of others the width");
        assert_eq!(sizes(&[[320, 180], [180, 320]]), None, "small pictures stay as they are");
        assert_eq!(sizes(&[[10, 16_000]]), Some(16), "a width that is no divisor");
    }

    #[test]
    fn whole_cameras_are_held_out_and_the_points_of_the_dataset_are_begun_with() {
        let source = Source { cameras: Vec::new(), shots: Vec::new(), clock: Clock::default(), points: None };
        let of = |has_points| settings(&source, has_points, Path::new("out"));
        assert_eq!(of(true).splits.validation, Validation::Cameras, "as the verdict says");
        assert_eq!([true, false].map(|has_points| of(has_points).start.start), [Start::Points, Start::Auto], "points");
        assert_eq!((of(true).tuning.steps, of(true).start.gaussians), (STEPS, GAUSSIANS), "a short training");
    }
}
