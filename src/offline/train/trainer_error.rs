//! The errors of the trainer and its optional parts.
//!
//! In: errors of compression, Gaussians and the renderer. Out: [`TrainerError`]; a command adds the option that mends
//! it.

use crate::gaussian::InvalidGaussian;
use crate::offline::compress::CompressError;
use crate::renderer::GpuError;

/// Why a scene cannot be trained.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainerError {
    /// The scene has lost its raw parameters.
    #[error("only the trained form can be fine-tuned")]
    NotTrained,
    /// Codebooks of another scene.
    #[error("the codebooks are not of the colors of this scene")]
    Codebooks,
    /// The packed form, to which geometry is rounded, cannot hold the scene.
    #[error("{0}")]
    Compress(#[from] CompressError),
    /// A term of the loss cannot have this weight.
    #[error("the weight of the term {term} is {weight:e}: it must be a number from 0 to {largest:e}", largest = f32::MAX)]
    Weight {
        /// The term.
        term: &'static str,
        /// Its weight.
        weight: f64,
    },
    /// Gaussians of another model than the native one do not move in time, so that nothing can be trained from pictures
    /// alone with them.
    #[error("only native 4D Gaussians, with both rotations, can be trained from pictures alone: fine-tune others")]
    Model,
    /// There is nothing to train.
    #[error("there are no Gaussians to fine-tune")]
    Empty,
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
    /// The GPU cannot train the scene.
    #[error("{0}")]
    Gpu(#[from] GpuError),
}
