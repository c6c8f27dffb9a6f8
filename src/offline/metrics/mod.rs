//! Metrics of pictures: PSNR, SSIM, MS-SSIM and FLIP; and their means over the views of a dataset.
//!
//! In: two [`Picture`]s of the same size, values 0 to 1 (nothing is clamped here: clamp a rendering with
//! [`Picture::clamped`] first, as the original evaluation does). Out: one number, which is not finite if a pixel is
//! not. Every PSNR derives from a [`SquaredError`]. [`evaluate()`] computes the metrics for every view of a dataset.

mod evaluate;
mod flip;
mod ms_ssim;
mod psnr;
mod ssim;

pub use evaluate::{
    Contrast, Evaluation, EvaluationSettings, ImageMetrics, MeanMetrics, MetricSet, ViewMetrics, evaluate, side_by_side,
};
pub use flip::flip;
pub use ms_ssim::{MS_SSIM_MIN_SIDE, ms_ssim};
pub(crate) use psnr::decibels;
pub use psnr::{MAX_PSNR, SquaredError};
pub use ssim::{similarity_slopes, ssim};

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
fn check_sizes(a: &Picture, b: &Picture) -> Result<(), SizeMismatch> {
    let count = a.size.x as usize * a.size.y as usize;
    if a.size == b.size && count > 0 && a.pixels.len() == count && b.pixels.len() == count {
        Ok(())
    } else {
        Err(SizeMismatch { first: a.size, second: b.size })
    }
}
