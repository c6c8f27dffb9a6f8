//! Metrics of pictures: PSNR, SSIM, MS-SSIM and FLIP; and their means over the views of a dataset.
//!
//! In: two [`Picture`](crate::view::Picture)s of the same size, values 0 to 1 (nothing is clamped here: clamp a rendering with
//! [`Picture::clamped`](crate::view::Picture::clamped) first, as the original evaluation does). Out: one number, which is not finite if a pixel is
//! not. Every PSNR derives from a [`SquaredError`]. [`evaluate()`] computes the metrics for every view of a dataset.

mod evaluate;
mod flip;
mod ms_ssim;
mod psnr;
mod size_mismatch;
mod ssim;

pub use evaluate::{
    Contrast, Evaluation, EvaluationSettings, ImageMetrics, MeanMetrics, MetricSet, ViewMetrics, evaluate, side_by_side,
};
pub use flip::flip;
pub use ms_ssim::{MS_SSIM_MIN_SIDE, ms_ssim};
pub(crate) use psnr::decibels;
pub use psnr::{MAX_PSNR, SquaredError};
pub use size_mismatch::SizeMismatch;
pub use ssim::{similarity_slopes, ssim};
