//! Tests that need a separate process, such as tests that measure the memory of the process.
//!
//! In: the name of a test and its body. Out: the body, run by a child process of the test binary that runs no other
//! test.

use std::process::{Command, Stdio};

/// Environment variable of the child process with the name of its test.
const ALONE: &str = "GS4D_TEST_ALONE";

/// Runs the body of a test in a separate process, and panics if the body fails. `test` is the name of the test as the
/// test harness prints it.
pub fn run_alone(test: &str, body: impl FnOnce()) {
    if std::env::var_os(ALONE).is_some_and(|alone| alone == test) {
        return body();
    }
    let binary = std::env::current_exe().expect("the path of the test binary is known");
    let mut command = Command::new(binary);
    // The child inherits standard error, for its reports of skipped tests.
    command.args([test, "--exact", "--nocapture"]).env(ALONE, test).stderr(Stdio::inherit());
    let output = command.output().expect("the test binary can be started");
    let report = String::from_utf8_lossy(&output.stdout);
    // With a wrong name the harness runs no test and exits with success.
    assert!(output.status.success() && report.contains("1 passed"), "{test} passes in a separate process:\n{report}");
}
