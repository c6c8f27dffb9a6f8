//! Lines on standard error.
//!
//! In: a line. Out: the line on standard error, above the progress bars.

use super::{plain, system};
use indicatif::MultiProgress;
use std::collections::HashSet;
use std::io::{Write, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{LazyLock, Mutex, PoisonError};

/// All progress bars on the screen.
pub(crate) static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Whether progress bars are hidden.
static SILENT: AtomicBool = AtomicBool::new(false);

/// The lines of [`note_once`].
static WRITTEN: Mutex<Option<HashSet<String>>> = Mutex::new(None);

/// Sets whether progress bars are hidden from now on.
pub(crate) fn silence_progress(silent: bool) {
    SILENT.store(silent, Ordering::Relaxed);
}

/// Writes a line to standard error, if it is open. Common errors of the operating system in the line are replaced by
/// sentences.
pub(crate) fn note(line: &str) {
    let _ = BARS.suspend(|| writeln!(stderr(), "{}", plain::lines(&system::in_words(line))));
}

/// Writes a line as [`note`], unless it has been written by this function: several parts of a command may read one
/// dataset.
pub(crate) fn note_once(line: &str) {
    let is_new = {
        let mut written = WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
        written.get_or_insert_default().insert(line.to_owned())
    };
    if is_new {
        note(line);
    }
}

/// Returns whether progress bars are hidden.
pub(crate) fn is_silent() -> bool {
    SILENT.load(Ordering::Relaxed)
}
