//! The errors of `bake`.
//!
//! In: what is wrong with the inputs of a bake, or the error of a stage. Out: [`BakeError`].

use crate::codec::CodecError;
use crate::codec::package::PackageError;
use crate::gaussian::InvalidGaussian;
use crate::offline::collide::CollideError;
use crate::offline::compress::CompressError;
use crate::offline::dataset::DatasetError;
use crate::offline::engine::EngineError;
use crate::offline::filter::FilterError;
use crate::offline::forms::FormError;
use crate::offline::measure::MeasureError;
use crate::offline::prune::PruneError;
use crate::offline::report::ReportError;
use crate::offline::score::ScoreError;
use crate::offline::segments::SegmentsError;
use crate::offline::store::StoreError;
use crate::offline::store::shard::Shard;
use crate::offline::train::TrainError;
use crate::offline::work::{FileError, Interrupted};
use std::path::PathBuf;

/// Why a bake fails.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// The scores of the shards cannot be put together: one of them is not stored.
    #[error("{}: has no result of the shard {shard} of the stage score", .folder.display())]
    MissingShard {
        /// The folder of results.
        folder: PathBuf,
        /// The shard.
        shard: Shard,
    },
    /// A loss cannot be measured, because the image of a validation view is missing.
    #[error("{}: is missing: a loss is measured on the images of the validation views", .image.display())]
    MissingImage {
        /// The image.
        image: PathBuf,
    },
    /// The scene has windows of time, which a bake would lose.
    #[error("{0}")]
    Form(#[from] FormError),
    /// The views of the dataset cannot be used.
    #[error("{0}")]
    Dataset(#[from] DatasetError),
    /// Pictures are too large for the memory or the GPU.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// Gaussians cannot be scored.
    #[error("{0}")]
    Score(#[from] ScoreError),
    /// The scene cannot be pruned.
    #[error("{0}")]
    Prune(#[from] PruneError),
    /// The scene cannot be trained.
    #[error("{0}")]
    Train(#[from] TrainError),
    /// No temporal filter can be computed.
    #[error("{0}")]
    Filter(#[from] FilterError),
    /// The scene cannot be compressed.
    #[error("{0}")]
    Compress(#[from] CompressError),
    /// The images do not show the capture, or pictures cannot be compared.
    #[error("{0}")]
    Measure(#[from] MeasureError),
    /// The report cannot be written.
    #[error("{0}")]
    Report(#[from] ReportError),
    /// A result cannot be stored or read back.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// A file cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// A package cannot be written.
    #[error("{0}")]
    Package(#[from] PackageError),
    /// No colliders can be made.
    #[error("colliders: {0}")]
    Colliders(#[from] CollideError),
    /// The package cannot be cut into chunk files.
    #[error("{0}")]
    Segments(#[from] SegmentsError),
    /// A capture cannot be read or written.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Invalid(#[from] InvalidGaussian),
    /// The user has interrupted the work. Stored results are kept, and the same work resumes from them.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
