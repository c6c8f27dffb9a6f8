//! Metrics of pictures: PSNR, SSIM, MS-SSIM and FLIP; and their means over the views of a dataset.
//!
//! In: two [`Picture`](crate::view::Picture)s of the same size, values 0 to 1 (nothing is clamped here: clamp a rendering with
//! [`Picture::clamped`](crate::view::Picture::clamped) first, as the original evaluation does). Out: one number, which is not finite if a pixel is
//! not. Every PSNR derives from a [`SquaredError`]. [`evaluate()`] computes the metrics for every view of a dataset.

pub(crate) mod evaluate;
mod flip;
pub(crate) mod ms_ssim;
mod psnr;
mod size_mismatch;
pub(crate) mod ssim;

pub(crate) use evaluate::side_by_side;
pub use evaluate::{
    Contrast, Evaluation, EvaluationSettings, ImageMetrics, MeanMetrics, MetricSet, ViewMetrics, evaluate,
};
pub use flip::flip;
pub use ms_ssim::ms_ssim;
pub(crate) use psnr::decibels;
pub use psnr::{MAX_PSNR, SquaredError};
pub use size_mismatch::SizeMismatch;
pub(crate) use ssim::similarity_slopes;
pub use ssim::ssim;
