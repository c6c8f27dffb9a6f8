//! The errors of `score`.
//!
//! In: what is wrong, or the error of a part. Out: [`ScoreError`]; a command adds the option that mends it.

use super::Variant;
use crate::gaussian::InvalidGaussian;
use crate::offline::engine::EngineError;
use crate::offline::store::StoreError;
use crate::offline::work::{FileError, Interrupted};

/// Why there are no scores.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScoreError {
    /// No view was given.
    #[error("there are no training views to score with: pass a dataset whose transforms_train.json lists some")]
    NoViews,
    /// No Gaussian contributes to any view, as with views of another scene.
    #[error(
        "no Gaussian contributes to any training view: does this data belong to the checkpoint? (its cameras look \
         elsewhere, or its times lie outside the time interval)"
    )]
    NothingContributes,
    /// The variant needs scales, which a sliced scene does not have.
    #[error(
        "the score `{variant}` needs the volume of the Gaussians, which the runtime form no longer tells: score the \
         checkpoint, or choose one of {}",
        Variant::ALL.into_iter().filter(|v| !v.needs_volume()).map(Variant::name).collect::<Vec<_>>().join(", ")
    )]
    NoVolume {
        /// The requested variant.
        variant: Variant,
    },
    /// The engine failed.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
    /// A part of the scores cannot be stored or read back.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// A file of scores cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
