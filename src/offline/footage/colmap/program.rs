//! The installed COLMAP.
//!
//! In: a step of the command line, with its paths and options. Out: what the program has said, or the error with the
//! end of that. The names of options differ between versions: those that the help of a step lists are used. A step ends
//! when the user interrupts the work.

use super::error::ColmapError;
use super::package::{CHECK, SCRIPT};
use crate::codec::text::printable;
use crate::offline::work::{Progress, proceed};
use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// The names of the command line, the second on Windows.
const COMMANDS: [&str; 2] = ["colmap", "COLMAP.bat"];
/// The names of Python.
const PYTHONS: [&str; 2] = ["python3", "python"];
/// The window system that needs no screen, for programs that are built with a window.
const NO_SCREEN: (&str, &str) = ("QT_QPA_PLATFORM", "offscreen");
/// Time between two looks at a running step.
const PAUSE: Duration = Duration::from_millis(20);
/// Most lines and characters of the messages that an error shows.
const SHOWN_LINES: usize = 3;
const MOST_SHOWN: usize = 240;

/// An option: its names, of which the first that the program has is used (none, if it has none), and its value.
pub(crate) type Setting<'a> = (&'a [&'a str], &'a str);

/// A step of the command line.
pub(crate) struct Step<'a> {
    /// Its name, the first argument.
    pub name: &'static str,
    /// The options that are paths.
    pub paths: &'a [(&'a str, &'a Path)],
    /// The other options.
    pub settings: &'a [Setting<'a>],
}

/// The program.
pub(crate) struct Program {
    /// The file to start.
    file: &'static str,
    /// The arguments before those of a step.
    first: &'static [&'static str],
    /// Its name and version, as messages name it.
    pub name: String,
    /// The help of steps.
    helps: Mutex<HashMap<&'static str, String>>,
}

impl Program {
    /// Returns the installed program: the command line, or else the Python package.
    ///
    /// # Errors
    /// Neither is installed.
    pub(crate) fn find() -> Result<Self, ColmapError> {
        Self::command_line().or_else(Self::package).ok_or(ColmapError::Missing)
    }

    /// Returns the command line, if it is installed.
    pub(crate) fn command_line() -> Option<Self> {
        COMMANDS.into_iter().find_map(|file| Self::of(file, &[], &["help"]))
    }

    /// Returns the Python package, if it is installed.
    pub(crate) fn package() -> Option<Self> {
        PYTHONS.into_iter().find_map(|file| Self::of(file, &["-c", SCRIPT], &["-c", CHECK]))
    }

