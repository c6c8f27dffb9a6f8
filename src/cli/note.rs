//! Lines on standard error.
//!
//! In: a line. Out: the line on standard error, above the progress bars.

use super::{plain, system};
use indicatif::MultiProgress;
use std::io::{Write, stderr};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// All progress bars on the screen.
pub(super) static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Whether progress bars are hidden.
static SILENT: AtomicBool = AtomicBool::new(false);

/// Sets whether progress bars are hidden from now on.
pub fn silence_progress(silent: bool) {
    SILENT.store(silent, Ordering::Relaxed);
}

/// Writes a line to standard error, if it is open. Common errors of the operating system in the line are replaced by sentences.
pub fn note(line: &str) {
    let _ = BARS.suspend(|| writeln!(stderr(), "{}", plain::lines(&system::in_words(line))));
}

/// Returns whether progress bars are hidden.
pub(super) fn is_silent() -> bool {
    SILENT.load(Ordering::Relaxed)
}
