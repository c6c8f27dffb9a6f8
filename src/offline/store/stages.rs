//! Stages that run one after the other, whose results are stored.
//!
//! In: for each stage, the [`Key`] of its inputs and the work. Out: its result, computed now or by an earlier run with
//! the same inputs, and the key of that result for the stages after it; a task for all stages, a note and a duration
//! for each.

use super::StoreError;
use super::results::{Key, Reserved, Store};
use super::stored::Stored;
use crate::offline::work::{Progress, proceed};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// The duration of a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// Its name.
    pub name: String,
    /// Seconds.
    pub seconds: f64,
    /// Whether a stored result was used.
    pub skipped: bool,
}

/// Stages in progress.
pub(crate) struct Stages<'a> {
    store: &'a Store,
    progress: &'a mut dyn Progress,
    times: Vec<StageTime>,
    only: Option<Only>,
}

/// The only stage that may run.
#[derive(Debug, Clone, Copy)]
struct Only {
    stage: &'static str,
    /// Whether it has run, or been skipped or left out.
    is_reached: bool,
    /// Whether stages before it run again.
    again: bool,
}

impl<'a> Stages<'a> {
    /// Begins a task of this many stages.
    pub(crate) fn begin(task: &'static str, count: usize, store: &'a Store, progress: &'a mut dyn Progress) -> Self {
        progress.begin(task, count);
        Self { store, progress, times: Vec::new(), only: None }
    }

    /// Lets only this stage run: results of stages before it must be stored. The folder is one for runs of single
    /// stages.
    pub(crate) fn only(mut self, stage: Option<&'static str>) -> Self {
        self.only = stage.map(|stage| Only { stage, is_reached: false, again: false });
        self
    }

    /// Returns whether the only stage is done.
    pub(crate) fn is_reached(&self) -> bool {
        self.only.is_some_and(|only| only.is_reached)
    }

    /// Lets the stages before the only stage run again, with other inputs.
    pub(crate) fn again(&mut self) {
        if let Some(only) = &mut self.only {
            (only.again, only.is_reached) = (true, false);
        }
    }

    /// Checks that a stage whose result is not stored may run. Waits until no other run works on it.
    fn begin_stage(&mut self, stage: &'static str, part: &str) -> Result<Option<Reserved>, StoreError> {
        match self.only {
            Some(Only { stage: only, again: false, .. }) if only != stage => {
                Err(StoreError::MissingStage { folder: self.store.folder().to_owned(), stage, only })
            }
            Some(_) => self.store.reserve(part, self.progress).map(Some),
            None => Ok(None),
        }
    }

    /// Returns the result of a stage with these inputs: the stored one, or else that of `work`, which is stored under
    /// the name of the stage. Also returns the key of the result. A result that has just been computed is returned as
    /// it will be read, so that a resumed run continues from the same bytes. A stored result for which `fits` is false
    /// is computed again.
    ///
    /// # Errors
    /// Those of `work`, a result that cannot be stored, an interruption.
    pub(crate) fn run<T: Stored, E: From<StoreError>>(
        &mut self,
        name: &'static str,
        inputs: Key,
        fits: impl Fn(&T) -> bool,
        work: impl FnOnce(&mut dyn Progress) -> Result<T, E>,
    ) -> Result<(T, Key), E> {
        self.run_part(name, name, inputs, fits, work)
    }

    /// Returns the result of a part of a stage, which is stored under the name of the part, as by [`run`](Self::run).
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub(crate) fn run_part<T: Stored, E: From<StoreError>>(
        &mut self,
        stage: &'static str,
        part: &str,
        inputs: Key,
        fits: impl Fn(&T) -> bool,
        work: impl FnOnce(&mut dyn Progress) -> Result<T, E>,
    ) -> Result<(T, Key), E> {
        let start = Instant::now();
        let store = self.store;
        let load = || store.load(part, inputs).and_then(|body| Some((T::decode(&body)?, Key::of(&body))));
        let load = || load().filter(|(result, _)| fits(result));
        let (mut stored, mut reserved) = (load(), None);
        if stored.is_none() {
            reserved = self.begin_stage(stage, part)?;
            // Another run may have ended meanwhile.
            stored = reserved.as_ref().and_then(|_| load());
        }
        let skipped = stored.is_some();
        let result = match stored {
            Some(stored) => stored,
            None => {
                proceed(self.progress).map_err(StoreError::from)?;
                let body = work(self.progress)?.encode()?;
                let result = T::decode(&body).ok_or(StoreError::Unreadable { stage })?;
                self.store.store(part, inputs, &body)?;
                (result, Key::of(&body))
            }
        };
        drop(reserved);
        self.ended(stage, start, skipped);
        Ok(result)
    }

