//! Progress reports of library calls.
//!
//! In: the tasks of a call as they begin, advance and finish, and notes. Out: the display of the caller, such as
//! progress bars or a log.

use super::Interrupted;

/// Receives the progress of work on a capture.
///
/// Tasks nest: [`advance`](Self::advance) and [`finish`](Self::finish) are about the unfinished task that began last. A
/// function that takes a `Progress` documents whether it begins its own tasks or advances a task of the caller. When a
/// function returns an error, the tasks that it began stay unfinished.
pub trait Progress {
    /// Begins a task of `steps` steps.
    fn begin(&mut self, task: &'static str, steps: usize);

    /// Reports that one more step of the task is done.
    fn advance(&mut self);

    /// Shows words beside the task until it is finished or others are shown, such as the quality so far.
    fn show(&mut self, _words: &str) {}

    /// Finishes the task.
    fn finish(&mut self);

    /// Reports one line about the work, such as the duration of a stage or views that are left out.
    fn note(&mut self, line: &str);

    /// Returns whether the user has requested an early end with the results so far. Long work that can end early checks
    /// this regularly.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// Returns an error if the user has requested an early end.
///
/// # Errors
/// [`Interrupted`].
pub(crate) fn proceed(progress: &dyn Progress) -> Result<(), Interrupted> {
    if progress.is_interrupted() { Err(Interrupted) } else { Ok(()) }
}

/// Ignores all progress.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoProgress;

impl Progress for NoProgress {
    fn begin(&mut self, _task: &'static str, _steps: usize) {}

    fn advance(&mut self) {}

    fn finish(&mut self) {}

    fn note(&mut self, _line: &str) {}
}

/// Is interrupted from the beginning.
#[cfg(test)]
pub(crate) struct InterruptedProgress;

#[cfg(test)]
impl Progress for InterruptedProgress {
    fn begin(&mut self, _task: &'static str, _steps: usize) {}

    fn advance(&mut self) {}

    fn finish(&mut self) {}

    fn note(&mut self, _line: &str) {}

    fn is_interrupted(&self) -> bool {
        true
    }
}
