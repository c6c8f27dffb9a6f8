//! How close pictures are to others.
//!
//! In: scenes and the views of a dataset, or pictures. Out: PSNR, SSIM, MS-SSIM and FLIP for each view and on average.
//!
//! | module | subject |
//! |---|---|
//! | `metrics` | the metrics of two pictures, and their means |
//! | `evaluation`, `evaluation_parts` | a scene against the images of a dataset, whole or in parts on many machines |
//! | `reference_pictures` | several scenes against the same images, or against pictures of another scene |
//! | `comparison` | two folders of pictures |
//! | `belonging` | whether images show a capture at all |
//! | `memory` | how many views are compared at once, and the memory for them |

pub(crate) mod belonging;
pub(crate) mod comparison;
mod error;
pub(crate) mod evaluation;
pub(crate) mod evaluation_parts;
pub(crate) mod memory;
pub(crate) mod metrics;
pub(crate) mod reference_pictures;

pub use error::MeasureError;
pub use evaluation::{contrast, evaluate_scene};
pub use metrics::{
    Contrast, Evaluation, ImageMetrics, MAX_PSNR, MeanMetrics, MetricSet, SizeMismatch, SquaredError, ViewMetrics,
    flip, ms_ssim, ssim,
};
