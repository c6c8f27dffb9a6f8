//! Scoring a scene by the training views of its dataset.
//!
//! In: training views, how many of them to score with and to hold out ([`ScoringSettings`]), an [`Engine`]. Out:
//! [`Scores`].

use super::{ScoreSettings, Scores, Traits};
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::{hold_out, to_draw};
use crate::offline::engine::Engine;
use crate::offline::splits::share;
use crate::offline::{OfflineError, Progress, Subject};

/// Settings of scoring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoringSettings {
    /// Number of views to score with, an even share of all. Default: `None`, all of them.
    pub views: Option<usize>,
    /// Number of views held out from scoring if results are compared; at most a quarter of all. Default: 24.
    pub held_out: usize,
    /// Parameters of the scores.
    pub score: ScoreSettings,
}

impl Default for ScoringSettings {
    fn default() -> Self {
        Self { views: None, held_out: 24, score: ScoreSettings::default() }
    }
}

impl ScoringSettings {
    /// Returns the views to score with, and those held out from scoring: none unless `compared`.
    pub fn split(&self, views: Vec<TrainingView>, compared: bool) -> (Vec<TrainingView>, Vec<TrainingView>) {
        let (scored, held_out) = if compared { hold_out(&views, self.held_out) } else { (views, Vec::new()) };
        (share(scored, self.views), held_out)
    }

    /// Scores a scene with these views. Begins the task "scoring".
    ///
    /// # Errors
    /// A scene that cannot be drawn, views that show nothing of it, a failure of the engine.
    pub fn scores(
        &self,
        engine: &mut Engine,
        subject: &Subject,
        views: &[TrainingView],
        progress: &mut dyn Progress,
    ) -> Result<Scores, OfflineError> {
        let traits = Traits::of(&subject.scene)?;
        let views = to_draw(views, subject.runtime.trained_with.raster_fov);
        let mut scorer = engine.scorer(&subject.runtime, subject.background)?;
        progress.begin("scoring", views.len());
        let scores = Scores::accumulate(scorer.as_mut(), &traits, &views, &self.score, progress)?;
        progress.finish();
        Ok(scores)
    }
}