    /// Runs a stage whose result is not stored.
    ///
    /// # Errors
    /// Those of `work`, an interruption.
    pub(crate) fn run_always<T, E: From<StoreError>>(
        &mut self,
        name: &'static str,
        work: impl FnOnce(&mut dyn Progress) -> Result<T, E>,
    ) -> Result<T, E> {
        let _reserved = self.only.map(|_| self.store.reserve(name, self.progress)).transpose()?;
        proceed(self.progress).map_err(StoreError::from)?;
        let start = Instant::now();
        let result = work(self.progress)?;
        self.ended(name, start, false);
        Ok(result)
    }

    /// Leaves a stage out, with a note if there is a reason that the user should know.
    pub(crate) fn leave_out(&mut self, name: &'static str, reason: Option<&str>) {
        if let Some(reason) = reason {
            self.progress.note(&format!("note: {name} is left out: {reason}"));
        }
        self.pass(name);
    }

    /// Returns where progress is reported.
    pub(crate) fn progress(&mut self) -> &mut dyn Progress {
        self.progress
    }

    /// Returns the durations of the stages run so far.
    pub(crate) fn times(&self) -> Vec<StageTime> {
        self.times.clone()
    }

    /// Finishes the task.
    pub(crate) fn finish(self) {
        self.progress.finish();
    }

    fn ended(&mut self, name: &'static str, start: Instant, skipped: bool) {
        let seconds = start.elapsed().as_secs_f64();
        let duration = if skipped { "skipped, done before".to_owned() } else { format!("{seconds:.1} s") };
        self.progress.note(&format!("{name}: {duration}"));
        self.times.push(StageTime { name: name.to_owned(), seconds, skipped });
        self.pass(name);
    }

    fn pass(&mut self, name: &str) {
        if let Some(only) = &mut self.only {
            only.is_reached |= only.stage == name;
        }
        self.progress.advance();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use crate::offline::work::progress::InterruptedProgress;

    #[test]
    fn a_stage_runs_once_for_each_input() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::beside(&folder.path().join("scene.gs4d"), ".bake").expect("the folder can be made");
        let run = |inputs: &[u8]| {
            let mut runs = 0;
            let mut progress = NoProgress;
            let mut stages = Stages::begin("test", 1, &store, &mut progress);
            let work = |_: &mut dyn Progress| {
                runs += 1;
                Ok(inputs.to_vec())
            };
            let done = stages.run::<_, StoreError>("stage", Key::of(inputs), |_| true, work);
            let (result, key) = done.expect("the work succeeds");
            assert_eq!((result.as_slice(), key), (inputs, Key::of(inputs)), "the result and its key");
            runs
        };
        assert_eq!(run(b"first"), 1, "nothing is stored");
        assert_eq!(run(b"first"), 0, "the stored result has the same inputs");
        assert_eq!(run(b"second"), 1, "the stored result has other inputs");
    }

    #[test]
    fn a_stage_that_runs_alone_needs_the_results_of_those_before_it() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("scene.gs4d");
        let run = |only: &'static str| -> Result<Option<&'static str>, StoreError> {
            let (store, mut progress) = (Store::shared(&out, ".bake").expect("the folder can be made"), NoProgress);
            let mut stages = Stages::begin("test", 2, &store, &mut progress).only(Some(only));
            for name in ["first", "second"] {
                stages.run::<_, StoreError>(name, Key::of(b""), |_| true, |_| Ok(name.as_bytes().to_vec()))?;
                if stages.is_reached() {
                    return Ok(Some(name));
                }
            }
            Ok(None)
        };
        let message = run("second").expect_err("the first stage has not run").to_string();
        assert!(message.contains("scene.gs4d.bake: has no result of the stage first"), "what is missing: {message}");
        for only in ["first", "second", "first"] {
            assert_eq!(run(only).ok(), Some(Some(only)), "the run ends after the stage");
        }
    }

    #[test]
    fn an_interrupted_stage_is_an_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::beside(&folder.path().join("scene.gs4d"), ".bake").expect("the folder can be made");
        let mut interrupting = InterruptedProgress;
        let mut stages = Stages::begin("test", 1, &store, &mut interrupting);
        let result = stages.run::<_, StoreError>("stage", Key::of(b""), |_| true, |_| Ok(Vec::<u8>::new()));
        assert!(matches!(result, Err(StoreError::Interrupted(_))), "a stage whose result is stored does not run");
        let result = stages.run_always::<_, StoreError>("other", |_| Ok(()));
        assert!(matches!(result, Err(StoreError::Interrupted(_))), "a stage whose result is not stored does not run");
    }
}
