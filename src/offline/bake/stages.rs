//! The stages of a bake, run one after the other.
//!
//! In: the work of each stage, and its result of an earlier bake if there is one. Out: the results; a task for the
//! whole bake, a note for each stage, and its duration.

use crate::offline::report::StageTime;
use crate::offline::{OfflineError, Progress};
use serde::Serialize;
use std::time::Instant;

/// Number of stages of a bake.
const STAGES: usize = 8;

/// The stages of a bake, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Scores the Gaussians over the training views.
    Score,
    /// Selects the Gaussians to keep.
    Prune,
    /// Removes them in several rounds, with training between.
    Rounds,
    /// Trains the remaining Gaussians to compensate for the removed ones.
    FineTune,
    /// Computes the temporal filter.
    Mask,
    /// Quantizes the scene and writes the package.
    Compress,
    /// Compares the package with the test views.
    Evaluate,
    /// Writes the report.
    Report,
}

impl Stage {
    /// Returns its name, in kebab-case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Score => "score",
            Self::Prune => "prune",
            Self::Rounds => "rounds",
            Self::FineTune => "fine-tune",
            Self::Mask => "mask",
            Self::Compress => "compress",
            Self::Evaluate => "evaluate",
            Self::Report => "report",
        }
    }
}

/// The durations of the stages run so far.
pub(super) struct Stages<'a> {
    progress: &'a mut dyn Progress,
    times: Vec<StageTime>,
}

impl<'a> Stages<'a> {
    /// Begins the task "bake".
    pub fn begin(progress: &'a mut dyn Progress) -> Self {
        progress.begin("bake", STAGES);
        Self { progress, times: Vec::new() }
    }

    /// Runs a stage, or skips it if `stored` has its result of an earlier bake. Returns the result.
    ///
    /// # Errors
    /// Those of `work`.
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

    /// Leaves a stage out, with a note if there is a reason that the user should know.
    pub fn note_left_out(&mut self, stage: Stage, reason: Option<&str>) {
        if let Some(reason) = reason {
            self.progress.note(&format!("note: {} is left out: {reason}", stage.name()));
        }
        self.progress.advance();
    }

    /// Reports one line.
    pub fn note(&mut self, line: &str) {
        self.progress.note(line);
    }

    /// Returns where progress is reported.
    pub fn progress(&mut self) -> &mut dyn Progress {
        self.progress
    }

    /// Returns the durations of the stages run so far.
    pub fn times(&self) -> Vec<StageTime> {
        self.times.clone()
    }

    /// Finishes the task "bake".
    pub fn finish(self) {
        self.progress.finish();
    }
}
