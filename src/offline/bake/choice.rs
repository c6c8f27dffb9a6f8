//! The stages score and prune of a bake: which Gaussians to keep.
//!
//! In: a checkpoint, the views to train on, the validation views. Out: the scores of all Gaussians ([`Candidate`]); the
//! score and the count that are best for the goal on the validation views, and every count tried ([`Choice`]). If the
//! remaining Gaussians are trained, scores and losses are compared after a short training: the best choice before
//! training is not the best choice after training.

use super::BakeError;
use super::inputs::Inputs;
use super::job::{Scoring, shard_name};
use super::merged_scores::merged_scores;
use super::settings::BakeSettings;
use super::size::count_of_size;
use super::trained_search::TrainedSearch;
use super::tuning::short;
use crate::offline::engine::Engine;
use crate::offline::prune::Trial;
use crate::offline::prune::search::{Candidate, Goal, ScoreChoice, ScoreSearch, SearchSummary, candidates};
use crate::offline::report::Tried;
use crate::offline::score::Scores;
use crate::offline::store::results::Key;
use crate::offline::store::stages::Stages;
use crate::offline::store::stored::Text;
use crate::offline::work::Progress;
use crate::scene::GaussianScene;
use serde::{Deserialize, Serialize};

/// Fractions of the Gaussians whose removal is measured for the report, independent of the goal.
const SWEEP: [f64; 4] = [0.2, 0.5, 0.7, 0.85];

/// The score and the count to prune by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Choice {
    /// Name of the score.
    pub score: String,
    /// Number of Gaussians to keep.
    pub kept: usize,
    /// The number of compared validation views, and the pictures they were compared with.
    pub compared_with: String,
    /// The counts tried.
    pub tried: Vec<Tried>,
}

/// The stage score: scores the Gaussians by the views to train on. `None` if that was one shard alone.
pub(super) fn score(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scoring: Scoring,
) -> Result<Option<(Vec<Candidate>, Key)>, BakeError> {
    let (settings, count) = (inputs.settings, inputs.subject.scene.len());
    let engine = matches!(inputs.engine, Engine::Gpu(_));
    let options = format!("{:?} {:?} {engine}", settings.scoring, settings.score);
    let key = inputs.scene_key.with(inputs.cameras_key).and(&options);
    let are_whole = |candidates: &Vec<Candidate>| candidates.iter().all(|one| one.scores.len() == count);
    if let Scoring::Shard(shard) = scoring {
        stages.run_part(
            SCORE,
            &shard_name(shard),
            key,
            |scores: &Scores| scores.len() == count,
            |progress| {
                let Inputs { engine, subject, splits, .. } = inputs;
                settings.scoring.of_shard(engine, subject, &splits.train, shard, progress)
            },
        )?;
        return Ok(None);
    }
    let scored = stages.run(SCORE, key, are_whole, |progress| {
        let scores = match scoring {
            Scoring::Merge(shards) => merged_scores(&inputs.store, count, shards, key)?,
            Scoring::Whole | Scoring::Shard(_) => {
                let Inputs { engine, subject, splits, .. } = inputs;
                settings.scoring.scores(engine, subject, &splits.train, progress)?
            }
        };
        Ok(candidates(settings.score, &scores)?)
    });
    scored.map(Some)
}

/// Name of the stage.
const SCORE: &str = "score";

/// The stage prune: chooses the score and the count, given the key of the scores. Returns the key of the Gaussians that
/// are kept.
pub(super) fn choose(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scores: &[Candidate],
    scores_key: Key,
) -> Result<(Choice, Key), BakeError> {
    let settings = inputs.settings;
    let BakeSettings { goal, quality, key_frames, order, level, .. } = settings;
    let options = format!("{goal:?} {:?} {quality:?} {key_frames:?} {order:?} {level:?}", inputs.tunes());
    // Equal scores may be those of other inputs.
    let key = scores_key.with(inputs.scene_key).with(inputs.cameras_key).with(inputs.image_keys[1]).and(&options);
    let key = if trains(inputs, scores, settings.goal) { key.with(inputs.image_keys[0]) } else { key };
    let (Text(choice), _) =
        stages.run("prune", key, |_| true, |progress| search(inputs, scores, progress).map(Text))?;
    // Later stages depend on the choice, and not on the counts tried.
    let key = scores_key.and(&format!("{} Gaussians by {}", choice.kept, choice.score));
    Ok((choice, key))
}

