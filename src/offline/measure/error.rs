//! The errors of `measure`.
//!
//! In: what is wrong, or the error of a part. Out: [`MeasureError`]; a command adds the option that mends it.

use super::metrics::SizeMismatch;
use crate::codec::CodecError;
use crate::offline::dataset::DatasetError;
use crate::offline::engine::EngineError;
use crate::offline::picture_file::PictureError;
use crate::offline::store::StoreError;
use crate::offline::work::{FileError, Interrupted};
use std::path::PathBuf;

/// Why pictures cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// The images of a dataset do not show the capture.
    #[error(
        "{}: this image and others do not show this capture: the PSNR of its pictures is {own:.1} dB against their own \
         images and {others:.1} dB against those of other views; that of empty pictures is {empty:.1} dB",
        .image.display()
    )]
    NotShown {
        /// The first image that was compared.
        image: PathBuf,
        /// PSNR of pictures of the capture against the images of their own views, dB.
        own: f64,
        /// PSNR of the same pictures against the images of other views, dB.
        others: f64,
        /// PSNR of empty pictures against the images, dB.
        empty: f64,
    },
    /// There are no views to draw and compare.
    #[error("there are no views to compare")]
    NoViews,
    /// Two folders have no two pictures of the same name.
    #[error("{} and {}: no two pictures with the same name before the extension", .a.display(), .b.display())]
    NoPairs {
        /// The first folder.
        a: PathBuf,
        /// The second folder.
        b: PathBuf,
    },
    /// The size of a raw picture is unknown.
    #[error("{}: a raw picture does not tell its size", .path.display())]
    UnknownSize {
        /// The raw picture.
        path: PathBuf,
    },
    /// Two pictures differ in size.
    #[error("{0}")]
    Size(#[from] SizeMismatch),
    /// The engine failed.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// Training or test views cannot be used.
    #[error("{0}")]
    Dataset(#[from] DatasetError),
    /// A picture cannot be decoded.
    #[error("{0}")]
    Picture(#[from] PictureError),
    /// A picture cannot be written.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// A file cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// A part of an evaluation cannot be stored or read back.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
