//! The report of a verb, as text and as JSON.
//!
//! In: the result of a verb. Out: one document on standard output, errors on standard error.

use super::failure::Failure;
use super::note::note;
use super::plain;
use super::table::lines;
use crate::codec::checkpoint::options::describe;
use crate::offline::store::shard::Shard;
use crate::offline::work::Interrupted;
use crate::offline::work::unfinished::Existing;
use crate::scene::{PlaybackHints, TrainedWith};
use serde_json::{Value, json};
use std::io::{ErrorKind, Write, stdout};
use std::path::Path;

/// The result of a verb.
pub(crate) struct Report {
    /// The report with `--json`.
    pub json: Value,
    /// The report for people. Each line ends with a line break.
    pub text: String,
    /// The failure of a command that also has a report; `None` on success.
    pub failure: Option<Failure>,
    /// Whether the user interrupted the work.
    pub interrupted: bool,
}

impl Report {
    /// Returns the report of a successful command.
    pub(crate) fn new(json: Value, text: String) -> Self {
        Self { json, text, failure: None, interrupted: false }
    }

    /// Returns a report that has only a failure.
    pub(crate) fn of_failure(failure: Failure) -> Self {
        Self {
            json: json!({ "error": failure.message() }),
            text: String::new(),
            failure: Some(failure),
            interrupted: false,
        }
    }

    /// Returns the report of an interrupted command: the parts of its work that exist.
    pub(crate) fn of_interruption(existing: &Existing) -> Self {
        let again = if existing.resumes { "; the same command resumes" } else { "" };
        let failure = Failure::new(format!("{Interrupted}{again}"));
        let outputs: Vec<String> = existing.outputs.iter().map(|path| path.display().to_string()).collect();
        let json = json!({
            "error": failure.message(),
            "interrupted": true,
            "written": outputs,
            "resumes": existing.resumes,
        });
        Self { json, text: String::new(), failure: Some(failure), interrupted: true }
    }

    /// Prints the report. A closed pipe (`| head`) is not an error.
    ///
    /// # Errors
    /// Standard output cannot be written to.
    pub(crate) fn print(&self, as_json: bool) -> Result<(), Failure> {
        let text = if as_json { plain::json(&format!("{:#}\n", self.json)) } else { plain::lines(&self.text) };
        let printed = stdout().write_all(text.as_bytes()).and_then(|()| stdout().flush());
        if let Some(failure) = self.failure.as_ref().filter(|failure| !failure.is_silent()) {
            note(&format!("error: {}", failure.message()));
        }
        match printed {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                note(&format!("error: standard output: {error}"));
                Err(error.into())
            }
            _ => Ok(()),
        }
    }
}

/// Returns the report of a part that a verb has written to `out`. `work` is the number of seconds that it took, and the
/// name of the engine; `None` if the part existed already.
pub(crate) fn part_report(shard: Shard, out: &Path, work: Option<(f64, String)>) -> Report {
    let done = match &work {
        Some((seconds, engine)) => format!("in {seconds:.1} s on {engine}"),
        None => "there already, with the same inputs".to_owned(),
    };
    let text = lines(&[("shard", shard.to_string()), ("done", done), ("part", out.display().to_string())]);
    let was_there = work.is_none();
    let (seconds, engine) = work.unzip();
    let json = json!({
        "shard": shard.to_string(),
        "out": out.display().to_string(),
        "was_there": was_there,
        "seconds": seconds,
        "engine": engine,
    });
    Report::new(json, text)
}

/// Returns the training and playback settings of a scene, for people.
pub(crate) fn switches(trained_with: &TrainedWith, playback: &PlaybackHints) -> Vec<(&'static str, String)> {
    describe(trained_with, playback)
}

/// Returns the training and playback settings of a scene, for programs.
pub(crate) fn switches_json(trained_with: &TrainedWith, playback: &PlaybackHints) -> Value {
    json!({ "trained_with": trained_with, "playback": playback })
}
