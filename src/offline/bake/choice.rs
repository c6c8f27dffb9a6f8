//! The stages score and prune of a bake: which Gaussians to keep.
//!
//! In: a checkpoint, the views to train on, the validation views. Out: the scores of all Gaussians ([`ScoreTable`]); the score and the count
//! that serve the goal best on the validation views, and every count tried ([`Choice`]). Where the remaining Gaussians are trained, scores and
//! losses are judged after a short training: the best choice before training is not the best after it.

use super::Bake;
use super::tuning::short;
use crate::offline::engine::Engine;
use crate::offline::quality::Trial;
use crate::offline::report::Tried;
use crate::offline::search::{Candidate, Goal, ScoreChoice, ScoreSearch, candidates};
use crate::offline::store::Key;
use crate::offline::stored::{Stored, Text};
use crate::offline::trained_search::TrainedSearch;
use crate::offline::{OfflineError, Progress};
use crate::scene::GaussianScene;
use serde::{Deserialize, Serialize};

/// Fractions of the Gaussians whose removal is measured for the report, whatever the goal.
const SWEEP: [f64; 4] = [0.2, 0.5, 0.7, 0.85];

/// The scores of every candidate.
pub(super) struct ScoreTable(Vec<Candidate>);

impl ScoreTable {
    /// Returns whether the scores are of this many Gaussians.
    pub fn are_of(&self, count: usize) -> bool {
        self.0.iter().all(|candidate| candidate.scores.len() == count)
    }

    /// Returns the score of this name.
    pub fn of(&self, name: &str) -> Option<&[f32]> {
        self.0.iter().find(|candidate| candidate.name == name).map(|candidate| &candidate.scores[..])
    }
}

impl Stored for ScoreTable {
    fn encode(&self) -> Result<Vec<u8>, OfflineError> {
        let names: Vec<String> = self.0.iter().map(|candidate| candidate.name.clone()).collect();
        let values: Vec<f32> = self.0.iter().flat_map(|candidate| candidate.scores.iter().copied()).collect();
        (Text(names), values).encode()
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (Text(names), values): (Text<Vec<String>>, Vec<f32>) = Stored::decode(bytes)?;
        let count = values.len().checked_div(names.len()).filter(|count| count * names.len() == values.len())?;
        let scores = |index: usize| values[index * count..][..count].to_vec();
        let candidate = |(index, name)| Candidate { name, scores: scores(index) };
        Some(Self(names.into_iter().enumerate().map(candidate).collect()))
    }
}

/// The score and the count to prune by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Choice {
    /// Name of the score.
    pub score: String,
    /// Number of Gaussians to keep.
    pub kept: usize,
    /// How many validation views were compared, and with what.
    pub compared_with: String,
    /// The counts tried.
    pub tried: Vec<Tried>,
}

