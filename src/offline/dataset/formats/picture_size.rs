//! The size of pictures whose camera file does not have it.
//!
//! In: the path of an image, how cameras are read. Out: its size, or that of the options.

use crate::offline::dataset::{CameraOptions, DatasetError, MAX_SIDE};
use crate::offline::picture_file;
use glam::UVec2;
use std::path::Path;

/// Returns the size of an image, pixels; `None` if it is not on disk. An image that cannot be read is an error only if
/// the options have no size.
///
/// # Errors
/// An image that cannot be read.
pub(crate) fn of_image(image: &Path, options: &CameraOptions) -> Result<Option<UVec2>, DatasetError> {
    if !image.is_file() {
        return Ok(None);
    }
    match picture_file::size(image, UVec2::splat(MAX_SIDE)) {
        Ok(size) => Ok(Some(size)),
        Err(_) if options.size.is_some() => Ok(None),
        Err(error) => Err(error.into()),
    }
}
