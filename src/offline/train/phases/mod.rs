//! Fine-tuning and training: the phases of a run, one after the other. Training from pictures is the same with
//! [`Growth`](super::Growth).
//!
//! In: a scene, training images and settings, optionally a stored state. Out: the scene with the best parameters.
//!
//! | file | subject |
//! |---|---|
//! | `steps` | the first phase: steps, evaluations, states |
//! | `codebook_phase` | the last phase: codebooks of color, compression |
//! | `session` | what both phases use: one step, one evaluation, the scene of a run |
//! | `first_exposures` | the exposures before the first step of fine-tuning |
//! | `batch` | the views and images of a step |
//! | `evaluation` | the PSNR on the validation views |
//! | `repair` | births where cameras see an error, floaters |

mod batch;
mod codebook_phase;
mod evaluation;
mod first_exposures;
mod repair;
mod session;
mod steps;

use super::error::TrainError;
use super::images::TrainingImages;
use super::results::best_parameters::Progressed;
use super::results::stored_state::{Checkpoint, Saves};
use super::results::{FineTuned, Resume};
use super::settings::FineTuneSettings;
use crate::offline::work::Progress;
use crate::renderer::Headless;
use crate::scene::GaussianScene;
use codebook_phase::compress;
use session::Session;
use steps::{Watch, train};

/// Trains a scene on images. What its temporal filter leaves out is not drawn in training either; a filter of the kind
/// support, which changes no picture, is computed again afterwards. Begins the task "fine-tuning", or "training" with
/// [`growth`](FineTuneSettings::growth).
///
/// # Errors
/// A scene that is not in the trained form or does not fit the GPU, no images, a lost device;
/// [`TrainError::Interrupted`], with the best result so far, if the user has asked to end.
pub fn fine_tune(
    headless: &mut Headless,
    scene: GaussianScene,
    images: &TrainingImages,
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, TrainError> {
    fine_tune_watched(headless, scene, images, settings, resume, &mut |_| Ok(()), progress)
}

/// As [`fine_tune`]; `watch` gets the scene whenever an evaluation before the last step finds better parameters.
///
/// # Errors
/// As [`fine_tune`], and those of `watch`.
pub(crate) fn fine_tune_watched(
    headless: &mut Headless,
    scene: GaussianScene,
    images: &TrainingImages,
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    watch: Watch<'_>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, TrainError> {
    let mut session = Session::open(headless, scene, images, settings)?;
    let saves = resume.map(|resume| Saves::new(resume, settings));
    let stored = saves.and_then(Saves::load);
    let stored = stored.filter(|stored| session.trainer.resume(&stored.best.state));
    if stored.is_none() {
        session.begin_exposures()?;
    }
    let is_coded = |stored: &&Checkpoint| stored.coded.is_some();
    let mut found = match stored.as_ref().filter(is_coded) {
        Some(Checkpoint { curve, best, .. }) => Progressed { curve: curve.clone(), best: best.clone(), pace: (0, 0.0) },
        None => train(&mut session, stored.clone(), saves, watch, progress)?,
    };
    session.trainer.resume(&found.best.state);
    let scene = match settings.compress {
        Some((quality, steps)) => compress(&mut session, quality, steps, &mut found, stored, saves, progress)?,
        None => session.scene()?,
    };
    session.finished(scene, found)
}
