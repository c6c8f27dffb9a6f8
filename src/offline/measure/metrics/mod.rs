//! Metrics of pictures: PSNR, SSIM, MS-SSIM and FLIP, and their means.
//!
//! In: two [`Picture`](crate::view::Picture)s of the same size, values 0 to 1 (nothing is clamped here: clamp a
//! rendering with [`Picture::clamped`](crate::view::Picture::clamped) first, as the original evaluation does). Out: one
//! number, which is not finite if a pixel is not. Every PSNR derives from a [`SquaredError`].

mod flip;
mod image_metrics;
pub(crate) mod ms_ssim;
mod psnr;
mod side_by_side;
mod size_mismatch;
pub(crate) mod ssim;

pub use flip::flip;
pub use image_metrics::{Contrast, Evaluation, ImageMetrics, MeanMetrics, MetricSet, ViewMetrics};
pub use ms_ssim::ms_ssim;
pub(crate) use psnr::decibels;
pub use psnr::{MAX_PSNR, SquaredError};
pub(crate) use side_by_side::side_by_side;
pub use size_mismatch::SizeMismatch;
pub(crate) use ssim::similarity_slopes;
pub use ssim::ssim;
