//! Errors of reading files of other makes.
//!
//! In: what is wrong with a file. Out: an [`ImportError`], whose message names the part of the file and the remedy.

use crate::codec::options::InvalidOption;
use crate::gaussian::InvalidGaussian;
use std::io;

/// Why a file of another make was not read.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The file, or another file of its folder, could not be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file is damaged, cut, or not of the format that its first bytes promise.
    #[error("{0}")]
    Damaged(String),
    /// The file is intact, but has no equivalent here; the message says the way out.
    #[error("{0}")]
    Unsupported(String),
    /// An option that is invalid or contradicts the file.
    #[error(transparent)]
    Option(#[from] InvalidOption),
    /// A Gaussian that cannot be drawn.
    #[error(transparent)]
    Gaussian(#[from] InvalidGaussian),
}

impl ImportError {
    /// Returns the error about a damaged file.
    pub(crate) fn damaged(reason: impl Into<String>) -> Self {
        Self::Damaged(reason.into())
    }

    /// Returns the error about a file that has no equivalent here.
    pub(crate) fn unsupported(reason: impl Into<String>) -> Self {
        Self::Unsupported(reason.into())
    }
}
