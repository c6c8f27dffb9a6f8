//! The size and the times at which cameras are read.
//!
//! In: the choices of a caller. Out: [`CameraOptions`], or an error for a size that is out of range.

use crate::offline::dataset::{DatasetError, MAX_SIDE};
use crate::scene::Origin;
use glam::UVec2;

/// How to read a camera file. Default: all `None`, times as the files say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CameraOptions {
    /// Picture size in pixels, instead of the size in the file. The field of view stays that of the original pictures
    /// on both axes, so that another aspect ratio gives pixels that are not square. This size also replaces an unknown
    /// original size.
    pub size: Option<UVec2>,
    /// The value of `--resolution` of the original: 1, 2, 3, 4 or 8 divide the size, −1 limits the width to 1600
    /// pixels, any other number is a target width. It has no effect on golden views or with an explicit `size`.
    pub resolution: Option<i32>,
    /// First and last time of the views, both included: frames outside are dropped. They are counted from the origin,
    /// as the times of views are.
    pub time_interval: Option<[f32; 2]>,
    /// Whether the scene is at rest: every view has time 0, and images in subfolders of a COLMAP dataset are no frames
    /// of cameras.
    pub is_static: bool,
    /// The origin from which places and times of views are counted, in the coordinates of the files: that of the
    /// capture that the views are for. `None`: zeros, unless the cameras or the times are so far from 0 that single
    /// precision would lose their digits; then their center, or the first time.
    pub origin: Option<Origin>,
}

/// Checks a requested picture size.
pub(crate) fn check_size(size: UVec2) -> Result<(), DatasetError> {
    if size.min_element() == 0 || size.max_element() > MAX_SIDE { Err(DatasetError::Size { size }) } else { Ok(()) }
}
