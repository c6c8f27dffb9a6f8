//! Running the `gs4d` command as a user does.
//!
//! In: arguments. Out: exit code, standard output, standard error.

use crate::support::no_gpu::no_gpu;
use bevy_gs4d::renderer::GpuContext;
use serde_json::Value;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// Path of the command that was built for the tests.
pub const GS4D: &str = env!("CARGO_BIN_EXE_gs4d");

/// The result of a finished run.
pub struct Run {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

/// Runs the command.
pub fn gs4d<S: AsRef<OsStr>>(arguments: &[S]) -> Run {
    Run::of(&Command::new(GS4D).args(arguments).output().expect("the command starts"))
}

impl Run {
    /// Returns the run with the output of a process.
    pub fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self { code: output.status.code(), out: text(&output.stdout), err: text(&output.stderr) }
    }

    /// Returns the standard output. The run must have succeeded.
    pub fn text(self) -> String {
        assert_eq!(self.code, Some(0), "the command succeeds: {}", self.err);
        self.out
    }

    /// Returns the JSON document on the standard output. The run must have succeeded.
    pub fn json(self) -> Value {
        serde_json::from_str(&self.text()).expect("exactly one JSON document")
    }

    /// Checks that the run failed with an error that names `name`.
    pub fn must_fail(&self, name: &str) {
        assert_eq!(self.code, Some(2), "{name}: the exit code is 2; stdout {} stderr {}", self.out, self.err);
        assert!(self.err.contains("error:") && self.err.contains(name), "the error names {name}: {}", self.err);
        assert!(!self.err.contains("panicked"), "{name}: the command does not panic: {}", self.err);
    }
}

/// Builds an array of arguments from paths and words.
macro_rules! arguments {
    ($($argument:expr),* $(,)?) => { [$(std::ffi::OsString::from($argument)),*] };
}
pub(crate) use arguments;

/// Returns the words of a command line. A word in capitals is the file of this name in the folder, in small letters;
/// `OUT` has a number, so that no two commands write the same file.
pub fn words(command: &str, folder: &Path, number: usize) -> Vec<OsString> {
    let word = |word: &str| -> OsString {
        match word.strip_prefix("OUT") {
            Some(rest) => folder.join(format!("out{number}{rest}")).into(),
            None if word.starts_with(|c: char| c.is_ascii_uppercase()) => folder.join(word.to_lowercase()).into(),
            None => word.into(),
        }
    };
    command.split_whitespace().map(word).collect()
}

/// Returns whether the command has a GPU; without one, reports that the test, or a part of it, is skipped.
pub fn has_gpu() -> bool {
    let found = GpuContext::headless(None).is_ok();
    if !found {
        no_gpu();
    }
    found
}

/// Returns a temporary folder.
pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Writes a synthetic scene of `count` Gaussians as `scene.gs4d` into `folder`. Returns its path.
pub fn scene(folder: &TempDir, count: &str) -> PathBuf {
    let path = folder.path().join("scene.gs4d");
    gs4d(&arguments!["synth", &path, "--count", count]).text();
    path
}
