//! The error of looking at Gaussians with cameras.
//!
//! In: the error of a part. Out: [`SeenError`].

use crate::gaussian::InvalidGaussian;
use crate::offline::work::Interrupted;

/// Why it cannot be found what cameras see of each Gaussian.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SeenError {
    /// The parts of the capture do not fit together.
    #[error("{0}")]
    Scene(&'static str),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
