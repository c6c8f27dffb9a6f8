//! The stages of a bake as they go by.
//!
//! In: the stages, each with the result of an earlier bake where there is one. Out: their results; one task for all of
//! them, a note for each, and how long each took.

use crate::offline::report::StageTime;
use crate::offline::{OfflineError, Progress};
use serde::Serialize;
use std::time::Instant;

/// Stages of a bake, without the fine-tuning that is to come.
const STAGES: usize = 6;

/// The stages of a bake, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// How much each Gaussian contributes to the training views.
    Score,
    /// Which Gaussians stay.
    Prune,
    /// Training of those that stay, to make up for those that left. Not part of a bake yet.
    FineTune,
    /// Which of them are active when.
    Mask,
    /// Quantization and the package.
    Compress,
    /// How close the package is to the test views.
    Evaluate,
    /// What it all cost.
    Report,
}

impl Stage {
    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Score => "score",
            Self::Prune => "prune",
            Self::FineTune => "fine-tune",
            Self::Mask => "mask",
            Self::Compress => "compress",
            Self::Evaluate => "evaluate",
            Self::Report => "report",
        }
    }
}

/// The stages so far.
pub(super) struct Stages<'a> {
    progress: &'a mut dyn Progress,
    times: Vec<StageTime>,
}

impl<'a> Stages<'a> {
    /// Before the first stage. Begins the task "bake".
    pub fn begin(progress: &'a mut dyn Progress) -> Self {
        progress.begin("bake", STAGES);
        Self { progress, times: Vec::new() }
    }

    /// Runs a stage, unless its result is already there.
    ///
    /// # Errors
    /// What the stage reports.
    pub fn run<T>(
        &mut self,
        stage: Stage,
        stored: Option<T>,
        work: impl FnOnce(&mut dyn Progress) -> Result<T, OfflineError>,
    ) -> Result<T, OfflineError> {
        let start = Instant::now();
        let skipped = stored.is_some();
        let result = match stored {
            Some(result) => result,
            None => work(self.progress)?,
        };
        let (name, seconds) = (stage.name().to_owned(), start.elapsed().as_secs_f64());
        let duration = if skipped { "skipped, done before".to_owned() } else { format!("{seconds:.1} s") };
        self.progress.note(&format!("{name}: {duration}"));
        self.times.push(StageTime { name, seconds, skipped });
        self.progress.advance();
        Ok(result)
    }

    /// How long the stages so far took.
    pub fn times(&self) -> Vec<StageTime> {
        self.times.clone()
    }

    /// After the last stage.
    pub fn finish(self) {
        self.progress.finish();
    }
}
