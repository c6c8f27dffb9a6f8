//! Training a capture from nothing but the pictures of a dataset.
//!
//! In: training views with their images. Out: a scene in the trained form, with a fixed number of native 4D Gaussians, or with at most as many
//! if they are cloned, split and removed as in the original.
//!
//! | file | subject |
//! |---|---|
//! | `capture` | the settings of a capture that follow from its views: interval of time, extent of the cameras, the axis that points up |
//! | `region` | the box that the cameras look at |
//! | `start` | the Gaussians before the first step, from points |
//! | `surroundings` | the environment map before the first step |
//! | `hull` | points inside the silhouettes of a moment |
//! | `training` | the whole of a training, from the folder of a dataset to the trained capture |
//! | `once` | the same as the first stage of a bake: a finished training is not repeated |
//! | `writer` | the package that is rewritten while training goes on |
//!
//! Training is [`fine_tune`](mod@crate::offline::fine_tune) with [`Growth`](crate::offline::fine_tune::Growth): the same passes, loss, schedules of
//! views and backgrounds, evaluations, choice of the best step and resumption.

mod capture;
mod error;
mod hull;
mod once;
mod point;
mod region;
mod start;
mod surroundings;
mod training;
mod writer;

pub use capture::{CaptureSettings, capture_of};
pub use error::StartError;
pub use once::{train_dataset, trained_path};
pub use start::{Start, StartSettings, begin};
pub(crate) use training::Divided;
pub use training::{TrainSettings, TrainedCapture, Training};

use super::fine_tune::{FineTuneSettings, FineTuned, Resume, Scene, TrainingImages, fine_tune_watched};
use super::{OfflineError, Progress};
use crate::renderer::Headless;
use crate::scene::GaussianScene;
use std::path::Path;
use writer::Writer;

/// Trains a scene that [`begin`] has made. At each evaluation that finds better parameters, the scene is written to `out`, whole or not at
/// all, in the background; the result is not. Begins the task "training".
///
/// # Errors
/// A scene that does not fit the GPU, no images, a lost device, a package that cannot be written; [`OfflineError::Interrupted`], with the
/// best result so far, if the user has asked to end.
pub fn train(
    headless: &mut Headless,
    scene: GaussianScene,
    images: &TrainingImages,
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    out: Option<&Path>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, OfflineError> {
    let mut writer = out.map(Writer::new);
    let mut watch = |scene: Scene<'_>| writer.as_mut().map_or(Ok(()), |writer| writer.write(scene));
    let trained = fine_tune_watched(headless, scene, images, settings, resume, &mut watch, progress);
    let written = writer.map_or(Ok(()), Writer::finish);
    let trained = trained?;
    written?;
    Ok(trained)
}
