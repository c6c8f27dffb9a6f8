//! The loss of quality by every score, prune ratio and temporal filter, without training.
//!
//! In: a scene, its training views, the views to measure on. Out: one row for the whole scene, for each filter and for
//! each score at each ratio ([`AblationRow`]).

use super::PruneError;
use super::search::ScoreChoice;
use super::select::{highest, kept_count, select};
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::filter::temporal_filter::{filter, filter_name};
use crate::offline::forms::Subject;
use crate::offline::measure::evaluation::evaluate_scene;
use crate::offline::measure::memory::evaluated;
use crate::offline::measure::{MeanMetrics, MetricSet};
use crate::offline::score::{ScoringSettings, Variant};
use crate::offline::work::Progress;
use crate::scene::{FilterKind, GaussianScene, RuntimeScene, TemporalFilter};
use crate::view::Background;
use serde::Serialize;

/// Settings of an ablation. Filters are measured on the whole scene, ratios without a filter.
#[derive(Debug, Clone, PartialEq)]
pub struct AblationSettings {
    /// Kinds of temporal filter.
    pub filters: Vec<FilterKind>,
    /// Numbers of key-frames, each tried with every kind of filter.
    pub key_frames: Vec<u32>,
    /// Fractions of the Gaussians to remove, 0 to 1.
    pub ratios: Vec<f64>,
    /// Scores to prune by, each tried at every ratio.
    pub scores: Vec<ScoreChoice>,
    /// Settings of the scoring.
    pub scoring: ScoringSettings,
}

/// One row of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AblationRow {
    /// Description of the filter, or of the score and ratio.
    pub row: String,
    /// The metrics over the measured views.
    #[serde(flatten)]
    pub metrics: MeanMetrics,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Fraction of the Gaussians that the filter leaves active, mean over its segments; `None` without a filter.
    pub active_share: Option<f64>,
}

/// Measures every row on the views `measured`, which need their images; scores and filters come from the views `train`.
/// Begins the tasks "filters" and "pruned".
///
/// # Errors
/// Pictures that do not fit the memory or the GPU, images that cannot be read, training views in which no Gaussian of
/// the scene is visible, a failure of the engine.
pub fn ablate(
    engine: &mut Engine,
    mut subject: Subject,
    train: Vec<TrainingView>,
    measured: &[TrainingView],
    settings: &AblationSettings,
    progress: &mut dyn Progress,
) -> Result<Vec<AblationRow>, PruneError> {
    evaluated(measured, MetricSet::SSIM, false).require(engine.headless(), Purpose::Dataset)?;
    Pictures::looked_at(&train).require(engine.headless(), Purpose::Dataset)?;
    subject.runtime.filter = None;
    let mut table = Table { engine, measured, background: subject.background, rows: Vec::new() };
    let AblationSettings { filters, key_frames, ratios, scores, scoring } = settings;
    progress.begin("filters", 1 + filters.len() * key_frames.len());
    table.measure("vanilla".to_owned(), &subject.runtime, progress)?;
    for &kind in filters {
        for &keys in key_frames {
            progress.advance();
            subject.runtime.filter = Some(filter(table.engine, &subject.scene, kind, keys, &train, progress)?);
            let name = format!("filter only, {}, {keys} key-frames", filter_name(kind));
            table.measure(name, &subject.runtime, progress)?;
        }
    }
    progress.finish();
    subject.runtime.filter = None;
    if ratios.is_empty() || scores.is_empty() {
        return Ok(table.rows);
    }
    let found = scoring.scores(table.engine, &subject, &train, progress)?;
    drop(subject.scene);
    let variants = variants(scores, found.has_volume()).into_iter();
    let scores = variants.map(|variant| found.of(variant).map(|scores| (variant, scores)));
    let scores = scores.collect::<Result<Vec<_>, _>>()?;
    table.prune(&subject.runtime.into(), ratios, &scores, progress)?;
    Ok(table.rows)
}

/// Returns the scores of the choices, each once.
fn variants(choices: &[ScoreChoice], has_volume: bool) -> Vec<Variant> {
    let mut variants: Vec<Variant> = Vec::new();
    for choice in choices {
        let chosen = choice.variants(has_volume);
        // The scores of one choice are in the order of `Variant::ALL`.
        let new = Variant::ALL.into_iter().filter(|variant| chosen.contains(variant) && !variants.contains(variant));
        let new: Vec<Variant> = new.collect();
        variants.extend(new);
    }
    variants
}

/// The rows so far, and the engine and views they are measured with.
struct Table<'a> {
    engine: &'a mut Engine,
    measured: &'a [TrainingView],
    background: Background,
    rows: Vec<AblationRow>,
}

impl Table<'_> {
    fn prune(
        &mut self,
        scene: &GaussianScene,
        ratios: &[f64],
        scores: &[(Variant, Vec<f32>)],
        progress: &mut dyn Progress,
    ) -> Result<(), PruneError> {
        progress.begin("pruned", ratios.len() * scores.len());
        for &ratio in ratios {
            for (variant, scores) in scores {
                progress.advance();
                let kept = highest(scores, kept_count(scene.len(), ratio));
                // Rounded to tenths of a percent; a digit 0 is not shown.
                let percent = (ratio * 1000.0).round() / 10.0;
                let pruned = select(scene, &kept).into_runtime()?;
                self.measure(format!("prune {percent}% {variant}"), &pruned, progress)?;
            }
        }
        progress.finish();
        Ok(())
    }

    /// Adds a row.
    fn measure(&mut self, row: String, scene: &RuntimeScene, progress: &mut dyn Progress) -> Result<(), PruneError> {
        let Self { measured, background, .. } = *self;
        let evaluation =
            evaluate_scene(self.engine, scene, measured, background, MetricSet::SSIM, progress, |_, _, _| Ok(()))?;
        let active_share = scene.filter.as_ref().map(TemporalFilter::active_share);
        self.rows.push(AblationRow { row, metrics: evaluation.mean, gaussians: scene.len(), active_share });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_score_is_tried_once() {
        let choices = [ScoreChoice::One(Variant::Energy), ScoreChoice::Auto, ScoreChoice::All];
        let all = variants(&choices, true);
        assert_eq!(all[..3], [Variant::Energy, Variant::Full, Variant::Removal], "scores in the order of the choices");
        assert_eq!(all.len(), Variant::ALL.len(), "every score is tried once");
    }
}
