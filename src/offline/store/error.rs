//! The errors of `store`.
//!
//! In: what is wrong, or the error of a part. Out: [`StoreError`]; a command adds the option that mends it.

use crate::codec::CodecError;
use crate::codec::package::PackageError;
use crate::offline::work::{FileError, Interrupted};
use std::path::PathBuf;

/// Why a result cannot be stored, found or merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Only one stage may run, and the result of a stage before it is not stored.
    #[error("{}: has no result of the stage {stage} with these inputs", .folder.display())]
    MissingStage {
        /// The folder of results.
        folder: PathBuf,
        /// Name of the stage without a result.
        stage: &'static str,
        /// Name of the only stage that may run.
        only: &'static str,
    },
    /// The result of a stage cannot be read back from its own bytes.
    #[error("the result of the stage {stage} cannot be read back: a defect of gs4d, please report it")]
    Unreadable {
        /// Name of the stage.
        stage: &'static str,
    },
    /// A file is not the part of a computation that was divided into shards.
    #[error("{}: is no part of gs4d", .path.display())]
    NotAPart {
        /// The file.
        path: PathBuf,
    },
    /// No parts were given.
    #[error("there are no parts to merge")]
    NoParts,
    /// A file cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// A stored result cannot be read, written or removed.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// A scene cannot be written as a package.
    #[error("{0}")]
    Package(#[from] PackageError),
    /// A result cannot be written as RON.
    #[error("{0}")]
    Ron(#[from] ron::Error),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
