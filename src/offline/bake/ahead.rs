//! What can be refused before the first stage of a bake.
//!
//! In: the settings, the division of the views, an engine. Out: the error of the stage that would fail because of these
//! alone: missing validation views or images, too little memory, too large pictures.

use super::BakeError;
use super::settings::BakeSettings;
use crate::offline::dataset::splits::Splits;
use crate::offline::dataset::{DatasetError, TrainingView};
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::measure::memory::evaluated;
use crate::offline::measure::metrics::MetricSet;
use crate::offline::prune::search::{Goal, ScoreChoice, no_validation};
use crate::offline::train::{TrainingImages, untrainable::obstacle};
use crate::offline::work::Progress;
use crate::scene::GaussianScene;

/// Checks what depends on the settings, the views and the engine alone.
///
/// # Errors
/// As [`require_validation`]; pictures that do not fit the memory or the GPU.
pub(super) fn check(
    settings: &BakeSettings,
    splits: &Splits,
    views: &[TrainingView],
    engine: &Engine,
) -> Result<(), BakeError> {
    require_validation(settings, splits)?;
    // The test views have the sizes of the training views.
    let evaluated = evaluated(views, MetricSet::ALL, true);
    for pictures in [Pictures::looked_at(views), Pictures::compared(&splits.validation), evaluated] {
        pictures.require(engine.headless(), Purpose::Dataset)?;
    }
    if let Some(headless) = engine.headless().filter(|_| settings.fine_tune.is_some()) {
        TrainingImages::require_room(&splits.train, &splits.validation, headless)?;
    }
    Ok(())
}

/// Checks that there are validation views if a choice is made on them, and their images if a loss is measured on these.
///
/// # Errors
/// There are no validation views, or an image is missing.
pub(super) fn require_validation(settings: &BakeSettings, splits: &Splits) -> Result<(), BakeError> {
    let by_loss = matches!(settings.goal, Goal::MaxLoss(_));
    if !by_loss && matches!(settings.score, ScoreChoice::One(_)) {
        return Ok(());
    }
    if splits.validation.is_empty() {
        return Err(no_validation(by_loss).into());
    }
    match splits.validation.iter().find(|view| by_loss && !view.image.is_file()) {
        Some(view) => Err(BakeError::MissingImage { image: view.image.clone() }),
        None => Ok(()),
    }
}

/// Returns why the Gaussians would not be trained after pruning, with any engine: their form, or a missing image.
/// `None` if they would be trained.
///
/// # Errors
/// Views that cannot be used.
pub(crate) fn obstacle_to_tuning(
    scene: &GaussianScene,
    settings: &BakeSettings,
    progress: &mut dyn Progress,
) -> Result<Option<String>, DatasetError> {
    let splits = Splits::open(&settings.data, &settings.splits, &scene.trained_with, progress)?;
    Ok(obstacle(&scene.form, &splits.all_training(&scene.trained_with, progress)?))
}
