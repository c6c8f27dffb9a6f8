//! The errors of training on the GPU.
//!
//! In: errors of compression, Gaussians and the renderer. Out: [`TrainerError`].

use crate::gaussian::InvalidGaussian;
use crate::offline::quantize::CompressError;
use crate::renderer::GpuError;

/// Why a scene cannot be trained.
#[derive(Debug, thiserror::Error)]
pub enum TrainerError {
    /// The scene has lost its raw parameters.
    #[error("only the trained form can be fine-tuned: give the checkpoint, or a package written with --form trained")]
    NotTrained,
    /// Codebooks of another scene.
    #[error("the codebooks are not of the colors of this scene")]
    Codebooks,
    /// The packed form cannot hold the scene.
    #[error(transparent)]
    Compress(#[from] CompressError),
    /// A term of the loss cannot have this weight.
    #[error("the weight of the term {term} is {weight:e}: it must be a number from 0 to {largest:e}", largest = f32::MAX)]
    Weight {
        /// The term.
        term: &'static str,
        /// Its weight.
        weight: f64,
    },
    /// Gaussians of another model than the native one are at rest, and have no time to grow in.
    #[error(
        "only native 4D Gaussians, with both rotations, can be trained from pictures alone: fine-tune others with gs4d finetune"
    )]
    Model,
    /// There is nothing to train.
    #[error("there are no Gaussians to fine-tune")]
    Empty,
    /// A Gaussian cannot be drawn.
    #[error(transparent)]
    Invalid(#[from] InvalidGaussian),
    /// The GPU cannot train the scene.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
