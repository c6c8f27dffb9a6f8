//! The errors of `compress`.
//!
//! In: what is wrong with a scene or its settings. Out: [`CompressError`], which names the fault and the remedy.

use crate::gaussian::InvalidGaussian;
use crate::scene::packed::MAX_STAGES;
use crate::scene::{ChunkTable, PackError};

/// Why a scene cannot be compressed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompressError {
    /// The scene is in the packed form already.
    #[error("the scene is packed already: name the checkpoint or the lossless package that it was made from")]
    AlreadyPacked,
    /// The scene is not in the packed form.
    #[error("the scene is not packed: compress it")]
    NotPacked,
    /// Codebooks need quantized geometry.
    #[error("codebooks need quantized geometry: choose a quality other than lossless, or no codebooks")]
    CodebooksAlone,
    /// Too many codebooks, or a codebook with no or too many entries.
    #[error("at most {MAX_STAGES} codebooks of 1 to 65536 entries each, not {0:?}")]
    Codebooks(Vec<usize>),
    /// Colors cannot be rounded to multiples of this.
    #[error("colors cannot be rounded to multiples of {0:?}: the step must be 0, or a number from {least:e} up", least = f32::MIN_POSITIVE)]
    ColorStep(f32),
    /// The capture would be cut into more stretches of time than an index may have.
    #[error(
        "stretches of {seconds} seconds are more than {} of the capture: choose longer ones",
        ChunkTable::MOST_STRETCHES
    )]
    ManyStretches {
        /// Length of a stretch, seconds.
        seconds: f32,
    },
    /// The capture would be cut into more chunk files than an index may have.
    #[error(
        "the capture would be cut into {found} chunk files, more than {}: choose longer stretches",
        ChunkTable::MOST_FILES
    )]
    ManyChunks {
        /// Number of chunk files.
        found: usize,
    },
    /// The values of the scene have too large a range.
    #[error(
        "the scene does not fit the packed form ({0}): some of its values are too large or too far apart; choose the quality lossless, or \
         prune it first"
    )]
    Range(&'static str),
    /// A Gaussian could not be drawn any more.
    #[error(
        "Gaussian {index} does not fit the packed form ({reason}): its values are too large or too small; choose the quality lossless, or \
         prune the scene first"
    )]
    Extreme {
        /// Its index in the scene.
        index: u32,
        /// What would be wrong with it.
        reason: &'static str,
    },
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
}

impl From<PackError> for CompressError {
    fn from(error: PackError) -> Self {
        match error {
            PackError::AlreadyPacked => Self::AlreadyPacked,
            PackError::ColorStep(step) => Self::ColorStep(step),
            PackError::Range(reason) => Self::Range(reason),
            PackError::Extreme { index, reason } => Self::Extreme { index, reason },
        }
    }
}
