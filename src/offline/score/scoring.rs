//! Scoring a scene with the training views of its dataset.
//!
//! In: training views, how many of them to score with ([`ScoringSettings`]), an [`Engine`]. Out: [`Scores`].

use super::{ScoreError, ScoreSettings, Scores, Traits, scorer};
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::to_draw;
use crate::offline::dataset::splits::subset;
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::forms::Subject;
use crate::offline::store::shard::Shard;
use crate::offline::work::Progress;

/// Settings of scoring.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ScoringSettings {
    /// Number of views to score with, an even subset of all. Default: `None`, all of them.
    pub views: Option<usize>,
    /// Parameters of the scores.
    pub score: ScoreSettings,
}

impl ScoringSettings {
    /// Scores a scene with an even subset of these views. Begins the task "scoring".
    ///
    /// # Errors
    /// A scene that cannot be drawn, views that do not fit the memory or the GPU or show nothing of the scene, a
    /// failure of the engine.
    pub fn scores(
        &self,
        engine: &mut Engine,
        subject: &Subject,
        views: &[TrainingView],
        progress: &mut dyn Progress,
    ) -> Result<Scores, ScoreError> {
        self.of_shard(engine, subject, views, Shard::WHOLE, progress)?.whole()
    }

    /// Scores a scene with those views of this subset that belong to a shard. Begins the task "scoring".
    ///
    /// # Errors
    /// As [`scores`](Self::scores), except that views may show nothing of the scene.
    pub(crate) fn of_shard(
        &self,
        engine: &mut Engine,
        subject: &Subject,
        views: &[TrainingView],
        shard: Shard,
        progress: &mut dyn Progress,
    ) -> Result<Scores, ScoreError> {
        Pictures::looked_at(views).require(engine.headless(), Purpose::Dataset)?;
        let traits = Traits::of(&subject.scene)?;
        let views = subset(views.to_vec(), self.views);
        let views = to_draw(&views, subject.runtime.trained_with.optics());
        let mut scorer = scorer(engine, &subject.runtime, subject.background)?;
        progress.begin("scoring", Scores::count(&views, shard));
        let scores = Scores::of_shard(scorer.as_mut(), &traits, &views, &self.score, shard, progress)?;
        progress.finish();
        Ok(scores)
    }
}
