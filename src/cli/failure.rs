//! Why a verb stopped.
//!
//! In: any error, with the path it concerns where the error does not name it. Out: one line, the whole chain of causes.

use std::error::Error;
use std::path::Path;

/// The line that follows `error: `.
#[derive(Debug)]
pub struct Failure(String);

impl Failure {
    /// A failure in our own words.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    /// A failure in our own words about a file.
    pub fn about(path: &Path, message: &str) -> Self {
        Self(format!("{}: {message}", path.display()))
    }

    /// An error that does not name its file, about this file.
    pub fn at(path: &Path, error: &dyn Error) -> Self {
        Self::about(path, &chain(error))
    }

    /// The line.
    pub fn message(&self) -> &str {
        &self.0
    }
}

impl<E: Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(chain(&error))
    }
}

/// The error and its causes, leaving out causes that a message already quotes.
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
