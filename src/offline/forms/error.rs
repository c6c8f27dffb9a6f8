//! The errors of `forms`.
//!
//! In: what is wrong, or the error of a part. Out: [`FormError`]; a command adds the option that mends it.

use crate::codec::CodecError;
use crate::gaussian::InvalidGaussian;
use crate::offline::work::Interrupted;

/// Why a scene cannot be brought into another form, or exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormError {
    /// A sliced scene cannot be converted to the trained form.
    #[error("holds a sliced form, which cannot be converted to the trained form")]
    NotTrained,
    /// A scene of which no consecutive frames can be merged.
    #[error(
        "has no frames to merge: only an unpacked sequence of files, or another capture of separate windows of time, \
         has"
    )]
    NoFrames,
    /// A scene whose temporal filter is part of the capture, which the work would replace or leave out.
    #[error(
        "shows each Gaussian only in a window of time of its own (frames, or pieces of paths), which {what} would lose"
    )]
    Windows {
        /// The work.
        what: &'static str,
    },
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
    /// A file cannot be written.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
