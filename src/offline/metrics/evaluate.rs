//! Metrics of a scene over the views of a dataset.
//!
//! In: training views with their images and a closure that draws a view. Out: an [`Evaluation`], the metrics of each
//! view and of all views together. As in the original, renders are clamped and not rounded.

use glam::{UVec2, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::{MAX_PSNR, SizeMismatch, SquaredError, flip, ms_ssim, ssim};
use crate::offline::dataset::{DatasetError, TrainingView};
use crate::scene::TrainedWith;
use crate::view::{Optics, Picture, View};

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
    /// The figure of the literature, dB: the mean of [`ImageMetrics::psnr`] over the pictures that are not identical to their
    /// references; [`MAX_PSNR`] if all are.
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

/// How views are drawn and compared with their images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvaluationSettings {
    /// Color behind pixels that an image does not cover, RGB, 0 to 1.
    pub background: [f32; 3],
    /// How the cameras of the views draw the capture.
    pub optics: Optics,
    /// Which metrics to compute.
    pub metrics: MetricSet,
    /// Number of views that are compared at the same time, by as many threads.
    pub at_once: usize,
}

impl EvaluationSettings {
    /// Returns settings with the background and the optics that the capture was trained with, for one view at a time.
    pub fn of(trained: &TrainedWith, metrics: MetricSet) -> Self {
        Self { background: trained.background, optics: trained.optics(), metrics, at_once: 1 }
    }
}

/// Compares every view with its image. `draw` renders a view; `seen` is called with the metrics of each view, its image
/// and its render (not clamped), in the order of the views. Images are read and compared on all threads.
///
/// # Errors
/// An image that is missing or cannot be read, a render of another size, no views, and errors of `draw` and `seen`.
pub fn evaluate<E>(
    views: &[TrainingView],
    settings: &EvaluationSettings,
    mut draw: impl FnMut(&View) -> Result<Picture, E>,
    mut seen: impl FnMut(&ViewMetrics, &Picture, &Picture) -> Result<(), E>,
) -> Result<Evaluation, E>
where
    E: From<DatasetError> + From<SizeMismatch>,
{
    let mut all = Vec::with_capacity(views.len());
    let mut has_gaps = false;
    for some in views.chunks(settings.at_once.max(1)) {
        let images: Vec<_> = some.par_iter().map(TrainingView::load_covered).collect();
        let mut pairs = Vec::with_capacity(some.len());
        for (view, image) in some.iter().zip(images) {
            let image = image?;
            has_gaps |= image.has_gaps;
            let render = draw(&view.camera.view(view.time, settings.optics))?;
            pairs.push((image.over(Vec3::from(settings.background)), render));
        }
        let compare =
            |(reference, render): &(Picture, Picture)| ImageMetrics::of(reference, &render.clamped(), settings.metrics);
        let compared: Vec<_> = pairs.par_iter().map(compare).collect();
        for ((view, (reference, render)), metrics) in some.iter().zip(&pairs).zip(compared) {
            let measured = ViewMetrics { name: view.name.clone(), time: view.time, metrics: metrics? };
            seen(&measured, reference, render)?;
            all.push(measured);
        }
    }
    let metrics: Vec<ImageMetrics> = all.iter().map(|view| view.metrics).collect();
    let mean = MeanMetrics::of(&metrics).ok_or(SizeMismatch { first: UVec2::ZERO, second: UVec2::ZERO })?;
    Ok(Evaluation { background: settings.background, has_gaps, views: all, mean, contrast: None })
}

/// Returns reference, render and their difference times `gain`, side by side. Both must have the same size.
pub(crate) fn side_by_side(reference: &Picture, render: &Picture, gain: f32) -> Picture {
    let render = render.clamped();
    let difference: Vec<Vec3> =
        reference.pixels.iter().zip(&render.pixels).map(|(p, q)| ((*p - *q).abs() * gain).min(Vec3::ONE)).collect();
    let width = reference.size.x.max(1) as usize;
    let rows = reference.pixels.chunks(width).zip(render.pixels.chunks(width)).zip(difference.chunks(width));
    let pixels = rows.flat_map(|((a, b), c)| [a, b, c].concat()).collect();
    Picture { size: UVec2::new(reference.size.x * 3, reference.size.y), pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn side_by_side_is_three_wide() {
        let a = Picture::filled(UVec2::new(2, 2), Vec3::splat(0.5));
        let b = Picture::filled(UVec2::new(2, 2), Vec3::new(0.5, 0.25, 2.0));
        let all = side_by_side(&a, &b, 2.0);
        assert_eq!(all.size, UVec2::new(6, 2), "three pictures");
        assert_eq!(all.pixel(1, 1), Vec3::splat(0.5), "the reference");
        assert_eq!(all.pixel(2, 0), Vec3::new(0.5, 0.25, 1.0), "the render, clamped");
        assert_eq!(all.pixel(5, 1), Vec3::new(0.0, 0.5, 1.0), "twice the difference, clamped");
    }
}
