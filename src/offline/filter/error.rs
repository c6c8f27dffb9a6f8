//! The errors of `filter`.
//!
//! In: what is wrong, or the error of a part. Out: [`FilterError`]; a command adds the option that mends it.

use crate::gaussian::InvalidGaussian;
use crate::offline::engine::EngineError;
use crate::offline::score::ScoreError;
use crate::offline::store::StoreError;
use crate::offline::work::FileError;

/// Why no temporal filter can be computed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError {
    /// The engine failed.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// The Gaussians that the views show cannot be found.
    #[error("{0}")]
    Score(#[from] ScoreError),
    /// A part of a filter cannot be stored or read back.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// A file cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
}
