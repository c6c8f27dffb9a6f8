//! The errors of edits.
//!
//! In: what is wrong with a list, or with its effect on a capture. Out: [`EditListError`] and [`EditError`], which say
//! what mends it; the caller adds the name of the file.

use crate::gaussian::InvalidGaussian;

/// Why a text is not a list of edits.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EditListError {
    /// The text is too long.
    #[error("has more than {most} bytes, the most of a list of edits: remove what is not an edit")]
    TooLong {
        /// The most bytes that it may have.
        most: usize,
    },
    /// The text cannot be understood, or an edit is wrong.
    #[error("line {line}, column {column}: {reason}")]
    Text {
        /// The line of the fault, from 1.
        line: usize,
        /// Its column, from 1.
        column: usize,
        /// The fault and its remedy.
        reason: String,
    },
}

/// Why edits cannot be applied to a capture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// The numbers of an edit are wrong.
    #[error("edit {number}, {name}: {reason}")]
    Wrong {
        /// The place of the edit in the list, from 1.
        number: usize,
        /// Its name.
        name: &'static str,
        /// What they must be.
        reason: &'static str,
    },
    /// No visible Gaussian would be left.
    #[error("edit {number}, {name}, leaves no Gaussian: change its numbers, or remove it from the list")]
    Everything {
        /// The place of the edit in the list, from 1.
        number: usize,
        /// Its name.
        name: &'static str,
    },
    /// An edit asks what the training cameras see, which is not given.
    #[error("edit {number}, {name}, needs the training cameras of the capture")]
    NotSeen {
        /// The place of the edit in the list, from 1.
        number: usize,
        /// Its name.
        name: &'static str,
    },
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
}
