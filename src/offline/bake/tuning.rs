//! The stage fine-tune of a bake.
//!
//! In: the remaining Gaussians, the images to train and to validate on. Out: the Gaussians after training, and how their quality developed
//! ([`Tuning`]).

use super::Bake;
use crate::offline::engine::Engine;
use crate::offline::fine_tune::{CurvePoint, FineTuneSettings, Resume, fine_tune};
use crate::offline::quantize::CompressSettings;
use crate::offline::stages::Stages;
use crate::offline::store::Key;
use crate::offline::stored::Text;
use crate::offline::{OfflineError, Progress};
use crate::scene::{GaussianScene, SceneForm};
use serde::{Deserialize, Serialize};

/// A short training has this fraction of the steps.
const SHORT: usize = 5;
/// The codebooks of colors are trained for this fraction of the steps.
const CODING: usize = 3;

/// How the quality developed.
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

impl Bake<'_> {
    /// Trains the remaining Gaussians. Returns them with their key; as they are, without a tuning, if that is left out.
    pub(super) fn fine_tune(
        &mut self,
        stages: &mut Stages<'_>,
        scene: GaussianScene,
        key: Key,
    ) -> Result<(GaussianScene, Option<Tuning>, Key), OfflineError> {
        let Some(tuning) = self.tunes().cloned() else {
            stages.leave_out("fine-tune", self.reason_to_leave_out().as_deref());
            return Ok((scene, None, key));
        };
        let inputs = key.with(self.images_key).and(&format!("{tuning:?}"));
        let ((Text(tuning), scene), key) = stages.run(
            "fine-tune",
            inputs,
            |_| true,
            |progress| {
                let images = self.images(progress)?;
                let Engine::Gpu(headless) = &mut *self.engine else { return Err(OfflineError::NotTrained) };
                let resume = Resume { store: &self.store, key: inputs, every: tuning.evaluate_every };
                let tuned = fine_tune(headless, scene, &images, &tuning, Some(resume), progress)?;
                let tuning = Tuning { curve: tuned.curve, best: tuned.best, validation: tuned.validation };
                Ok((Text(tuning), tuned.scene))
            },
        )?;
        Ok((scene, Some(tuning), key))
    }

    /// Trains the codebooks of a fine-tuned scene and compresses it; returns the scene as it is if the quality has no codebooks.
    pub(super) fn with_codebooks(
        &mut self,
        scene: GaussianScene,
        key: Key,
        progress: &mut dyn Progress,
    ) -> Result<GaussianScene, OfflineError> {
        let quality = self.settings.quality;
        let Some(tuning) = self.tunes().filter(|_| !CompressSettings::from(quality).codebooks.is_empty()).cloned()
        else {
            return Ok(scene);
        };
        let images = self.images(progress)?;
        let Engine::Gpu(headless) = &mut *self.engine else { return Ok(scene) };
        let compress = Some((quality, tuning.steps / CODING));
        let coding = FineTuneSettings { steps: 0, compress, ..tuning };
        let resume = Resume { store: &self.store, key, every: coding.evaluate_every };
        Ok(fine_tune(headless, scene, &images, &coding, Some(resume), progress)?.scene)
    }

    /// Returns the settings of training; `None` if the remaining Gaussians are not trained.
    pub(super) fn tunes(&self) -> Option<&FineTuneSettings> {
        let can = matches!(self.engine, Engine::Gpu(_)) && self.obstacle().is_none();
        self.settings.fine_tune.as_ref().filter(|_| can)
    }

    /// Returns why the stage is left out although the settings ask for it; `None` if they do not.
    fn reason_to_leave_out(&self) -> Option<String> {
        self.settings.fine_tune.as_ref()?;
        let software = "it needs a GPU; --engine gpu takes one with a software driver, slowly".to_owned();
        Some(self.obstacle().unwrap_or(software))
    }

    /// Returns why the scene cannot be trained; `None` if it can be.
    fn obstacle(&self) -> Option<String> {
        if !matches!(self.subject.scene.form, SceneForm::Trained(_)) {
            return Some("the scene is not in the trained form".to_owned());
        }
        let missing = self.views.iter().find(|view| !view.image.is_file())?;
        Some(format!("{} is missing", missing.image.display()))
    }
}
