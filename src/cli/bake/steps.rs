//! The stages of a bake as they go by.
//!
//! In: the stages, each with the result of an earlier bake where there is one. Out: their results, one bar for all of them above
//! those of the stages, a line on standard error for each, and what each took.

use crate::cli::failure::Failure;
use crate::cli::report::{note, progress};
use crate::offline::bake::Stage;
use crate::offline::report::StageTime;
use indicatif::ProgressBar;
use std::time::Instant;

/// The stages so far.
pub struct Steps {
    overall: ProgressBar,
    times: Vec<StageTime>,
}

impl Steps {
    /// Before the first of so many stages.
    pub fn new(stages: usize) -> Self {
        Self { overall: progress(stages, "bake"), times: Vec::new() }
    }

    /// Runs a stage, unless its result is already there.
    ///
    /// # Errors
    /// What the stage reports.
    pub fn run<T>(
        &mut self,
        stage: Stage,
        stored: Option<T>,
        work: impl FnOnce() -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        self.overall.tick();
        let start = Instant::now();
        let skipped = stored.is_some();
        let result = match stored {
            Some(result) => result,
            None => work()?,
        };
        let (name, seconds) = (stage.name().to_owned(), start.elapsed().as_secs_f64());
        let said = if skipped { "skipped, done before".to_owned() } else { format!("{seconds:.1} s") };
        note(&format!("{name}: {said}"));
        self.times.push(StageTime { name, seconds, skipped });
        self.overall.inc(1);
        Ok(result)
    }

    /// What the stages so far took.
    pub fn times(&self) -> Vec<StageTime> {
        self.times.clone()
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.overall.finish_and_clear();
    }
}
