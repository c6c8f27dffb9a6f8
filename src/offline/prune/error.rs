//! The errors of `prune`.
//!
//! In: what is wrong, or the error of a part. Out: [`PruneError`]; a command adds the option that mends it.

use crate::gaussian::InvalidGaussian;
use crate::offline::dataset::DatasetError;
use crate::offline::engine::EngineError;
use crate::offline::filter::FilterError;
use crate::offline::measure::MeasureError;
use crate::offline::score::ScoreError;
use crate::offline::work::Interrupted;
use std::fmt;

/// Why a scene cannot be pruned.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PruneError {
    /// No score can be computed.
    #[error("there is no score to prune by")]
    NoScore,
    /// The goal is the size of a file, which only a bake compresses.
    #[error("only a bake prunes to the size of a file: give a number or a share of Gaussians, or a loss")]
    SizeOfFile,
    /// A choice needs validation views, and the dataset has none.
    #[error("{choice} needs validation views, and there are none")]
    NoValidation {
        /// The choice that needs validation views.
        choice: ValidatedChoice,
    },
    /// The engine failed.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// Training or validation views cannot be used.
    #[error("{0}")]
    Dataset(#[from] DatasetError),
    /// Gaussians cannot be scored.
    #[error("{0}")]
    Score(#[from] ScoreError),
    /// Pictures cannot be compared.
    #[error("{0}")]
    Measure(#[from] MeasureError),
    /// No temporal filter can be computed.
    #[error("{0}")]
    Filter(#[from] FilterError),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

/// A choice that is made on validation views. `Display` gives the subject of a sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ValidatedChoice {
    /// The number of Gaussians that an allowed loss leaves.
    Loss,
    /// The best score.
    Score,
    /// The best row of a table of scores, ratios and filters.
    Rows,
}

impl fmt::Display for ValidatedChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Loss => "the loss allowed",
            Self::Score => "the best score",
            Self::Rows => "the table",
        })
    }
}
