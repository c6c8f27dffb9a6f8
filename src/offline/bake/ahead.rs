//! What can be refused before the first stage of a bake.
//!
//! In: the settings, the division of the views, an engine. Out: the error of the stage that would fail because of these alone: validation views,
//! images, memory, the adapter.

use crate::offline::bake_settings::BakeSettings;
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::fine_tune::{TrainingImages, obstacle};
use crate::offline::memory_check::{BY_RESOLUTION, Pictures};
use crate::offline::metrics::MetricSet;
use crate::offline::search::{Goal, ScoreChoice, no_validation};
use crate::offline::splits::Splits;
use crate::offline::{OfflineError, Progress};
use crate::scene::GaussianScene;

/// Checks everything that depends on the settings, the views and the engine alone.
///
/// # Errors
/// As [`require_validation`]; pictures that do not fit the memory or the GPU.
pub(super) fn check(
    settings: &BakeSettings,
    splits: &Splits,
    views: &[TrainingView],
    engine: &Engine,
) -> Result<(), OfflineError> {
    require_validation(settings, splits)?;
    Pictures::looked_at(views).require(engine.headless(), BY_RESOLUTION)?;
    Pictures::compared(&splits.validation).require(engine.headless(), BY_RESOLUTION)?;
    // The test views, which are of the same sizes.
    Pictures::evaluated(views, MetricSet::ALL, true).require(engine.headless(), BY_RESOLUTION)?;
    if let Some(headless) = engine.headless().filter(|_| settings.fine_tune.is_some()) {
        TrainingImages::require_room(&splits.train, &splits.validation, headless)?;
    }
    Ok(())
}

/// Checks that there are validation views if a choice is made on them, and their images if a loss is measured on these.
///
/// # Errors
/// There are no validation views, or an image is missing.
pub(crate) fn require_validation(settings: &BakeSettings, splits: &Splits) -> Result<(), OfflineError> {
    let by_loss = matches!(settings.goal, Goal::MaxLoss(_));
    if !by_loss && matches!(settings.score, ScoreChoice::One(_)) {
        return Ok(());
    }
    if splits.validation.is_empty() {
        return Err(no_validation(by_loss));
    }
    match splits.validation.iter().find(|view| by_loss && !view.image.is_file()) {
        Some(view) => Err(OfflineError::at(
            &view.image,
            "is missing: a loss is measured on the images of the validation views; put them beside the camera file, \
             or give --ratio or --keep",
        )),
        None => Ok(()),
    }
}

/// Returns why Gaussians would not be trained after they have been pruned, whatever the engine: their form, or an image that is missing. `None` if
/// they would be.
///
/// # Errors
/// Views that cannot be used.
pub(crate) fn obstacle_to_tuning(
    scene: &GaussianScene,
    settings: &BakeSettings,
    progress: &mut dyn Progress,
) -> Result<Option<String>, OfflineError> {
    let splits = Splits::open(&settings.data, &settings.splits, &scene.trained_with, progress)?;
    Ok(obstacle(&scene.form, &splits.all_training(&scene.trained_with, progress)?))
}
