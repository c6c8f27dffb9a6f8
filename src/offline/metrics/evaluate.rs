//! Metrics of a scene over the views of a dataset.
//!
//! In: training views with their images and a closure that draws a view. Out: an [`Evaluation`], the metrics of each
//! view and their means, as the original evaluates: renders are clamped, not rounded, and images are loaded as in
//! training.

use glam::{UVec2, Vec3};
use serde::Serialize;

use super::{SizeMismatch, flip, ms_ssim, psnr, psnr_pooled, ssim};
use crate::offline::dataset::{DatasetError, ImageMode, TrainingView};
use crate::scene::TrainedWith;
use crate::view::{Picture, RasterFov, View};

/// Which metrics to compute beside PSNR. Each takes longer than the one before.
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

/// Metrics of a render, or the means over several. A metric that was not computed is `None`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ImageMetrics {
    /// PSNR in dB, mean of the three channels. Infinite (null in JSON) for equal pictures.
    pub psnr: f64,
    /// PSNR in dB of all values together.
    pub psnr_pooled: f64,
    /// SSIM, at most 1.
    pub ssim: Option<f64>,
    /// MS-SSIM, 0 to 1; also `None` if a side is shorter than [`MS_SSIM_MIN_SIDE`](super::MS_SSIM_MIN_SIDE).
    pub ms_ssim: Option<f64>,
    /// Mean FLIP, 0 (same) to 1.
    pub flip: Option<f64>,
}

impl ImageMetrics {
    /// Compares a render, clamped to 0..1 first, with the reference.
    ///
    /// # Errors
    /// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
    pub fn of(reference: &Picture, render: &Picture, wanted: MetricSet) -> Result<Self, SizeMismatch> {
        let render = render.clamped();
        Ok(Self {
            psnr: psnr(reference, &render)?,
            psnr_pooled: psnr_pooled(reference, &render)?,
            ssim: wanted.ssim.then(|| ssim(reference, &render)).transpose()?,
            ms_ssim: if wanted.ms_ssim { ms_ssim(reference, &render)? } else { None },
            flip: wanted.flip.then(|| flip(reference, &render)).transpose()?,
        })
    }

    /// Returns the means; a metric that is `None` in any of `all` is `None`. Returns `None` if `all` is empty.
    pub fn mean(all: &[Self]) -> Option<Self> {
        let count = all.len() as f64;
        let mean = |of: fn(&Self) -> Option<f64>| all.iter().map(of).sum::<Option<f64>>().map(|sum| sum / count);
        Some(Self {
            psnr: mean(|l| Some(l.psnr)).filter(|_| !all.is_empty())?,
            psnr_pooled: mean(|l| Some(l.psnr_pooled))?,
            ssim: mean(|l| l.ssim),
            ms_ssim: mean(|l| l.ms_ssim),
            flip: mean(|l| l.flip),
        })
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
    /// Every view, in the order of the dataset.
    pub views: Vec<ViewMetrics>,
    /// The means over the views.
    pub mean: ImageMetrics,
}

/// How images are loaded, views drawn and both compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvaluationSettings {
    /// Background of transparent images, RGB, 0 to 1.
    pub background: [f32; 3],
    /// Which of the original's two ways of loading images is used.
    pub images: ImageMode,
    /// Which field of view determines the footprints.
    pub raster_fov: RasterFov,
    /// Which metrics to compute.
    pub metrics: MetricSet,
}

impl EvaluationSettings {
    /// Returns settings with the background and the field of view that the capture was trained with. Transparent images
    /// are composited once ([`ImageMode::Dataloader`]), as for the figures that captures are compared with; the
    /// in-memory mode of training multiplies them by alpha twice.
    pub fn of(trained: &TrainedWith, metrics: MetricSet) -> Self {
        let images = ImageMode::Dataloader;
        Self { background: trained.background, images, raster_fov: trained.raster_fov, metrics }
    }
}

/// Compares every view with its image. `draw` renders a view; `seen` is called with the metrics of each view, its image
/// and its render (not clamped).
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
    for view in views {
        let reference = view.load_image(settings.background, settings.images)?.picture;
        let render = draw(&view.camera.view(view.time, settings.raster_fov))?;
        let metrics = ImageMetrics::of(&reference, &render, settings.metrics)?;
        let measured = ViewMetrics { name: view.name.clone(), time: view.time, metrics };
        seen(&measured, &reference, &render)?;
        all.push(measured);
    }
    let metrics: Vec<ImageMetrics> = all.iter().map(|view| view.metrics).collect();
    let mean = ImageMetrics::mean(&metrics).ok_or(SizeMismatch { first: UVec2::ZERO, second: UVec2::ZERO })?;
    Ok(Evaluation { views: all, mean })
}

/// Returns reference, render and their difference times `gain`, side by side. Both must have the same size.
pub fn side_by_side(reference: &Picture, render: &Picture, gain: f32) -> Picture {
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

    fn metrics(psnr: f64, ssim: Option<f64>) -> ImageMetrics {
        ImageMetrics { psnr, psnr_pooled: psnr, ssim, ms_ssim: None, flip: None }
    }

    #[test]
    fn means_leave_out_what_some_view_lacks() {
        let mean = ImageMetrics::mean(&[metrics(30.0, Some(0.9)), metrics(40.0, Some(0.7))]).expect("two views");
        assert_eq!((mean.psnr, mean.ms_ssim), (35.0, None), "mean of two, nothing of none");
        assert!(mean.ssim.is_some_and(|ssim| (ssim - 0.8).abs() < 1e-12), "mean of two: {mean:?}");
        let partial = ImageMetrics::mean(&[metrics(30.0, Some(0.9)), metrics(40.0, None)]).expect("two views");
        assert_eq!(partial.ssim, None, "a mean over fewer views would mislead");
        assert_eq!(ImageMetrics::mean(&[]), None, "no views");
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
