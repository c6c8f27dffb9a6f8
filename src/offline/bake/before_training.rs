//! What can be refused before the training from pictures that precedes a bake.
//!
//! In: the settings of both, an engine. Out: the error of the training or of the stage after it that would fail because of these, the cameras and
//! the paths alone.

use super::ahead::check;
use super::inputs::key_frames;
use super::size::require_least;
use crate::offline::bake_settings::BakeSettings;
use crate::offline::dataset::require_images;
use crate::offline::engine::Engine;
use crate::offline::files::Files;
use crate::offline::train::{Divided, TrainSettings};
use crate::offline::{OfflineError, Progress};
use crate::scene::GaussianScene;
use crate::scene::synth::{SynthSettings, synthesize};

/// Checks a bake that begins with a training from pictures, before any image is read.
///
/// # Errors
/// The first fault of the settings, the paths, the views or the engine that this stage or a later one would find.
pub(crate) fn check_pictures(
    settings: &BakeSettings,
    training: &TrainSettings,
    engine: &Engine,
    progress: &mut dyn Progress,
) -> Result<(), OfflineError> {
    if let Engine::Cpu = engine {
        return Err(OfflineError::TrainingWithoutGpu);
    }
    settings.check_files()?;
    Files::default().reads_data(&settings.data).writes_regular(&settings.checkpoint, "gs4d").check()?;
    let Divided { splits, views, trained_with, playback } = training.divide(progress)?;
    require_images(&splits.validation)?;
    check(settings, &splits, &views, engine)?;
    // The capture has at least the bytes of one without Gaussians and without an environment map.
    let one = synthesize(&SynthSettings { count: 1, ..SynthSettings::default() });
    let scene = GaussianScene { trained_with, playback, ..one };
    require_least(&scene, settings, key_frames(settings, &views), settings.fine_tune.is_some())
}
