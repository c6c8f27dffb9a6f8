//! What can be refused before the training from pictures that precedes a bake.
//!
//! In: the settings of both, an engine. Out: the error of the training, or of a stage after it, that would fail because
//! of the settings, the engine, the cameras and the paths alone.

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
    settings.check_files()?;
    Files::default().reads_data(&settings.data).writes_regular(&settings.checkpoint, "gs4d").check()?;
    let Divided { splits, views, trained_with, playback } = training.divide(progress)?;
    require_images(&splits.validation)?;
    check(settings, &splits, &views, engine)?;
    // The smallest package has no Gaussians and no environment map.
    let one = synthesize(&SynthSettings { count: 1, ..SynthSettings::default() });
    let scene = GaussianScene { trained_with, playback, sound: settings.sound()?, ..one };
    require_least(&scene, settings, key_frames(settings, &views), settings.fine_tune.is_some())
}
