//! Errors of verbs.
//!
//! In: any error, with the path of the file if the error does not contain it. Out: one line with the whole chain of
//! causes.

use std::error::Error;
use std::path::Path;

/// An error of a verb: the line that is printed after `error: `.
#[derive(Debug)]
pub struct Failure(String);

impl Failure {
    /// Returns a failure with this message.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    /// Returns a failure with this message about a file.
    pub fn about(path: &Path, message: &str) -> Self {
        Self(format!("{}: {message}", path.display()))
    }

    /// Returns a failure from an error about this file that does not contain its name.
    pub fn at(path: &Path, error: &dyn Error) -> Self {
        Self::about(path, &chain(error))
    }

    /// Returns the message.
    pub fn message(&self) -> &str {
        &self.0
    }
}

impl<E: Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(chain(&error))
    }
}

/// Returns the messages of an error and of its causes, without causes that are part of the message already.
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
