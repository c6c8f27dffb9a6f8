//! The errors of `detail`.
//!
//! In: what is wrong with a scene, or the error of a part. Out: [`DetailError`].

use crate::gaussian::InvalidGaussian;
use crate::offline::compress::CompressError;
use crate::offline::engine::EngineError;
use crate::offline::forms::FormError;
use crate::offline::train::TrainerError;
use crate::offline::work::Interrupted;
use crate::renderer::GpuError;

/// Why a scene gets no levels of detail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetailError {
    /// The scene has an environment map, which surrounds the camera at every distance.
    #[error("has an environment map, which surrounds the camera: levels of detail need a capture without one")]
    Surrounded,
    /// Nothing of the scene is drawn.
    #[error("has no Gaussian that is drawn at any time, so that there is nothing to make levels of detail of")]
    NothingDrawn,
    /// The scene has windows of time, which levels of detail would lose.
    #[error("{0}")]
    Form(#[from] FormError),
    /// A level cannot be compressed.
    #[error("{0}")]
    Compress(#[from] CompressError),
    /// The Gaussians of a level cannot be trained.
    #[error("{0}")]
    Train(#[from] TrainerError),
    /// Pictures are too large for the memory or the GPU.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// The GPU failed.
    #[error("{0}")]
    Gpu(#[from] GpuError),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
