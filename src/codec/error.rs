//! Errors of reading and writing files, with the path of the file.
//!
//! In: the error of a format. Out: a [`CodecError`], displayed as `PATH: reason`.

use super::checkpoint::CheckpointError;
use super::import::ImportError;
use super::options::InvalidOption;
use super::package::PackageError;
use super::sound::SoundError;
use crate::gaussian::InvalidGaussian;
use crate::scene::edit::EditListError;
use std::io;
use std::path::{Path, PathBuf};

/// Why a file was not read or written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {kind}", .path.display())]
pub struct CodecError {
    /// The file.
    pub path: PathBuf,
    /// The reason.
    pub kind: Box<CodecErrorKind>,
}

impl CodecError {
    /// Returns an error about the file `path`.
    pub fn at(path: &Path, kind: impl Into<CodecErrorKind>) -> Self {
        Self { path: path.to_owned(), kind: Box::new(kind.into()) }
    }
}

/// The reasons of a [`CodecError`].
#[derive(Debug, thiserror::Error)]
pub enum CodecErrorKind {
    /// The system could not open, read or write the file.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file does not start like a file of any known format; the message names the known formats.
    #[error("{0}")]
    UnknownFormat(String),
    /// A checkpoint that cannot be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A package that cannot be read or written.
    #[error(transparent)]
    Package(#[from] PackageError),
    /// A file of another make that cannot be read.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// A Gaussian that cannot be drawn.
    #[error(transparent)]
    Gaussian(#[from] InvalidGaussian),
    /// A file that is not a list of edits.
    #[error(transparent)]
    Edits(#[from] EditListError),
    /// A sound file that cannot be used.
    #[error(transparent)]
    Sound(#[from] SoundError),
}

impl CodecErrorKind {
    /// Returns the option that is refused, if one is.
    pub fn invalid_option(&self) -> Option<&InvalidOption> {
        match self {
            Self::Checkpoint(CheckpointError::Option(option))
            | Self::Package(PackageError::Option(option))
            | Self::Import(ImportError::Option(option)) => Some(option),
            _ => None,
        }
    }
}
