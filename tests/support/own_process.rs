//! Tests that need a process of their own, such as those that measure all of its memory.
//!
//! In: the name of a test and its body. Out: the body run by a child process of the test binary that runs nothing else.

use std::process::{Command, Stdio};

/// Set for the child process: the test that it runs.
const ALONE: &str = "GS4D_TEST_ALONE";

/// Runs the body of a test in a process of its own, and fails if it fails there. `test` is its name as the test harness prints it.
pub fn run_alone(test: &str, body: impl FnOnce()) {
    if std::env::var_os(ALONE).is_some_and(|alone| alone == test) {
        return body();
    }
    let binary = std::env::current_exe().expect("the test binary is known");
    let mut command = Command::new(binary);
    // What the child writes to standard error, such as what it skips, goes where that of this process goes.
    command.args([test, "--exact", "--nocapture"]).env(ALONE, test).stderr(Stdio::inherit());
    let output = command.output().expect("the test binary can be started");
    let report = String::from_utf8_lossy(&output.stdout);
    // A name that is wrong runs no test at all, which the harness counts as a success.
    assert!(output.status.success() && report.contains("1 passed"), "{test} fails in a process of its own:\n{report}");
}
