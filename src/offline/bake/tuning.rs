//! The stage fine-tune of a bake.
//!
//! In: the remaining Gaussians, the images to train and to validate on. Out: the Gaussians after training, and their
//! quality at each evaluation ([`Tuning`]).

use super::BakeError;
use super::inputs::Inputs;
use crate::offline::compress::CompressSettings;
use crate::offline::engine::Engine;
use crate::offline::store::results::Key;
use crate::offline::store::stages::Stages;
use crate::offline::store::stored::Text;
use crate::offline::train::{self, CurvePoint, FineTuneSettings, Resume, TrainError};
use crate::offline::work::Progress;
use crate::scene::GaussianScene;
use serde::{Deserialize, Serialize};

/// Fraction of the steps in a short training.
const SHORT: usize = 5;
/// Fraction of the steps in the training of codebooks of colors.
const CODING: usize = 3;

/// The quality at each evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Tuning {
    pub curve: Vec<CurvePoint>,
    pub best: CurvePoint,
    /// Number of validation views.
    pub validation: usize,
}

/// Returns the settings of a short training.
pub(super) fn short(settings: &FineTuneSettings) -> FineTuneSettings {
    let steps = settings.steps.div_ceil(SHORT);
    FineTuneSettings { steps, evaluate_every: steps.max(1), compress: None, ..settings.clone() }
}

/// The stage fine-tune: trains the remaining Gaussians. Returns the Gaussians and their key; if the stage is left out,
/// unchanged Gaussians and no tuning.
pub(super) fn fine_tune(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scene: GaussianScene,
    key: Key,
) -> Result<(GaussianScene, Option<Tuning>, Key), BakeError> {
    let Some(tuning) = inputs.tunes().cloned() else {
        stages.leave_out("fine-tune", inputs.reason_to_leave_out().as_deref());
        return Ok((scene, None, key));
    };
    let key = key.with(inputs.cameras_key).with(inputs.images_key()).and(&format!("{tuning:?}"));
    let ((Text(tuning), scene), key) = stages.run(
        "fine-tune",
        key,
        |_| true,
        |progress| -> Result<_, BakeError> {
            let images = inputs.images(progress)?;
            let Engine::Gpu(headless) = &mut *inputs.engine else { return Err(TrainError::WithoutGpu.into()) };
            let resume = Resume { store: &inputs.store, key, every: tuning.evaluate_every };
            let tuned = train::fine_tune(headless, scene, &images, &tuning, Some(resume), progress)?;
            let tuning = Tuning { curve: tuned.curve, best: tuned.best, validation: tuned.validation };
            Ok((Text(tuning), tuned.scene))
        },
    )?;
    Ok((scene, Some(tuning), key))
}

/// Trains the codebooks of a fine-tuned scene and compresses it; returns the scene unchanged if the quality has no
/// codebooks.
pub(super) fn with_codebooks(
    inputs: &mut Inputs<'_>,
    scene: GaussianScene,
    key: Key,
    progress: &mut dyn Progress,
) -> Result<GaussianScene, BakeError> {
    let quality = inputs.settings.quality;
    let Some(tuning) = inputs.tunes().filter(|_| !CompressSettings::from(quality).codebooks.is_empty()).cloned() else {
        return Ok(scene);
    };
    let images = inputs.images(progress)?;
    let Engine::Gpu(headless) = &mut *inputs.engine else { return Ok(scene) };
    let compress = Some((quality, tuning.steps / CODING));
    let order = inputs.settings.order.clone();
    let coding = FineTuneSettings { steps: 0, compress, order, ..tuning };
    let resume = Resume { store: &inputs.store, key, every: coding.evaluate_every };
    Ok(train::fine_tune(headless, scene, &images, &coding, Some(resume), progress)?.scene)
}