/// Returns whether the choice is made by short trainings.
fn trains(inputs: &Inputs<'_>, candidates: &[Candidate], goal: Goal) -> bool {
    inputs.tunes().is_some() && (candidates.len() > 1 || matches!(goal, Goal::MaxLoss(_)))
}

/// Prunes by each candidate, chooses the best one, and measures the fractions of [`SWEEP`] with it.
fn search(inputs: &mut Inputs<'_>, candidates: &[Candidate], progress: &mut dyn Progress) -> Result<Choice, BakeError> {
    let goal = match (inputs.settings.goal, candidates.first()) {
        (Goal::Size(bytes), Some(first)) => Goal::Keep(count_of_size(inputs, bytes, &first.scores, progress)?),
        (goal, _) => goal,
    };
    let total = inputs.subject.scene.len();
    if let (Some(kept), ScoreChoice::One(variant), true) =
        (goal.count(total), inputs.settings.score, inputs.splits.validation.is_empty())
    {
        let (score, compared_with) = (variant.name().to_owned(), "none".to_owned());
        return Ok(Choice { score, kept, compared_with, tried: Vec::new() });
    }
    let by_loss = matches!(goal, Goal::MaxLoss(_));
    let Inputs { engine, subject, splits, .. } = inputs;
    let search =
        ScoreSearch::open(engine, &splits.validation, &subject.runtime, subject.background, by_loss, progress)?;
    let whole = GaussianScene::from(subject.runtime.clone());
    let found = search.best(engine, &whole, candidates.to_vec(), goal, progress)?;
    let (mut best, mut kept, mut outcomes) = (found.candidate, found.best.kept, found.outcomes);
    for ratio in SWEEP {
        let more = search.best(engine, &whole, vec![best], Goal::Remove(ratio), progress)?;
        best = more.candidate;
        outcomes.extend(more.outcomes);
    }
    let summary = search.summary(outcomes);
    let mut tried = tried_in(&summary, &best.name, total);
    if let Some(settings) = inputs.tunes().map(short).filter(|_| trains(inputs, candidates, goal)) {
        let images = inputs.images(progress)?;
        let (engine, whole) = (&mut *inputs.engine, &inputs.subject.scene);
        let mut trials = TrainedSearch { engine, images: &images, settings: &settings, whole, search: &search };
        let chosen = trials.best(candidates, goal, (best, kept), progress)?;
        tried.extend(chosen.tried.into_iter().map(|(score, Trial { count, psnr })| {
            tried_count(format!("{score}, {} steps", settings.steps), count, total, psnr)
        }));
        (best, kept) = (chosen.candidate, chosen.kept);
    }
    let compared_with = format!("{}, {}", summary.views, summary.compared_with);
    Ok(Choice { score: best.name, kept, compared_with, tried })
}

/// Returns the counts that a search has tried, and the whole scene, which all scores keep alike, under the name of the
/// best score.
fn tried_in(summary: &SearchSummary, best: &str, total: usize) -> Vec<Tried> {
    let whole = summary.psnr_before.map(|psnr| tried_count(best.to_owned(), total, total, psnr));
    let trials = summary.candidates.iter().flat_map(|outcome| outcome.trials.iter().map(move |trial| (outcome, trial)));
    let trials = trials.map(|(outcome, trial)| tried_count(outcome.score.clone(), trial.count, total, trial.psnr));
    whole.into_iter().chain(trials).collect()
}

/// Returns a count of `total` Gaussians as the report shows it.
fn tried_count(variant: String, kept: usize, total: usize, psnr: f64) -> Tried {
    Tried { variant, ratio: 1.0 - kept as f64 / total.max(1) as f64, kept, psnr }
}
