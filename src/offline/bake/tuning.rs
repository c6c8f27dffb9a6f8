//! The stage fine-tune of a bake.
//!
//! In: the remaining Gaussians, the training views with their images. Out: the Gaussians after training, and how their quality developed
//! ([`Tuning`]).

use super::stages::Stages;
use super::{Bake, Fingerprint, Stage};
use crate::codec::package::{self, WriteSettings};
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::fine_tune::{CurvePoint, FineTuneSettings, Resume, fine_tune};
use crate::offline::quantize::CompressSettings;
use crate::offline::{OfflineError, Progress};
use crate::scene::{GaussianScene, SceneForm};
use serde::{Deserialize, Serialize};
use std::io::Cursor;

/// How the quality developed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Tuning {
    pub curve: Vec<CurvePoint>,
    pub best: CurvePoint,
    pub held_out: usize,
}

impl Bake<'_> {
    /// Trains the remaining Gaussians. Returns them as they are, without a tuning, if that is left out.
    pub(super) fn fine_tune(
        &mut self,
        stages: &mut Stages<'_>,
        pruned: GaussianScene,
        before: Fingerprint,
    ) -> Result<(GaussianScene, Option<Tuning>, Fingerprint), OfflineError> {
        const FILES: [&str; 2] = ["tuned.gs4d", "tuned.ron"];
        let fingerprint = before.and(&format!("{:?}", self.settings.fine_tune));
        let load = |file| self.work.load(file, fingerprint);
        let stored = load(FILES[0]).and_then(|bytes| package::read(Cursor::new(bytes)).ok());
        let stored = stored.zip(load(FILES[1]).and_then(|text| ron::de::from_bytes::<Tuning>(&text).ok()));
        let Self { settings, engine, views, work, .. } = self;
        let (Some(tuning), Engine::Gpu(headless), None) = (&settings.fine_tune, engine, reason_of(&pruned, views))
        else {
            stages.note_left_out(Stage::FineTune, self.reason_to_leave_out(&pruned).as_deref());
            return Ok((pruned, None, before));
        };
        let (scene, tuning) = stages.run(Stage::FineTune, stored, |progress| {
            let resume = Resume { work, fingerprint, every: tuning.evaluate_every };
            let tuned = fine_tune(headless, pruned, views, tuning, Some(resume), progress)?;
            let tuning = Tuning { curve: tuned.curve, best: tuned.best, held_out: tuned.held_out };
            let mut bytes = Vec::new();
            let written = package::write(&mut bytes, &tuned.scene, &WriteSettings { level: 1 });
            written.map_err(|error| OfflineError::at(&work.folder().join(FILES[0]), error))?;
            work.store(FILES[0], fingerprint, &bytes, progress)?;
            work.store(FILES[1], fingerprint, ron::to_string(&tuning)?.as_bytes(), progress)?;
            Ok((tuned.scene, tuning))
        })?;
        Ok((scene, Some(tuning), fingerprint))
    }

    /// Trains the codebooks of a fine-tuned scene and compresses it; `None` if the scene has not been fine-tuned, or if the quality has no
    /// codebooks.
    pub(super) fn compress_tuned(
        &mut self,
        scene: &GaussianScene,
        tuning: Option<&Tuning>,
        fingerprint: Fingerprint,
        progress: &mut dyn Progress,
    ) -> Result<Option<GaussianScene>, OfflineError> {
        let Self { settings, engine, views, work, .. } = self;
        let coded = !CompressSettings::from(settings.quality).codebooks.is_empty();
        let (Some(_), Some(tuning), Engine::Gpu(headless), true) = (tuning, &settings.fine_tune, engine, coded) else {
            return Ok(None);
        };
        let steps = tuning.steps / 3;
        let coding = FineTuneSettings { steps: 0, compress: Some((settings.quality, steps)), ..tuning.clone() };
        let resume = Resume { work, fingerprint, every: tuning.evaluate_every };
        Ok(Some(fine_tune(headless, scene.clone(), views, &coding, Some(resume), progress)?.scene))
    }

    /// Returns the settings of training; `None` if what is left after pruning is not trained.
    pub(super) fn tunes(&self) -> Option<&FineTuneSettings> {
        let can = matches!(self.engine, Engine::Gpu(_)) && reason_of(&self.subject.scene, &self.views).is_none();
        self.settings.fine_tune.as_ref().filter(|_| can)
    }

    /// Returns why the stage is left out although it was not asked to be; `None` if it was.
    fn reason_to_leave_out(&self, pruned: &GaussianScene) -> Option<String> {
        self.settings.fine_tune.as_ref()?;
        let software = "it needs a GPU; --engine gpu takes one with a software driver, slowly".to_owned();
        Some(reason_of(pruned, &self.views).unwrap_or(software))
    }
}

/// Returns why a scene cannot be trained; `None` if it can be.
fn reason_of(scene: &GaussianScene, views: &[TrainingView]) -> Option<String> {
    if !matches!(scene.form, SceneForm::Trained(_)) {
        return Some("the scene is not in the trained form".to_owned());
    }
    let missing = views.iter().find(|view| !view.image.is_file())?;
    Some(format!("{} is missing", missing.image.display()))
}
