//! Evaluations in parts: one for each shard of the views.
//!
//! In: a scene, views with their images, an [`Engine`], a shard; or the paths of parts. Out: the file of a part, or the
//! [`Evaluation`] of all, which is that of all views at once.

use super::MeasureError;
use super::evaluation::{evaluate_over_contrast, evaluate_scene};
use super::metrics::{Contrast, Evaluation, ImageMetrics, MeanMetrics, MetricSet, SquaredError, ViewMetrics};
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::store::results::Key;
use crate::offline::store::shard::{Label, Shard, part, parts};
use crate::offline::store::stored::{Stored, Text};
use crate::offline::work::{FileError, Progress};
use crate::scene::RuntimeScene;
use crate::view::Background;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Largest number of bytes of a part for each view.
const MOST: usize = 1 << 14;

/// The result of a shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Measured {
    background: [f32; 3],
    has_gaps: bool,
    views: Vec<MeasuredView>,
    /// The contrasting background, and the squared error of each view over it.
    contrast: Option<([f32; 3], Vec<SquaredError>)>,
}

/// The metrics of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct MeasuredView {
    name: String,
    time: f32,
    error: SquaredError,
    ssim: Option<f64>,
    ms_ssim: Option<f64>,
    flip: Option<f64>,
}

impl From<&ViewMetrics> for MeasuredView {
    fn from(ViewMetrics { name, time, metrics }: &ViewMetrics) -> Self {
        let ImageMetrics { error, ssim, ms_ssim, flip, .. } = *metrics;
        Self { name: name.clone(), time: *time, error, ssim, ms_ssim, flip }
    }
}

impl From<&MeasuredView> for ViewMetrics {
    fn from(view: &MeasuredView) -> Self {
        let metrics = ImageMetrics { ssim: view.ssim, ms_ssim: view.ms_ssim, flip: view.flip, ..view.error.into() };
        Self { name: view.name.clone(), time: view.time, metrics }
    }
}

/// A scene and the views that it is evaluated on.
pub(crate) struct Subject<'a> {
    /// The file of the scene.
    pub input: &'a Path,
    /// The scene, with the filter that is used.
    pub scene: &'a RuntimeScene,
    /// All views, of all shards.
    pub views: &'a [TrainingView],
    /// The background.
    pub background: Background,
    /// Which metrics to compute.
    pub metrics: MetricSet,
}

impl Subject<'_> {
    /// Returns the label of the evaluation.
    ///
    /// # Errors
    /// The scene or an image cannot be read.
    pub(crate) fn label(
        &self,
        engine: &Engine,
        shard: Shard,
        progress: &mut dyn Progress,
    ) -> Result<Label, MeasureError> {
        let Self { scene, views, background, metrics, .. } = self;
        let read = format!("{:?} {:?} {background:?}", scene.trained_with, scene.playback);
        Ok(Label::new("eval", shard)
            .with("scene", Key::of_scene(self.input)?)
            .with("reading of the scene", Key::of(read.as_bytes()))
            .with("use of the filter", scene.filter.is_some())
            .with("set of views", Key::of_views(views))
            .with("set of images", Key::of_images(views, progress)?)
            .with("set of metrics", format!("{metrics:?}"))
            .with("engine", engine.kind()))
    }

    /// Evaluates the views of the shard of the label, and writes the part; returns false if the same part is there
    /// already.
    ///
    /// # Errors
    /// As [`evaluate_scene`], and a part that cannot be written.
    pub(crate) fn write_part(
        &self,
        out: &Path,
        label: &Label,
        engine: &mut Engine,
        progress: &mut dyn Progress,
    ) -> Result<bool, MeasureError> {
        if part::is_there(out, label) {
            return Ok(false);
        }
        let measured = match self.share(label.shard()) {
            share if share.is_empty() => {
                Measured { background: [0.0; 3], has_gaps: false, views: Vec::new(), contrast: None }
            }
            share => self.measure(&share, engine, progress)?,
        };
        part::write(out, label, &Text(measured).encode()?)?;
        Ok(true)
    }

    /// Returns the views of a shard.
    fn share(&self, shard: Shard) -> Vec<TrainingView> {
        let share = shard.share(&vec![1; self.views.len()]);
        share.into_iter().filter_map(|index| self.views.get(index).cloned()).collect()
    }

    /// Evaluates these views.
    fn measure(
        &self,
        views: &[TrainingView],
        engine: &mut Engine,
        progress: &mut dyn Progress,
    ) -> Result<Measured, MeasureError> {
        let Self { scene, background, metrics, .. } = *self;
        let evaluation = evaluate_scene(engine, scene, views, background, metrics, progress, |_, _, _| Ok(()))?;
        // All views are drawn over the contrasting background if the image of any view has gaps.
        let mut any = evaluation.has_gaps;
        for view in self.views {
            any = any || view.load_covered()?.has_gaps;
        }
        let contrast = match any {
            true => evaluate_over_contrast(engine, scene, views, background, progress)?,
            false => None,
        };
        let errors = |over: Evaluation| over.views.iter().map(|view| view.metrics.error).collect();
        Ok(Measured {
            background: evaluation.background,
            has_gaps: evaluation.has_gaps,
            views: evaluation.views.iter().map(MeasuredView::from).collect(),
            contrast: contrast.map(|over| (over.background, errors(over))),
        })
    }
}

