//! How close a scene is to the views of a dataset.
//!
//! In: a scene, views with their images, an [`Engine`] that draws them. Out: an [`Evaluation`], with every picture
//! shown on the way.

use super::dataset::TrainingView;
use super::engine::Engine;
use super::metrics::{Evaluation, EvaluationSettings, MetricSet, ViewMetrics, evaluate};
use super::{OfflineError, Progress};
use crate::scene::RuntimeScene;
use crate::view::{Background, Picture};

/// Draws every view of a scene and compares it with its image, as the capture was trained. Transparent images are laid
/// over the color of the background, or over that of training where the background is none. `seen` is shown each view
/// with its image and its picture (not clamped). Begins the task "comparing".
///
/// # Errors
/// Images that are missing or cannot be read, no views at all, a failure of the engine, and what `seen` reports.
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
