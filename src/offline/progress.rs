//! How a library call reports how far it is.
//!
//! In: the tasks of a call as they begin, advance and finish, and remarks. Out: whatever the caller makes of them, such
//! as progress bars or a log.

use crate::codec::CodecError;

/// Receives the progress of work on a capture.
///
/// Tasks nest: [`advance`](Self::advance) and [`finish`](Self::finish) are about the unfinished task that began last. A
/// function that takes a `Progress` documents whether it begins tasks of its own or advances one of the caller's. When
/// it returns an error, the tasks that it began stay unfinished.
pub trait Progress {
    /// A task of so many steps begins.
    fn begin(&mut self, task: &'static str, steps: usize);

    /// One more step of the task is done.
    fn advance(&mut self);

    /// The task is done.
    fn finish(&mut self);

    /// One line about the work: how long a stage took, or something that would otherwise surprise.
    fn note(&mut self, line: &str);

    /// Writes a file. A program that can be interrupted finishes the write first, so that no temporary file stays
    /// behind.
    ///
    /// # Errors
    /// Those of `write`, which is called exactly once.
    fn uninterrupted(&mut self, write: &mut dyn FnMut() -> Result<(), CodecError>) -> Result<(), CodecError> {
        write()
    }
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
