//! Reports of skipped tests.
//!
//! In: the reason. Out: one line, `skipped: NAME: reason`, on standard error and, if `GS4D_SKIPPED` names a file, at
//! the end of that file. The test harness captures the output of the print macros, but not this line. `.ci/run` counts
//! the lines of the file.

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;
use std::thread;

/// Reports that the test of this thread, or a part of it, is skipped, with the reason.
pub fn skip(why: impl Display) {
    // The harness names the thread of a test after the test.
    let thread = thread::current();
    let line = format!("skipped: {}::{}: {why}\n", env!("CARGO_CRATE_NAME"), thread.name().unwrap_or("unnamed"));
    // The test is also skipped if standard error cannot be written to.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(path) = std::env::var_os("GS4D_SKIPPED") {
        let file = OpenOptions::new().create(true).append(true).open(&path);
        // One write per line: other tests add lines at the same time.
        let added = file.and_then(|mut file| file.write_all(line.as_bytes()));
        added.unwrap_or_else(|error| panic!("GS4D_SKIPPED is {}: {error}", path.display()));
    }
}
