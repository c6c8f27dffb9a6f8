//! The errors of `footage`.
//!
//! In: what is wrong with footage or with the folder of its dataset, or the error of a part. Out: [`FootageError`]; a
//! command adds the option that mends it.

use super::colmap::ColmapError;
use crate::codec::CodecError;
use crate::offline::dataset::DatasetError;
use crate::offline::store::StoreError;
use crate::offline::train::TrainError;
use crate::offline::work::{FileError, Interrupted};
use std::path::PathBuf;

/// Why footage does not become a dataset.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FootageError {
    /// The folder has no footage.
    #[error(
        "{}: no dataset, and neither videos nor folders of frames are in it: put a video or a folder of frames of each \
         camera into it, each with the name of its camera",
        .folder.display()
    )]
    NoFootage {
        /// The folder.
        folder: PathBuf,
    },
    /// The dataset would be written to a folder of somebody else.
    #[error(
        "{}: has files that gs4d footage has not written, and nothing is written over them: name a new folder",
        .out.display()
    )]
    Foreign {
        /// The folder of the dataset.
        out: PathBuf,
    },
    /// The dataset would be written over that of other footage.
    #[error(
        "{}: holds the dataset of other footage, {}: name a new folder, or remove this one",
        .out.display(), .other.display()
    )]
    OtherFootage {
        /// The folder of the dataset.
        out: PathBuf,
        /// The folder of the other footage.
        other: PathBuf,
    },
    /// The dataset and the footage lie in each other.
    #[error(
        "{}: the footage in {} is not written to, and neither folder may be inside the other: name a folder beside it",
        .out.display(), .folder.display()
    )]
    Nested {
        /// The folder of the dataset.
        out: PathBuf,
        /// The folder of the footage.
        folder: PathBuf,
    },
    /// A name is that of no camera.
    #[error("there is no camera {name}: the cameras are {known}")]
    NoCamera {
        /// The name.
        name: String,
        /// The names of the cameras.
        known: String,
    },
    /// Every camera is for the test.
    #[error("every camera is for the test, and none is left to train on: name fewer")]
    NothingToTrainOn,
    /// A folder of masks has no mask of the frames.
    #[error(
        "{}: no mask of a frame is in it: a mask is named CAMERA/FRAME.png, here {}",
        .folder.display(), .example.display()
    )]
    NoMasks {
        /// The folder of masks.
        folder: PathBuf,
        /// The mask of the first frame.
        example: PathBuf,
    },
    /// The cameras cannot be found.
    #[error("{0}")]
    Colmap(Box<ColmapError>),
    /// Cameras or pictures cannot be used.
    #[error("{0}")]
    Dataset(#[from] DatasetError),
    /// The short training on the dataset cannot be made.
    #[error("the short training on the dataset: {0}")]
    Train(Box<TrainError>),
    /// A result cannot be stored or read back.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// A file cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// A file cannot be written.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

impl From<TrainError> for FootageError {
    fn from(error: TrainError) -> Self {
        match error {
            TrainError::Interrupted { .. } => Interrupted.into(),
            other => Self::Train(Box::new(other)),
        }
    }
}

impl From<ColmapError> for FootageError {
    fn from(error: ColmapError) -> Self {
        match error {
            ColmapError::Interrupted(interrupted) => interrupted.into(),
            other => Self::Colmap(Box::new(other)),
        }
    }
}
