//! Fine-tuning: its phases, one after the other.
//!
//! In: a scene, training images and settings, optionally a stored state. Out: the scene with the best parameters.

use super::best::Progressed;
use super::coding::compress;
use super::outcome::FineTuned;
use super::resume::{Checkpoint, Resume, Saves};
use super::run::Run;
use super::settings::FineTuneSettings;
use super::targets::TrainingImages;
use super::training::{Watch, train};
use crate::offline::{OfflineError, Progress};
use crate::renderer::Headless;
use crate::scene::GaussianScene;

/// Trains a scene on images. What its temporal filter leaves out is not drawn in training either; a filter of the kind support, which
/// changes no picture, is computed again afterwards. Begins the task "fine-tuning", or "training" with
/// [`growth`](FineTuneSettings::growth).
///
/// # Errors
/// A scene that is not in the trained form or does not fit the GPU, no images, a lost device; [`OfflineError::Interrupted`], with the best
/// result so far, if the user has asked to end.
pub fn fine_tune(
    headless: &mut Headless,
    scene: GaussianScene,
    images: &TrainingImages,
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, OfflineError> {
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
) -> Result<FineTuned, OfflineError> {
    let mut run = Run::open(headless, scene, images, settings)?;
    let saves = resume.map(|resume| Saves::new(resume, settings));
    let stored = saves.and_then(Saves::load);
    let stored = stored.filter(|stored| run.trainer.resume(&stored.best.state));
    let is_coded = |stored: &&Checkpoint| stored.coded.is_some();
    let mut found = match stored.as_ref().filter(is_coded) {
        Some(Checkpoint { curve, best, .. }) => Progressed { curve: curve.clone(), best: best.clone(), pace: (0, 0.0) },
        None => train(&mut run, stored.clone(), saves, watch, progress)?,
    };
    run.trainer.resume(&found.best.state);
    let scene = match settings.compress {
        Some((quality, steps)) => compress(&mut run, quality, steps, &mut found, stored, saves, progress)?,
        None => run.scene()?,
    };
    run.finished(scene, found)
}
