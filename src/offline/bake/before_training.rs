//! What can be refused before the training from pictures that precedes a bake.
//!
//! In: the settings of both, perhaps an engine. Out: the error of the training, or of a stage after it, that would fail
//! because of the settings, the engine, the cameras and the paths alone; the views.

use super::BakeError;
use super::ahead::check;
use super::inputs::key_frames;
use super::settings::BakeSettings;
use super::size::require_least;
use crate::offline::dataset::require_images;
use crate::offline::engine::Engine;
use crate::offline::store::outputs::Files;
use crate::offline::train::{Divided, TrainError, TrainSettings};
use crate::offline::work::Progress;
use crate::scene::GaussianScene;
use crate::scene::synth::{SynthSettings, synthesize};

/// Checks a bake that begins with a training from pictures, before any image is read.
///
/// # Errors
/// The first fault of the settings, the paths, the views or the engine.
pub(crate) fn check_pictures(
    settings: &BakeSettings,
    training: &TrainSettings,
    engine: &Engine,
    progress: &mut dyn Progress,
) -> Result<(), BakeError> {
    if let Engine::Cpu = engine {
        return Err(TrainError::WithoutGpu.into());
    }
    let Divided { splits, views, .. } = divided(settings, training, progress)?;
    check(settings, &splits, &views, engine)
}

/// Returns the views of such a bake, after the checks that do not depend on the machine.
///
/// # Errors
/// The first fault of the settings, the paths or the views.
pub(super) fn divided(
    settings: &BakeSettings,
    training: &TrainSettings,
    progress: &mut dyn Progress,
) -> Result<Divided, BakeError> {
    settings.check_files()?;
    Files::default().reads_data(&settings.data).writes_regular(&settings.checkpoint, "gs4d").check()?;
    let divided = training.divide(progress)?;
    require_images(&divided.splits.validation)?;
    // The smallest package has no Gaussians and no environment map.
    let one = synthesize(&SynthSettings { count: 1, ..SynthSettings::default() });
    let (trained_with, playback) = (divided.trained_with.clone(), divided.playback);
    let scene = GaussianScene { trained_with, playback, sound: settings.sound()?, ..one };
    require_least(&scene, settings, key_frames(settings, &divided.views), settings.fine_tune.is_some())?;
    Ok(divided)
}
