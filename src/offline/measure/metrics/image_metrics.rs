//! Metrics of a picture, of several pictures, and of the views of a dataset.
//!
//! In: pictures and their references. Out: [`ImageMetrics`] of each, [`MeanMetrics`] of all; an [`Evaluation`] has both
//! for the views of a dataset.

use super::{MAX_PSNR, SizeMismatch, SquaredError, flip, ms_ssim, ssim};
use crate::view::Picture;
use serde::Serialize;

/// Which metrics to compute in addition to PSNR. Each takes longer than the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MetricSet {
    /// Structural similarity.
    pub ssim: bool,
    /// Structural similarity at five scales.
    pub ms_ssim: bool,
    /// FLIP.
    pub flip: bool,
}

impl MetricSet {
    /// PSNR alone.
    pub const PSNR: Self = Self { ssim: false, ms_ssim: false, flip: false };
    /// PSNR and SSIM.
    pub const SSIM: Self = Self { ssim: true, ..Self::PSNR };
    /// Every metric.
    pub const ALL: Self = Self { ssim: true, ms_ssim: true, flip: true };
}

/// Metrics of a picture against its reference. A metric that was not computed is `None`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ImageMetrics {
    /// PSNR in dB, mean of the three channels ([`SquaredError::channel_psnr`]).
    pub psnr: f64,
    /// PSNR in dB of all values together.
    pub psnr_pooled: f64,
    /// Whether the pictures are identical.
    pub identical: bool,
    /// SSIM, at most 1.
    pub ssim: Option<f64>,
    /// MS-SSIM, 0 to 1; also `None` if a side is shorter than `MS_SSIM_MIN_SIDE`.
    pub ms_ssim: Option<f64>,
    /// Mean FLIP, 0 (same) to 1.
    pub flip: Option<f64>,
    /// The squared error that the PSNR is computed from.
    #[serde(skip)]
    pub error: SquaredError,
}

impl ImageMetrics {
    /// Compares a picture with its reference.
    ///
    /// # Errors
    /// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
    pub fn of(reference: &Picture, picture: &Picture, wanted: MetricSet) -> Result<Self, SizeMismatch> {
        Ok(Self {
            ssim: wanted.ssim.then(|| ssim(reference, picture)).transpose()?,
            ms_ssim: if wanted.ms_ssim { ms_ssim(reference, picture)? } else { None },
            flip: wanted.flip.then(|| flip(reference, picture)).transpose()?,
            ..SquaredError::of(reference, picture)?.into()
        })
    }
}

/// The PSNR of a picture, and no other metric.
impl From<SquaredError> for ImageMetrics {
    fn from(error: SquaredError) -> Self {
        Self {
            psnr: error.channel_psnr(),
            psnr_pooled: error.psnr(),
            identical: error.is_identical(),
            ssim: None,
            ms_ssim: None,
            flip: None,
            error,
        }
    }
}

/// Metrics over several pictures. A metric that any picture lacks is `None`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeanMetrics {
    /// The figure of the literature, dB: the mean of [`ImageMetrics::psnr`] over the pictures that are not identical to
    /// their references; [`MAX_PSNR`] if all are.
    pub psnr: f64,
    /// PSNR in dB of the squared error of all values of all pictures together. Choices are made by it.
    pub psnr_pooled: f64,
    /// Number of pictures that are identical to their references.
    pub identical: usize,
    /// Mean SSIM.
    pub ssim: Option<f64>,
    /// Mean MS-SSIM.
    pub ms_ssim: Option<f64>,
    /// Mean FLIP.
    pub flip: Option<f64>,
    /// Number of pictures.
    #[serde(skip)]
    pub count: usize,
}

impl MeanMetrics {
    /// Returns the metrics over `all`; `None` if it is empty.
    pub fn of(all: &[ImageMetrics]) -> Option<Self> {
        let count = all.len();
        let mean = |of: fn(&ImageMetrics) -> Option<f64>| {
            all.iter().map(of).sum::<Option<f64>>().map(|sum| sum / count as f64)
        };
        let differing = all.iter().filter(|metrics| !metrics.identical);
        let identical = count - differing.clone().count();
        let psnr = match count - identical {
            0 => MAX_PSNR,
            differing_count => differing.map(|metrics| metrics.psnr).sum::<f64>() / differing_count as f64,
        };
        let error: SquaredError = all.iter().map(|metrics| metrics.error).collect();
        let mean = Self {
            psnr,
            psnr_pooled: error.psnr(),
            identical,
            ssim: mean(|metrics| metrics.ssim),
            ms_ssim: mean(|metrics| metrics.ms_ssim),
            flip: mean(|metrics| metrics.flip),
            count,
        };
        (count > 0).then_some(mean)
    }