/// Reads parts, which must have the inputs of the label, and puts them together. `count` is the number of views of all.
///
/// # Errors
/// As `parts::in_order`, files that cannot be read.
pub fn merge(paths: &[PathBuf], label: &Label, count: usize) -> Result<Evaluation, MeasureError> {
    let (paths, _) = parts::in_order(paths, Some(label))?;
    let mut all = Vec::new();
    for path in &paths {
        let bytes = part::result(path, count.saturating_add(1).saturating_mul(MOST))?;
        let measured = Text::<Measured>::decode(&bytes).map(|Text(measured)| measured);
        all.push(measured.ok_or_else(|| FileError::at(path, "holds no evaluation: make it again"))?);
    }
    let found: usize = all.iter().map(|part| part.views.len()).sum();
    // Which views a part has follows from the number of shards and of views.
    let is_whole = (Shard::all(paths.len() as u32).zip(&all)).all(|(shard, part)| {
        let share = shard.share(&vec![1; count]).len();
        part.views.len() == share && part.contrast.as_ref().is_none_or(|(_, errors)| errors.len() == share)
    });
    match paths.first() {
        Some(first) if !is_whole => {
            let message = format!("and the other parts hold {found} views of {count}: make them again");
            Err(FileError::at(first, message).into())
        }
        _ => together(&all, count),
    }
}

/// Returns the items of all parts in the order of the views.
fn in_order_of_views<T>(parts: impl IntoIterator<Item = Vec<T>>, shards: u32, count: usize) -> Vec<T> {
    let weights = vec![1; count];
    let numbered =
        Shard::all(shards).zip(parts).flat_map(|(shard, items)| shard.share(&weights).into_iter().zip(items));
    let mut numbered: Vec<(usize, T)> = numbered.collect();
    numbered.sort_by_key(|(number, _)| *number);
    numbered.into_iter().map(|(_, item)| item).collect()
}

/// Returns the evaluation of all views.
fn together(all: &[Measured], count: usize) -> Result<Evaluation, MeasureError> {
    let shards = all.len() as u32;
    let mean_of = |metrics: &[ImageMetrics]| MeanMetrics::of(metrics).ok_or(MeasureError::NoViews);
    let views = all.iter().map(|part| part.views.iter().map(ViewMetrics::from).collect());
    let views: Vec<ViewMetrics> = in_order_of_views(views, shards, count);
    let mean = mean_of(&views.iter().map(|view| view.metrics).collect::<Vec<_>>())?;
    let filled: Vec<&Measured> = all.iter().filter(|part| !part.views.is_empty()).collect();
    let over = filled.first().and_then(|part| part.contrast.as_ref()).map(|(background, _)| *background);
    let contrast = match over {
        Some(background) if filled.iter().all(|part| part.contrast.is_some()) => {
            let errors = |part: &Measured| part.contrast.iter().flat_map(|(_, errors)| errors).copied().collect();
            let errors: Vec<SquaredError> = in_order_of_views(all.iter().map(errors), shards, count);
            let metrics: Vec<ImageMetrics> = errors.into_iter().map(ImageMetrics::from).collect();
            Some(Contrast { background, mean: mean_of(&metrics)? })
        }
        _ => None,
    };
    Ok(Evaluation {
        background: filled.first().map_or([0.0; 3], |part| part.background),
        has_gaps: all.iter().any(|part| part.has_gaps),
        views,
        mean,
        contrast,
    })
}