impl Bake<'_> {
    /// Checks before the scoring that the images of the validation views are there, which measuring a loss needs.
    ///
    /// # Errors
    /// There are no validation views, or an image is missing.
    pub(super) fn require_validation(&self) -> Result<(), OfflineError> {
        let Goal::MaxLoss(_) = self.settings.goal else { return Ok(()) };
        if self.splits.validation.is_empty() {
            return Err(OfflineError::NoValidation { what: "the loss allowed" });
        }
        match self.splits.validation.iter().find(|view| !view.image.is_file()) {
            Some(view) => Err(OfflineError::at(
                &view.image,
                "is missing: a loss is measured on the images of the validation views; put them beside the camera file, \
                 or give --ratio or --keep",
            )),
            None => Ok(()),
        }
    }

    /// Returns the key of everything that scores depend on.
    pub(super) fn score_key(&self) -> Key {
        let settings = self.settings;
        let engine = matches!(self.engine, Engine::Gpu(_));
        let options = format!("{:?} {:?} {engine}", settings.scoring, settings.score);
        self.scene_key.with(self.cameras_key).and(&options)
    }

    /// Scores the Gaussians by the views to train on.
    pub(super) fn score(&mut self, progress: &mut dyn Progress) -> Result<ScoreTable, OfflineError> {
        let Self { settings, engine, subject, splits, .. } = self;
        let (scores, _) = settings.scoring.scores(engine, subject, &splits.train, progress)?;
        Ok(ScoreTable(candidates(settings.score, &scores)?))
    }

    /// Returns the key of everything that the choice depends on, given that of the scores.
    pub(super) fn choice_key(&self, scores: Key) -> Key {
        let settings = self.settings;
        let options =
            format!("{:?} {:?} {:?} {:?}", settings.goal, self.tunes(), settings.quality, settings.key_frames);
        scores.with(self.images_key).and(&options)
    }

    /// Prunes by each candidate, chooses the best one, and measures the fractions of [`SWEEP`] with it.
    pub(super) fn choose(
        &mut self,
        table: &ScoreTable,
        progress: &mut dyn Progress,
    ) -> Result<Text<Choice>, OfflineError> {
        let ScoreTable(candidates) = table;
        let goal = match (self.settings.goal, candidates.first()) {
            (Goal::Size(bytes), Some(first)) => Goal::Keep(self.count_of_size(bytes, &first.scores, progress)?),
            (goal, _) => goal,
        };
        let total = self.subject.scene.len();
        if let (Some(kept), ScoreChoice::One(variant), true) =
            (goal.count(total), self.settings.score, self.splits.validation.is_empty())
        {
            let (score, compared_with) = (variant.name().to_owned(), "none".to_owned());
            return Ok(Text(Choice { score, kept, compared_with, tried: Vec::new() }));
        }
        let by_loss = matches!(goal, Goal::MaxLoss(_));
        let Self { engine, subject, splits, .. } = self;
        let search =
            ScoreSearch::open(engine, &splits.validation, &subject.runtime, subject.background, by_loss, progress)?;
        let whole = GaussianScene::from(subject.runtime.clone());
        let found = search.best(engine, &whole, candidates.clone(), goal, progress)?;
        let (mut best, mut kept, mut outcomes) = (found.candidate, found.best.kept, found.outcomes);
        for ratio in SWEEP {
            let more = search.best(engine, &whole, vec![best], Goal::Remove(ratio), progress)?;
            best = more.candidate;
            outcomes.extend(more.outcomes);
        }
        let summary = search.summary(outcomes);
        let mut tried = Vec::new();
        let mut add = |score: &str, count: usize, psnr: f64| {
            let ratio = 1.0 - count as f64 / total.max(1) as f64;
            tried.push(Tried { variant: score.to_owned(), ratio, kept: count, psnr });
        };
        if let Some(psnr) = summary.psnr_before {
            add(&best.name, total, psnr);
        }
        for outcome in &summary.candidates {
            for trial in &outcome.trials {
                add(&outcome.score, trial.count, trial.psnr);
            }
        }
        let depends_on_training = candidates.len() > 1 || by_loss;
        if let Some(settings) = self.tunes().filter(|_| depends_on_training).map(short) {
            let images = self.images(progress)?;
            let (engine, whole) = (&mut *self.engine, &self.subject.scene);
            let mut trials = TrainedSearch { engine, images: &images, settings: &settings, whole, search: &search };
            let chosen = trials.best(candidates, goal, (best, kept), progress)?;
            for (score, Trial { count, psnr }) in chosen.tried {
                add(&format!("{score}, {} steps", settings.steps), count, psnr);
            }
            (best, kept) = (chosen.candidate, chosen.kept);
        }
        let compared_with = format!("{}, {}", summary.views, summary.compared_with);
        Ok(Text(Choice { score: best.name, kept, compared_with, tried }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_read_as_they_were_written() {
        let candidate = |name: &str, scores: &[f32]| Candidate { name: name.to_owned(), scores: scores.to_vec() };
        let table = ScoreTable(vec![candidate("energy", &[1.0, 2.0]), candidate("full", &[0.5, 0.0])]);
        let read = ScoreTable::decode(&table.encode().expect("it can be stored")).expect("the same bytes");
        assert_eq!(read.0, table.0, "names and values");
        assert_eq!(read.of("full"), Some(&[0.5, 0.0][..]), "a score by its name");
        assert_eq!(read.of("removal"), None, "a score that was not computed");
    }
}
