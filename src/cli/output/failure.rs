//! Errors of verbs.
//!
//! In: an error, with the path of the file if the error does not contain it. Out: one line with the error, all its
//! causes and the option that mends it. Common errors of the operating system are replaced by sentences.

use super::{remedy, system};
use crate::offline::work::Interrupted;
use std::any::Any;
use std::error::Error;
use std::path::Path;

/// The exit code of a verb that fails, and of a command line that cannot be understood.
pub(crate) const FAILED: u8 = 2;

/// An error of a verb: the line that is printed after `error: `.
#[derive(Debug)]
pub(crate) struct Failure {
    message: String,
    silent: bool,
}

impl Failure {
    /// Returns a failure with this message.
    pub(crate) fn new(message: impl Into<String>) -> Self {
        let message = message.into();
        Self { message: system::in_words(&message), silent: system::is_closed_pipe(&message) }
    }

    /// Returns a failure with this message about a file.
    pub(crate) fn about(path: &Path, message: &str) -> Self {
        Self::new(format!("{}: {message}", path.display()))
    }

    /// Returns a failure from an error about this file that does not contain its name.
    pub(crate) fn at(path: &Path, error: &(dyn Error + 'static)) -> Self {
        Self::about(path, &remedy::line(error))
    }

    /// Returns a failure with the message of a panic.
    pub(crate) fn of_panic(panic: &(dyn Any + Send)) -> Self {
        let message = panic.downcast_ref::<String>().map(String::as_str);
        let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
        Self::new(format!("a defect of gs4d, please report it: {message}"))
    }

    /// Returns the message.
    pub(crate) fn message(&self) -> &str {
        &self.message
    }

    /// Returns whether the user interrupted the work.
    pub(crate) fn is_interruption(&self) -> bool {
        self.message.rsplit(": ").next() == Some(Interrupted.to_string().as_str())
    }

    /// Returns whether no message is printed: the program that reads the output (such as `head`) has ended.
    pub(crate) fn is_silent(&self) -> bool {
        self.silent
    }
}

impl<E: Error + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::new(remedy::line(&error))
    }
}
