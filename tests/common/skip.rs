//! Skipping a test aloud.
//!
//! In: why. Out: a line on standard error. The test harness holds back what the print macros write, but not this: a run that
//! skipped something shows it.

use std::fmt::Display;
use std::io::Write;

/// Says that a test, or a part of one, does not run here, and why.
pub fn skip(why: impl Display) {
    // If nobody can be told, it is skipped all the same.
    let _ = writeln!(std::io::stderr(), "skipped: {why}");
}
