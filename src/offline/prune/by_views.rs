//! Pruning a scene by its training views: scoring, the search for the best score, and the pruned scene.
//!
//! In: a scene, the views of its dataset, a [`Goal`]. Out: the scene with the Gaussians of the highest scores
//! ([`Pruned`]).

use super::PruneError;
use super::search::{Candidate, Goal, Outcome, ScoreChoice, ScoreSearch, SearchOutcome, SearchSummary, candidates};
use super::select::{highest, select};
use crate::offline::dataset::splits::Splits;
use crate::offline::engine::Engine;
use crate::offline::forms::Subject;
use crate::offline::measure::belonging::require_belonging;
use crate::offline::score::ScoringSettings;
use crate::offline::work::Progress;
use crate::scene::GaussianScene;

/// Settings of pruning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PruneSettings {
    /// How many Gaussians to keep.
    pub goal: Goal,
    /// Which score to prune by.
    pub score: ScoreChoice,
    /// Settings of the scoring.
    pub scoring: ScoringSettings,
    /// Whether images are compared without a check that they show the scene.
    pub trust_images: bool,
}

/// A pruned scene, and how its Gaussians were selected.
#[derive(Debug, Clone, PartialEq)]
pub struct Pruned {
    /// The remaining Gaussians, in their original order.
    pub scene: GaussianScene,
    /// The score, the number of Gaussians kept, and the PSNR if it was measured.
    pub outcome: Outcome,
    /// The outcome of every score; `None` if no pictures were compared.
    pub search: Option<SearchSummary>,
}

impl Pruned {
    /// Returns the scene with the `count` Gaussians of the highest scores, without measuring the loss.
    pub fn unchecked(scene: &GaussianScene, candidate: Candidate, count: usize) -> Self {
        let outcome = Outcome { score: candidate.name, kept: count, psnr: None, trials: Vec::new() };
        Self { scene: select(scene, &highest(&candidate.scores, count)), outcome, search: None }
    }
}

/// Prunes by the scores in `given` or, if it is `None`, by those that the settings select. Results are compared on the
/// validation views if the goal is a loss, or if the best of several scores is searched for; scores then
/// come from the other training views. Otherwise, scores come from all training views.
///
/// # Errors
/// The goal is a loss and images of validation views are missing or show another scene; views in which no Gaussian of
/// the scene is visible; no validation views for a comparison; the goal is a size, whose number of Gaussians a bake
/// finds by compressing them ([`Goal::Size`]); a failure of the engine.
pub fn prune_by_views(
    engine: &mut Engine,
    subject: Subject,
    splits: &Splits,
    given: Option<Candidate>,
    settings: &PruneSettings,
    progress: &mut dyn Progress,
) -> Result<Pruned, PruneError> {
    if matches!(settings.goal, Goal::Size(_)) {
        return Err(PruneError::SizeOfFile);
    }
    let count = settings.goal.count(subject.scene.len());
    let compared = count.is_none() || (given.is_none() && !matches!(settings.score, ScoreChoice::One(_)));
    let Subject { runtime, background, .. } = &subject;
    // Before scoring, so that missing images are reported at once.
    let search = if compared {
        if !settings.trust_images {
            require_belonging(engine, runtime, &splits.validation, *background)?;
        }
        Some(ScoreSearch::open(engine, &splits.validation, runtime, *background, count.is_none(), progress)?)
    } else {
        None
    };
    let found = match (given, compared) {
        (Some(candidate), _) => vec![candidate],
        (None, compared) => {
            let all = if compared { None } else { Some(splits.all_training(&runtime.trained_with, progress)?) };
            let views = all.as_ref().unwrap_or(&splits.train);
            candidates(settings.score, &settings.scoring.scores(engine, &subject, views, progress)?)?
        }
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
            let candidate = found.into_iter().next().ok_or(PruneError::NoScore)?;
            let count = count.unwrap_or(scene.len());
            Ok(Pruned::unchecked(&scene, candidate, count))
        }
    }
}
