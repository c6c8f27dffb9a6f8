//! Errors of verbs.
//!
//! In: an error, with the path of the file if the error does not contain it. Out: one line with the error and all its causes. Common errors
//! of the operating system are replaced by sentences.

use super::system;
use crate::offline::OfflineError;
use std::any::Any;
use std::error::Error;
use std::path::Path;

/// The exit code of a verb that fails, and of a command line that cannot be understood.
pub const FAILED: u8 = 2;

/// An error of a verb: the line that is printed after `error: `.
#[derive(Debug)]
pub struct Failure {
    message: String,
    silent: bool,
}

impl Failure {
    /// Returns a failure with this message.
    pub fn new(message: impl Into<String>) -> Self {
        let message = message.into();
        Self { message: system::in_words(&message), silent: system::is_closed_pipe(&message) }
    }

    /// Returns a failure with this message about a file.
    pub fn about(path: &Path, message: &str) -> Self {
        Self::new(format!("{}: {message}", path.display()))
    }

    /// Returns a failure from an error about this file that does not contain its name.
    pub fn at(path: &Path, error: &dyn Error) -> Self {
        Self::about(path, &chain(error))
    }

    /// Returns a failure with the message of a panic.
    pub fn of_panic(panic: &(dyn Any + Send)) -> Self {
        let message = panic.downcast_ref::<String>().map(String::as_str);
        let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
        Self::new(format!("a defect of gs4d, please report it: {message}"))
    }

    /// Returns the message.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Returns whether the work has ended because the user asked for it.
    pub fn is_interruption(&self) -> bool {
        let interrupted = OfflineError::Interrupted { tuned: None }.to_string();
        self.message.rsplit(": ").next() == Some(interrupted.as_str())
    }

    /// Returns whether no message is printed: the program that reads the output (such as `head`) has ended.
    pub fn is_silent(&self) -> bool {
        self.silent
    }
}

impl<E: Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::new(chain(&error))
    }
}

/// Returns the messages of an error and of its causes. A cause whose message is already part of the text is left out.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let reason = error.to_string();
        if !text.contains(&reason) {
            text = format!("{text}: {reason}");
        }
        cause = error.source();
    }
    text
}
