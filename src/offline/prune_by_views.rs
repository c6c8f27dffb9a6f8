//! Pruning a scene by what its training views show: scoring, the search for the best score, and the scene that is left.
//!
//! In: a scene, its training views, a [`Goal`]. Out: the scene with the Gaussians that matter most to them
//! ([`Pruned`]).

use super::dataset::TrainingView;
use super::engine::Engine;
use super::prune::{highest, select};
use super::score::ScoringSettings;
use super::search::{Candidate, Goal, Outcome, ScoreChoice, ScoreSearch, SearchOutcome, SearchSummary, candidates};
use super::{OfflineError, Progress, Subject};
use crate::scene::GaussianScene;

/// How to prune.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PruneSettings {
    /// How many Gaussians to keep.
    pub goal: Goal,
    /// Which score to prune by.
    pub score: ScoreChoice,
    /// How to score.
    pub scoring: ScoringSettings,
}

/// A pruned scene, and how it was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Pruned {
    /// What is left, in its old order.
    pub scene: GaussianScene,
    /// The score, the number of Gaussians kept and what that costs.
    pub outcome: Outcome,
    /// What every score gives; `None` where nothing was compared.
    pub search: Option<SearchSummary>,
}

impl Pruned {
    /// Keeps the `count` Gaussians that score highest, without a look at any view.
    pub fn unchecked(scene: &GaussianScene, candidate: Candidate, count: usize) -> Self {
        let outcome = Outcome { score: candidate.name, kept: count, psnr: None, trials: Vec::new() };
        Self { scene: select(scene, &highest(&candidate.scores, count)), outcome, search: None }
    }
}

/// Prunes by the scores in `given`, or else by those that the settings choose. Scores are compared on views held out
/// from scoring where a loss decides or several of them may be the best.
///
/// # Errors
/// A loss decides, and images of held-out views are missing; views that show nothing of the scene; a failure of the
/// engine.
pub fn prune_by_views(
    engine: &mut Engine,
    subject: Subject,
    views: Vec<TrainingView>,
    given: Option<Candidate>,
    settings: &PruneSettings,
    progress: &mut dyn Progress,
) -> Result<Pruned, OfflineError> {
    let count = settings.goal.count(subject.scene.len());
    let compared = count.is_none() || (given.is_none() && settings.score == ScoreChoice::Auto);
    let (scored, held_out) = settings.scoring.split(views, compared);
    // First of all, so that missing images are reported at once.
    let search = if compared {
        let Subject { runtime, background, .. } = &subject;
        Some(ScoreSearch::open(engine, &held_out, runtime, *background, count.is_none(), progress)?)
    } else {
        None
    };
    let found = match given {
        Some(candidate) => vec![candidate],
        None => candidates(settings.score, &settings.scoring.scores(engine, &subject, &scored, progress)?)?,
    };
    let Subject { scene, runtime, .. } = subject;
    match search {
        Some(search) => {
            let whole = GaussianScene::from(runtime);
            let SearchOutcome { candidate, best, outcomes } =
                search.best(engine, &whole, found, settings.goal, progress)?;
            let scene = select(&scene, &highest(&candidate.scores, best.kept));
            Ok(Pruned { scene, outcome: best, search: Some(search.summary(outcomes)) })
        }
        None => {
            let candidate = found.into_iter().next().ok_or(OfflineError::NoScore)?;
            let count = count.unwrap_or(scene.len());
            Ok(Pruned::unchecked(&scene, candidate, count))
        }
    }
}
