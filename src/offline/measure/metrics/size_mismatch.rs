//! Pictures that can be compared.
//!
//! In: two pictures. Out: an error if they do not have the same pixels.

use glam::UVec2;

use crate::view::Picture;

/// Two pictures cannot be compared because they do not have the same pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "pictures of {}x{} and {}x{} pixels cannot be compared: both must have the same size and at least one pixel",
    .first.x, .first.y, .second.x, .second.y
)]
pub struct SizeMismatch {
    /// Width and height of the first picture.
    pub first: UVec2,
    /// Width and height of the second picture.
    pub second: UVec2,
}

/// Checks that both pictures have the same size, at least one pixel, and as many pixels as their size.
pub(crate) fn check_sizes(a: &Picture, b: &Picture) -> Result<(), SizeMismatch> {
    let count = a.size.x as usize * a.size.y as usize;
    if a.size == b.size && count > 0 && a.pixels.len() == count && b.pixels.len() == count {
        Ok(())
    } else {
        Err(SizeMismatch { first: a.size, second: b.size })
    }
}
