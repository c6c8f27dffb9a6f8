//! Reports of skipped tests.
//!
//! In: the reason. Out: one line, `skipped: NAME: reason`, on standard error, and added to the file that `GS4D_SKIPPED` names, if it does.
//! The test harness holds back what the print macros write, but not this; and `.ci/run` counts the lines of the file.

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;
use std::thread;

/// Reports that the test of this thread, or a part of it, does not run here, and why.
pub fn skip(why: impl Display) {
    // The harness names the thread of a test after it.
    let thread = thread::current();
    let line = format!("skipped: {}::{}: {why}\n", env!("CARGO_CRATE_NAME"), thread.name().unwrap_or("unnamed"));
    // Without standard error it is skipped all the same.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(path) = std::env::var_os("GS4D_SKIPPED") {
        let file = OpenOptions::new().create(true).append(true).open(&path);
        // In one piece: other tests add lines at the same time.
        let added = file.and_then(|mut file| file.write_all(line.as_bytes()));
        added.unwrap_or_else(|error| panic!("GS4D_SKIPPED is {}: {error}", path.display()));
    }
}
