//! Errors of exporting a scene.
//!
//! In: what a scene has that a format does not. Out: an [`ExportError`], whose message says the way out.

use crate::gaussian::InvalidGaussian;

/// Why a scene was not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A Gaussian that cannot be drawn.
    #[error(transparent)]
    Gaussian(#[from] InvalidGaussian),
    /// The scene has no equivalent in the format.
    #[error("{0}")]
    Unsupported(String),
}
