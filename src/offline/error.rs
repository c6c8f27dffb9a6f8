//! Errors of the offline half.
//!
//! In: errors of the codec, the datasets, the renderer, scoring and compression. Out: [`OfflineError`], which displays
//! them unchanged, preceded by the name of the file if the error does not contain it.

use super::dataset::DatasetError;
use super::fine_tune::{FineTuned, TrainerError};
use super::metrics::SizeMismatch;
use super::picture_file::PictureError;
use super::quantize::CompressError;
use super::score::{INTERRUPTED, ScoreError};
use super::train::StartError;
use crate::codec::CodecError;
use crate::codec::package::PackageError;
use crate::gaussian::InvalidGaussian;
use crate::renderer::GpuError;
use glam::UVec2;
use std::error::Error;
use std::path::{Path, PathBuf};

/// An error of the offline half.
#[derive(Debug, thiserror::Error)]
pub enum OfflineError {
    /// A file cannot be read or written.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// Training or test views cannot be used.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A picture cannot be decoded.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// Two pictures cannot be compared.
    #[error(transparent)]
    Size(#[from] SizeMismatch),
    /// The GPU failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// Gaussians cannot be scored.
    #[error(transparent)]
    Score(#[from] ScoreError),
    /// A scene cannot be fine-tuned.
    #[error(transparent)]
    Train(#[from] TrainerError),
    /// No capture can be trained on the views of a dataset.
    #[error("{}: {reason}", .path.display())]
    Start {
        /// The dataset.
        path: PathBuf,
        /// Why not.
        #[source]
        reason: StartError,
    },
    /// A Gaussian cannot be drawn.
    #[error(transparent)]
    Invalid(#[from] InvalidGaussian),
    /// A scene cannot be compressed.
    #[error(transparent)]
    Compress(#[from] CompressError),
    /// A file cannot be used.
    #[error("{}: {reason}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The fault of the file.
        #[source]
        reason: Box<dyn Error + Send + Sync>,
    },
    /// Pictures are too large for the memory.
    #[error(
        "{} {:.1} GB of memory, and {:.1} GB are available: {remedy}",
        pictures(*.count, *.size), *.needed as f64 / 1e9, *.available as f64 / 1e9
    )]
    Memory {
        /// Number of pictures held at once.
        count: u64,
        /// Width and height of the largest picture, pixels.
        size: UVec2,
        /// Bytes needed.
        needed: u64,
        /// Bytes available.
        available: u64,
        /// The option that makes pictures smaller or fewer.
        remedy: &'static str,
    },
    /// There is too little memory for the Gaussians that would be trained.
    #[error(
        "training {count} Gaussians takes up to {:.1} GB of memory, and {:.1} GB are available: {remedy}",
        *.needed as f64 / 1e9, *.available as f64 / 1e9
    )]
    Gaussians {
        /// Number of Gaussians.
        count: u64,
        /// Bytes needed.
        needed: u64,
        /// Bytes available.
        available: u64,
        /// The options that make them fewer or smaller.
        remedy: &'static str,
    },
    /// Pictures or Gaussians are too large for the GPU.
    #[error("{reason} ({remedy})")]
    Limit {
        /// The limit.
        reason: GpuError,
        /// The option that makes them smaller or fewer.
        remedy: &'static str,
    },
    /// Two folders have no two pictures of the same name.
    #[error("{} and {}: no two pictures with the same name before the extension", .a.display(), .b.display())]
    NoPairs {
        /// The first folder.
        a: PathBuf,
        /// The second folder.
        b: PathBuf,
    },
    /// A choice needs validation views, and the dataset has none.
    #[error(
        "{what} needs validation views, and this dataset has too few cameras and times to hold some out unasked (or --validation none is \
         given): give --validation cameras or times, add a split `val` (Blender: transforms_val.json), or {instead}"
    )]
    NoValidation {
        /// The choice that needs validation views.
        what: &'static str,
        /// What can be done without any, as an instruction.
        instead: &'static str,
    },
    /// The user has interrupted the work. Stored results are kept, and the same work resumes from them.
    #[error("{INTERRUPTED}")]
    Interrupted {
        /// The best result so far, if the work was fine-tuning.
        tuned: Option<Box<FineTuned>>,
    },
    /// The result of a stage cannot be read back from its own bytes.
    #[error("the result of the stage {stage} cannot be read back: a defect of gs4d, please report it")]
    Unreadable {
        /// Name of the stage.
        stage: &'static str,
    },
    /// A package cannot be written.
    #[error(transparent)]
    Package(#[from] PackageError),
    /// No score can be computed.
    #[error("there is no score to prune by")]
    NoScore,
    /// Levels of detail of a scene with an environment map, which surrounds the camera at every distance.
    #[error("has an environment map, which surrounds the camera: levels of detail need a capture without one")]
    Surrounded,
    /// Levels of detail of a scene of which nothing is drawn.
    #[error("has no Gaussian that is drawn at any time, so that there is nothing to make levels of detail of")]
    NothingDrawn,
    /// An orbit of a scene without Gaussians.
    #[error("the scene has no Gaussians, so that no orbit of cameras can be placed around it: give --cameras")]
    NothingToOrbit,
    /// Gaussians are so far apart that no camera sees them all.
    #[error("the Gaussians are too far apart for an orbit of cameras around them: give --cameras, or prune the scene")]
    TooFarApart,
    /// Training begins on a GPU alone.
    #[error("training from pictures needs a GPU; --engine gpu takes one with a software driver, slowly")]
    TrainingWithoutGpu,
    /// A sliced scene cannot be converted to the trained form.
    #[error(
        "holds a sliced form, which cannot be converted to the trained form: convert the checkpoint with --form trained"
    )]
    NotTrained,
    /// A scene of which no consecutive frames can be merged.
    #[error(
        "has no frames to merge: only an unpacked sequence of files, or another capture of separate windows of time, has"
    )]
    NoFrames,
    /// A scene whose temporal filter is part of the capture, which the work would replace or leave out.
    #[error(
        "shows each Gaussian only in a window of time of its own (frames, or pieces of paths), which {what} would lose"
    )]
    Windows {
        /// The work.
        what: &'static str,
    },
    /// The threads that write pictures cannot be started.
    #[error(transparent)]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The threads that write pictures panicked.
    #[error("the threads that write pictures panicked: a defect of gs4d, please report it")]
    WritersPanicked,
    /// The results of a stage of a bake cannot be stored.
    #[error(transparent)]
    Store(#[from] ron::Error),
    /// A report cannot be written as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// Returns the subject and the verb of a sentence about the need of pictures.
fn pictures(count: u64, UVec2 { x, y }: UVec2) -> String {
    match count {
        1 => format!("a picture of {x}x{y} pixels needs"),
        _ => format!("{count} pictures of up to {x}x{y} pixels need"),
    }
}

impl OfflineError {
    /// Returns the error of a dataset that no capture can be trained on.
    pub(super) fn about(dataset: &Path, reason: StartError) -> Self {
        Self::Start { path: dataset.to_owned(), reason }
    }

    /// Returns an error about the file `path`. `reason` is an error that does not name the file, or a message.
    pub(super) fn at(path: &Path, reason: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::File { path: path.to_owned(), reason: reason.into() }
    }
}
