//! Reports of skipped tests.
//!
//! In: the reason. Out: a line on standard error. The test harness holds back what the print macros write, but not this: a run that
//! skipped something shows it.

use std::fmt::Display;
use std::io::Write;

/// Reports that a test, or a part of one, does not run here, and why.
pub fn skip(why: impl Display) {
    // Without standard error it is skipped all the same.
    let _ = writeln!(std::io::stderr(), "skipped: {why}");
}