    /// Returns a sentence about identical pictures, called `noun` in the plural; `None` if there are none.
    pub fn identical_in_words(&self, noun: &str) -> Option<String> {
        let Self { identical, count, .. } = *self;
        match identical {
            0 => None,
            _ if identical == count => {
                Some(format!("all {count} {noun} are identical: PSNR is capped at {MAX_PSNR} dB"))
            }
            _ => Some(format!("{identical} of {count} {noun} are identical and not part of the mean PSNR")),
        }
    }
}

/// Metrics of one view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewMetrics {
    /// Name of the view.
    pub name: String,
    /// Its timestamp, in the capture's unit.
    pub time: f32,
    /// The metrics.
    #[serde(flatten)]
    pub metrics: ImageMetrics,
}

/// Metrics of a scene over the views of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Color behind pixels that an image does not cover, RGB, 0 to 1.
    pub background: [f32; 3],
    /// Whether an image has a pixel that it does not cover.
    pub has_gaps: bool,
    /// Every view, in the order of the dataset.
    pub views: Vec<ViewMetrics>,
    /// The metrics over all views.
    pub mean: MeanMetrics,
    /// The same over a contrasting background; `None` if that was not measured, or if no background is visible.
    pub contrast: Option<Contrast>,
}

/// Metrics over a background that contrasts with the one of training.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Contrast {
    /// The background, RGB, 0 to 1.
    pub background: [f32; 3],
    /// The metrics over all views.
    #[serde(flatten)]
    pub mean: MeanMetrics,
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{UVec2, Vec3};

    /// Returns the metrics of a picture whose channels differ by `difference` from black.
    fn metrics(difference: f32, ssim: Option<f64>) -> ImageMetrics {
        let picture = |value| Picture::filled(UVec2::splat(4), Vec3::splat(value));
        let metrics = ImageMetrics::of(&picture(0.0), &picture(difference), MetricSet::PSNR).expect("the same size");
        ImageMetrics { ssim, ..metrics }
    }

    #[test]
    fn a_mean_needs_the_metric_of_every_view() {
        let mean = MeanMetrics::of(&[metrics(0.1, Some(0.9)), metrics(0.01, Some(0.7))]).expect("two views");
        assert!((mean.psnr - 30.0).abs() < 1e-5, "the mean of 20 and 40 dB: {mean:?}");
        let pooled = -10.0 * (0.010_1f64 / 2.0).log10();
        assert!((mean.psnr_pooled - pooled).abs() < 1e-5, "the PSNR of the mean squared error: {mean:?}");
        assert!(mean.ssim.is_some_and(|ssim| (ssim - 0.8).abs() < 1e-12), "the mean of two: {mean:?}");
        assert_eq!(mean.ms_ssim, None, "no view has MS-SSIM");
        let partial = MeanMetrics::of(&[metrics(0.1, Some(0.9)), metrics(0.01, None)]).expect("two views");
        assert_eq!(partial.ssim, None, "a mean over fewer views would mislead");
        assert_eq!(MeanMetrics::of(&[]), None, "there is no mean of no views");
    }

    #[test]
    fn identical_views_are_counted_and_not_part_of_the_mean_psnr() {
        let views = [metrics(0.0, None), metrics(0.1, None), metrics(0.01, None)];
        let mean = MeanMetrics::of(&views).expect("three views");
        assert_eq!(mean.identical, 1, "one view is identical");
        assert!((mean.psnr - 30.0).abs() < 1e-5, "the mean of the other two: {mean:?}");
        let pooled = -10.0 * (0.010_1f64 / 3.0).log10();
        assert!((mean.psnr_pooled - pooled).abs() < 1e-5, "all three are pooled: {mean:?}");
        let words = mean.identical_in_words("views").expect("one view is identical");
        assert!(words.starts_with("1 of 3 views are identical"), "the count is reported: {words}");
        let all = MeanMetrics::of(&views[..1]).expect("one view");
        assert_eq!((all.psnr, all.psnr_pooled), (MAX_PSNR, MAX_PSNR), "PSNR of identical views alone is the cap");
        assert_eq!(
            MeanMetrics::of(&views[1..]).expect("two views").identical_in_words("views"),
            None,
            "none is identical"
        );
    }
}
