//! Training: from pictures alone, or from a scene (fine-tuning).
//!
//! In: training views with their images, and either nothing else ([`begin`] makes the Gaussians of the first step) or a
//! scene in the trained form. Out: the scene with the best parameters that were found ([`FineTuned`]), and how its
//! quality developed.
//!
//! The best step is chosen on validation views, which are not trained on; without validation views, the last step is
//! kept. The loss is `0.9 L1 + 0.1 (1 − SSIM)` unless set otherwise, with further [`Terms`] if these have weights, the
//! optimizer Adam (section 6 of the 4DGS model). Views, backgrounds and rates of a step follow from its number alone,
//! so that a run which is resumed ends as one which was not interrupted. Fine-tuning keeps the number of Gaussians;
//! training from pictures is the same with [`Growth`]: Gaussians that fade are relocated, or, for comparison with the
//! original, Gaussians are cloned, split and removed within a fixed capacity. If the scene is compressed, further steps
//! train codebooks of color with everything else, on request on pictures of rounded geometry.
//!
//! | module | subject |
//! |---|---|
//! | `from_pictures` | the whole of a training, from the folder of a dataset to the trained capture |
//! | `start` | the scene before the first step |
//! | `images` | the images to train on |
//! | `settings`, `densification`, `schedule` | what a run is asked for, and what that says of each step |
//! | `every_view`, `usual` | the views of the dataset, and what is chosen by them |
//! | `phases` | the phases of a run: steps, evaluations, states; codebooks |
//! | `trainer` | one step on the GPU |
//! | `parts` | the optional parts of a step, behind one trait and in one list |
//! | `gpu` | the buffers and passes that every training has |
//! | `reference` | the CPU reference of every pass, with the rules of the papers |
//! | `results` | the best parameters, the curve, the stored state, previews |

pub(crate) mod densification;
pub(crate) mod error;
mod every_view;
pub(crate) mod from_pictures;
pub(crate) mod gpu;
pub(crate) mod images;
pub(crate) mod memory;
pub(crate) mod parts;
mod phases;
pub(crate) mod reference;
pub(crate) mod results;
pub(crate) mod schedule;
pub(crate) mod settings;
pub(crate) mod start;
pub(crate) mod trainer;
pub(crate) mod trainer_error;
pub(crate) mod untrainable;
pub(crate) mod usual;

pub use densification::Growth;
pub(crate) use densification::{Births, Cloning, Floaters};
pub use error::TrainError;
pub(crate) use from_pictures::Divided;
pub use from_pictures::{TrainSettings, TrainedCapture, Training};
pub(crate) use gpu::{GpuImage, Sample};
pub use images::{Coarse, ImageRoom, TrainingImages};
pub use phases::fine_tune;
pub use reference::terms::Terms;
pub use results::{CurvePoint, FineTuned, Resume};
pub use schedule::{Behind, Rates};
pub use settings::FineTuneSettings;
pub use start::{CaptureSettings, Start, StartError, StartSettings, begin, capture_of};
pub(crate) use trainer::Trainer;
pub use trainer_error::TrainerError;
pub use usual::Usual;

use super::work::Progress;
use crate::renderer::Headless;
use crate::scene::GaussianScene;
use phases::fine_tune_watched;
use results::live_package::{Scene, Writer};
use std::path::Path;

/// Trains a scene that [`begin`] has made. At each evaluation that finds better parameters, the scene is written to
/// `out`, whole or not at all, in the background; the result is not. Begins the task "training".
///
/// # Errors
/// A scene that does not fit the GPU, no images, a lost device, a package that cannot be written;
/// [`TrainError::Interrupted`], with the best result so far, if the user has asked to end.
pub fn train(
    headless: &mut Headless,
    scene: GaussianScene,
    images: &TrainingImages,
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    out: Option<&Path>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, TrainError> {
    let mut writer = out.map(Writer::new);
    let mut watch = |scene: Scene<'_>| writer.as_mut().map_or(Ok(()), |writer| writer.write(scene));
    let trained = fine_tune_watched(headless, scene, images, settings, resume, &mut watch, progress);
    let written = writer.map_or(Ok(()), Writer::finish);
    let trained = trained?;
    written?;
    Ok(trained)
}
