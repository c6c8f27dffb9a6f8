//! The error of a file.
//!
//! In: a path, an error that does not name it. Out: [`FileError`], which does.

use std::error::Error;
use std::path::{Path, PathBuf};

/// A file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", .path.display())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// The fault of the file.
    #[source]
    pub reason: Box<dyn Error + Send + Sync>,
}

impl FileError {
    /// Returns an error about the file `path`. `reason` is an error that does not name the file, or a message.
    pub fn at(path: &Path, reason: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self { path: path.to_owned(), reason: reason.into() }
    }
}
