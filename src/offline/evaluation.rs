//! Evaluating a scene on the views of a dataset.
//!
//! In: a scene, views with their images, an [`Engine`]. Out: an [`Evaluation`]; each picture is passed to the caller.

use super::dataset::TrainingView;
use super::engine::Engine;
use super::metrics::{Evaluation, EvaluationSettings, MetricSet, ViewMetrics, evaluate};
use super::{OfflineError, Progress};
use crate::scene::RuntimeScene;
use crate::view::{Background, Picture};

/// Draws every view of a scene, with the field of view that it was trained with, and compares it with its image.
/// Transparent images are composited over the color of `background`, or over that of training if `background` has none.
/// Calls `seen` with the metrics of each view, its image and its picture (not clamped). Begins the task "comparing".
///
/// # Errors
/// Images that are missing or cannot be read, no views, a failure of the engine, and errors of `seen`.
pub fn evaluate_scene(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[TrainingView],
    background: Background,
    metrics: MetricSet,
    progress: &mut dyn Progress,
    mut seen: impl FnMut(&ViewMetrics, &Picture, &Picture) -> Result<(), OfflineError>,
) -> Result<Evaluation, OfflineError> {
    let mut settings = EvaluationSettings::of(&scene.trained_with, metrics);
    if let Background::Color(color) = background {
        settings.background = color;
    }
    let mut drawing = engine.drawing(scene, background)?;
    progress.begin("comparing", views.len());
    let evaluation = evaluate(
        views,
        &settings,
        |view| drawing.draw(view),
        |view, reference, picture| {
            progress.advance();
            seen(view, reference, picture)
        },
    )?;
    progress.finish();
    Ok(evaluation)
}
