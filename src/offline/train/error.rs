//! The errors of `train`.
//!
//! In: what is wrong, or the error of a part. Out: [`TrainError`]; a command adds the option that mends it.

use super::results::FineTuned;
use super::start::StartError;
use super::trainer_error::TrainerError;
use crate::codec::CodecError;
use crate::gaussian::InvalidGaussian;
use crate::offline::compress::CompressError;
use crate::offline::dataset::DatasetError;
use crate::offline::engine::EngineError;
use crate::offline::measure::metrics::SizeMismatch;
use crate::offline::score::ScoreError;
use crate::offline::store::StoreError;
use crate::offline::work::{FileError, Interrupted};
use crate::renderer::GpuError;
use std::path::PathBuf;

/// Why nothing can be trained.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// No capture can be trained on the views of a dataset, or from a file of points.
    #[error("{}: {reason}", .path.display())]
    Start {
        /// The dataset, or the file of points.
        path: PathBuf,
        /// Why not.
        #[source]
        reason: StartError,
    },
    /// There is too little memory for the Gaussians that would be trained.
    #[error(
        "training {count} Gaussians takes up to {:.1} GB of memory, and {:.1} GB are available",
        *.needed as f64 / 1e9, *.available as f64 / 1e9
    )]
    Memory {
        /// Number of Gaussians.
        count: u64,
        /// Bytes needed.
        needed: u64,
        /// Bytes available.
        available: u64,
    },
    /// The GPU has no room for the Gaussians that would be trained.
    #[error("{reason}")]
    Limit {
        /// The limit.
        #[source]
        reason: GpuError,
    },
    /// Only a GPU can train.
    #[error("training from pictures needs a GPU")]
    WithoutGpu,
    /// The user has interrupted the training.
    #[error("{Interrupted}")]
    Interrupted {
        /// The best result so far.
        tuned: Option<Box<FineTuned>>,
    },
    /// The thread that writes the package of a running training panicked.
    #[error("the thread that writes the package panicked: a defect of gs4d, please report it")]
    WriterPanicked,
    /// The scene cannot be trained.
    #[error("{0}")]
    Trainer(#[from] TrainerError),
    /// The GPU failed.
    #[error("{0}")]
    Gpu(#[from] GpuError),
    /// Pictures are too large for the memory or the GPU.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// Views, images or points cannot be used.
    #[error("{0}")]
    Dataset(#[from] DatasetError),
    /// A picture and its image differ in size.
    #[error("{0}")]
    Size(#[from] SizeMismatch),
    /// The temporal filter cannot be computed again.
    #[error("{0}")]
    Score(#[from] ScoreError),
    /// The result cannot be compressed.
    #[error("{0}")]
    Compress(#[from] CompressError),
    /// A package or a picture cannot be written.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// The state cannot be stored, or an image or a file of points cannot be hashed.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// A file cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
}

impl From<Interrupted> for TrainError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted { tuned: None }
    }
}