    /// Returns a program that can be started and answers the arguments `question` without an error.
    fn of(file: &'static str, first: &'static [&'static str], question: &[&str]) -> Option<Self> {
        let (is_there, answer) = answer(Command::new(file).args(question)).ok()?;
        is_there.then(|| Self { file, first, name: version(&answer), helps: Mutex::default() })
    }

    /// Runs a step, whose messages are written to a file in `folder`. Returns the messages.
    ///
    /// # Errors
    /// A program that cannot be started or ends with an error; a folder that cannot be written to; the interruption of
    /// the work, after the program has ended.
    pub(crate) fn run(&self, step: &Step<'_>, folder: &Path, progress: &dyn Progress) -> Result<String, ColmapError> {
        let path = folder.join(format!("{}.log", step.name));
        let scratch = |reason| ColmapError::Scratch { path: path.clone(), reason };
        let log = File::create(&path).map_err(scratch)?;
        let same = log.try_clone().map_err(scratch)?;
        let mut command = self.command(step.name);
        for (name, value) in step.paths {
            command.arg(format!("--{name}")).arg(value);
        }
        for (names, value) in step.settings {
            if let Some(name) = self.known(step.name, names) {
                command.arg(format!("--{name}")).arg(value);
            }
        }
        let failed = |reason| ColmapError::Run { program: self.name.clone(), reason };
        let child = command.stdin(Stdio::null()).stdout(log).stderr(same).spawn().map_err(failed)?;
        let status = Running(child).end(progress, failed)?;
        let said = String::from_utf8_lossy(&fs::read(&path).map_err(scratch)?).into_owned();
        if status.success() {
            return Ok(said);
        }
        Err(ColmapError::Step { program: self.name.clone(), step: step.name, status, said: last_words(&said) })
    }

    /// Returns the command of a step, without its options.
    fn command(&self, step: &str) -> Command {
        let mut command = Command::new(self.file);
        command.args(self.first).arg(step).env(NO_SCREEN.0, NO_SCREEN.1);
        command
    }

    /// Returns the first of the names that is one of the options of a step.
    fn known<'a>(&self, step: &'static str, names: &[&'a str]) -> Option<&'a str> {
        let mut helps = self.helps.lock().unwrap_or_else(PoisonError::into_inner);
        let help = helps.entry(step).or_insert_with(|| {
            let (_, help) = answer(self.command(step).arg("-h")).unwrap_or_default();
            help
        });
        names.iter().copied().find(|name| has_option(help, name))
    }
}

/// A step that runs. It is ended when this is dropped.
struct Running(Child);

impl Running {
    /// Waits until the step has ended, or the user interrupts the work.
    fn end(
        mut self,
        progress: &dyn Progress,
        failed: impl Fn(io::Error) -> ColmapError,
    ) -> Result<ExitStatus, ColmapError> {
        loop {
            let ended = self.0.try_wait().map_err(&failed)?;
            // Ctrl-C may have ended the step too.
            proceed(progress)?;
            match ended {
                Some(status) => return Ok(status),
                None => thread::sleep(PAUSE),
            }
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // A step that has ended cannot be killed, and has been waited for.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Returns whether a command ends without an error, and all that it says.
fn answer(command: &mut Command) -> io::Result<(bool, String)> {
    let output = command.env(NO_SCREEN.0, NO_SCREEN.1).stdin(Stdio::null()).output()?;
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    Ok((output.status.success(), said.join("\n")))
}

/// Returns the name and the version in the first line that has them.
fn version(answer: &str) -> String {
    let line = answer.lines().find(|line| line.to_ascii_lowercase().contains("colmap")).unwrap_or("COLMAP");
    printable(&line.split_whitespace().take(2).collect::<Vec<_>>().join(" "))
}

/// Returns whether a help lists an option.
fn has_option(help: &str, name: &str) -> bool {
    help.split_whitespace().any(|word| word.strip_prefix("--") == Some(name))
}

/// Returns the end of messages in one line, without headings and the addresses of a stack.
fn last_words(said: &str) -> String {
    let is_said = |line: &&str| !line.is_empty() && !line.starts_with(['@', '*', '=']);
    let lines: Vec<&str> = said.lines().map(str::trim).filter(is_said).collect();
    let last = lines[lines.len().saturating_sub(SHOWN_LINES)..].join("; ");
    let skipped = last.chars().count().saturating_sub(MOST_SHOWN);
    let shown = printable(&last.chars().skip(skipped).collect::<String>());
    if shown.is_empty() { "it says nothing".to_owned() } else { shown }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_words_are_those_before_the_addresses() {
        let said = "Loading database\n=====\n\nF2026 sfm.cc:473] Check failed: bundle_adjuster.Solve\n*** Check \
                    failure stack trace: ***\n    @     0x563d136e154f  main\n";
        assert_eq!(
            last_words(said),
            "Loading database; F2026 sfm.cc:473] Check failed: bundle_adjuster.Solve",
            "without headings and addresses"
        );
        assert_eq!(last_words("\n"), "it says nothing", "nothing is said");
    }

    #[test]
    fn options_are_those_of_the_help() {
        let help = "Options:\n  -h [ --help ]\n  --SiftExtraction.use_gpu arg (=1)\n  --SiftExtraction.use_index";
        assert!(has_option(help, "SiftExtraction.use_gpu"), "it is listed");
        assert!(!has_option(help, "FeatureExtraction.use_gpu"), "it is not");
        assert!(!has_option(help, "SiftExtraction.use"), "the whole name counts");
        let text = "COLMAP 3.8 -- Structure-from-Motion and Multi-View Stereo\n  (Commit Unknown)";
        assert_eq!(version(text), "COLMAP 3.8", "the name and the version");
    }

    #[cfg(unix)]
    mod steps {
        use super::*;
        use crate::offline::work::NoProgress;
        use crate::offline::work::progress::InterruptedProgress;
        use std::time::Instant;

        /// Runs a script of the shell as a step.
        fn ran(script: &'static [&'static str], progress: &dyn Progress) -> Result<String, ColmapError> {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let program = Program { file: "sh", first: script, name: "COLMAP 0".to_owned(), helps: Mutex::default() };
            program.run(&Step { name: "mapper", paths: &[], settings: &[] }, folder.path(), progress)
        }

        #[test]
        fn an_interruption_ends_a_step() {
            let start = Instant::now();
            let error = ran(&["-c", "exec sleep 60"], &InterruptedProgress).expect_err("the work is interrupted");
            assert!(matches!(error, ColmapError::Interrupted(_)), "the reason: {error}");
            assert!(start.elapsed() < Duration::from_secs(20), "it was not waited for: {:?}", start.elapsed());
        }

        #[test]
        fn a_step_that_fails_is_named_with_its_last_words() {
            let error = ran(&["-c", "echo no pair >&2; exit 1"], &NoProgress).expect_err("the step fails").to_string();
            assert!(error.contains("COLMAP 0 has failed at mapper"), "the program and the step: {error}");
            assert!(error.contains("no pair"), "its words: {error}");
            let said = ran(&["-c", "echo found"], &NoProgress).expect("the step succeeds");
            assert_eq!(said, "found\n", "what it says");
        }
    }
}
