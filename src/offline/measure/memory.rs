//! The memory of comparisons of pictures.
//!
//! In: the views that are compared, the metrics that are measured. Out: the number of views that are compared at once,
//! and the memory that they take ([`Pictures`]).

use super::metrics::MetricSet;
use crate::offline::dataset::TrainingView;
use crate::offline::engine::memory::{IMAGE, PICTURE, Pictures, WRITTEN, pixels};

/// Bytes for each pixel while FLIP compares two pictures, as measured with pictures of 1024x1024 and 2048x2048 pixels.
const FLIP: u64 = 150;
/// Bytes for each pixel while MS-SSIM compares two pictures: both at half size, and again at half of that.
const MS_SSIM: u64 = 8;
/// Bytes for each pixel while reference, render and difference are put side by side: a clamped copy, the difference,
/// all three.
const SIDE_BY_SIDE: u64 = PICTURE + PICTURE + 3 * (PICTURE + WRITTEN);
/// Bytes for each pixel of an image that is compared, as a picture and as it was loaded, besides the render and its
/// clamped copy.
const COMPARED: u64 = PICTURE + IMAGE;
/// Most bytes of views that are compared at once, unless a single view needs more.
const COMPARED_BYTES: u64 = 1 << 30;

/// Returns the memory of images that are compared with pictures, [some at a time](compared_at_once); `kept`: whether
/// both are also put side by side.
pub(crate) fn evaluated(views: &[TrainingView], metrics: MetricSet, kept: bool) -> Pictures {
    let at_once = compared_at_once(views, metrics) as u64;
    let side_by_side = if kept { SIDE_BY_SIDE } else { 0 };
    let largest = Pictures::looked_at(views).largest();
    Pictures::drawn(largest, at_once * COMPARED).with_work(at_once * comparing(metrics) + side_by_side)
}

/// Returns how many views are compared with their images at once: one for each thread while they take little memory,
/// and at least one.
pub(crate) fn compared_at_once(views: &[TrainingView], metrics: MetricSet) -> usize {
    let each = pixels(Pictures::looked_at(views).largest()).saturating_mul(comparing(metrics)).max(1);
    rayon::current_num_threads().min((COMPARED_BYTES / each) as usize).max(1)
}

/// Returns the bytes for each pixel of an image while it is compared with a picture.
fn comparing(metrics: MetricSet) -> u64 {
    let measured = [(metrics.flip, FLIP), (metrics.ms_ssim, MS_SSIM)];
    COMPARED + 2 * PICTURE + measured.iter().filter(|(wanted, _)| *wanted).map(|(_, bytes)| *bytes).max().unwrap_or(0)
}
