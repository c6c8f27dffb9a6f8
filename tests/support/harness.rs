//! The command line of a test binary without the default test harness.
//!
//! In: the arguments of the process. Out: the arguments without those of the default harness.

use std::ffi::OsString;

/// Arguments of the default test harness, which `cargo test -- ARGUMENTS` passes to every test binary.
const FOREIGN: [&str; 6] = ["--nocapture", "--no-capture", "--show-output", "--quiet", "-q", "--exact"];

/// Returns the arguments of the process, the program first, without those of the default test harness.
pub fn own_arguments() -> impl Iterator<Item = OsString> {
    std::env::args_os().filter(|argument| {
        let text = argument.to_string_lossy();
        !FOREIGN.contains(&&*text) && !text.starts_with("--test-threads=")
    })
}
