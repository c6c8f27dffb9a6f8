//! The stages score and prune of a bake.
//!
//! In: a checkpoint and its training views, some of them held out from scoring. Out: the Gaussians to keep
//! ([`Pruning`]), the score that selected them, and the PSNR on the held-out views for every count tried. If the
//! remaining Gaussians are trained, a score and a loss are judged after a short training.

use super::stages::Stages;
use super::{Bake, BakeSettings, Fingerprint, Stage};
use crate::offline::dataset::TrainingView;
use crate::offline::prune::highest;
use crate::offline::quality::Trial;
use crate::offline::report::Tried;
use crate::offline::search::{Candidate, Goal, ScoreSearch, candidates};
use crate::offline::work::{bytes, words};
use crate::offline::{OfflineError, Progress};
use crate::scene::{GaussianScene, SceneForm};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Shares of the Gaussians whose removal is measured for the report, whatever the goal.
const SWEEP: [f64; 4] = [0.2, 0.5, 0.7, 0.85];

/// The Gaussians to keep.
pub(super) struct Pruning {
    /// Their indices, ascending.
    pub kept: Vec<u32>,
    /// The score of every Gaussian.
    pub scores: Vec<f32>,
    /// How they were selected.
    pub found: Found,
    /// Fingerprint of everything that the result depends on, but for how many packages were too large.
    pub fingerprint: Fingerprint,
    /// Packages made before with more Gaussians, which were too large.
    pub bakes: usize,
    /// Bytes of the smallest of them; the largest number if there is none.
    pub smallest: u64,
}

/// How the Gaussians to keep were selected.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Found {
    /// Name of the score.
    pub score: String,
    /// How many views were held out, and what they were compared with.
    pub held_out: String,
    /// The counts tried.
    pub tried: Vec<Tried>,
}

impl Bake<'_> {
    /// Scores and prunes.
    pub(super) fn prune(&mut self, stages: &mut Stages<'_>) -> Result<Pruning, OfflineError> {
        const FILES: [&str; 2] = ["kept.u32", "found.ron"];
        let goal = self.settings.goal;
        let (scored, held_out) = self.settings.scoring.split(self.views.clone(), true);
        require_images(goal, &held_out)?;
        let (candidates, scores) = self.score(stages, &scored)?;
        let images: Vec<&Path> = held_out.iter().map(|view| view.image.as_path()).collect();
        let images = Fingerprint::of_files(&images).ok();
        let BakeSettings { fine_tune, quality, key_frames, .. } = self.settings;
        let fingerprint =
            scores.and(&format!("{goal:?} {images:?} {held_out:?} {fine_tune:?} {quality:?} {key_frames:?}"));
        let load = |file| self.work.load(file, fingerprint);
        let kept = load(FILES[0]).map(|bytes| words(&bytes));
        let kept = kept.filter(|kept| kept.iter().all(|&index| (index as usize) < self.subject.scene.len()));
        let found = load(FILES[1]).and_then(|text| ron::de::from_bytes::<Found>(&text).ok());
        let (kept, found) = stages.run(Stage::Prune, kept.zip(found), |progress| {
            let (kept, found) = self.find(&scored, &held_out, candidates.clone(), progress)?;
            let text = ron::to_string(&found)?;
            self.work.store(FILES[0], fingerprint, &bytes(&kept), progress)?;
            self.work.store(FILES[1], fingerprint, text.as_bytes(), progress)?;
            Ok((kept, found))
        })?;
        let scores = candidates.into_iter().find(|candidate| candidate.name == found.score);
        let scores = scores.ok_or(OfflineError::NoScore)?.scores;
        Ok(Pruning { kept, scores, found, fingerprint, bakes: 0, smallest: u64::MAX })
    }

    /// Returns the scores of every candidate, computed or loaded from an earlier bake.
    fn score(
        &mut self,
        stages: &mut Stages<'_>,
        views: &[TrainingView],
    ) -> Result<(Vec<Candidate>, Fingerprint), OfflineError> {
        let Self { settings, engine, subject, work, fingerprint, .. } = self;
        let has_volume = matches!(subject.scene.form, SceneForm::Trained(_));
        let variants = settings.score.variants(has_volume);
        let fingerprint = fingerprint.and(&format!("{:?} {variants:?} {views:?}", settings.scoring));
        let file = |name: &str| format!("score-{name}.f32");
        let stored: Option<Vec<Candidate>> = variants
            .iter()
            .map(|variant| {
                let words = words(&work.load(&file(variant.name()), fingerprint)?);
                let scores: Vec<f32> = words.into_iter().map(f32::from_bits).collect();
                (scores.len() == subject.scene.len()).then(|| Candidate { name: variant.name().to_owned(), scores })
            })
            .collect();
        let found = stages.run(Stage::Score, stored, |progress| {
            let scores = settings.scoring.scores(engine, subject, views, progress)?;
            let found = candidates(settings.score, &scores)?;
            for candidate in &found {
                let words: Vec<u32> = candidate.scores.iter().map(|score| score.to_bits()).collect();
                work.store(&file(&candidate.name), fingerprint, &bytes(&words), progress)?;
            }
            Ok(found)
        })?;
        Ok((found, fingerprint))
    }

    /// Prunes by each candidate, selects the best one, and measures the shares of [`SWEEP`] with it.
    fn find(
        &mut self,
        scored: &[TrainingView],
        held_out: &[TrainingView],
        candidates: Vec<Candidate>,
        progress: &mut dyn Progress,
    ) -> Result<(Vec<u32>, Found), OfflineError> {
        let goal = match (self.settings.goal, candidates.first()) {
            (Goal::Size(bytes), Some(first)) => Goal::Keep(self.count_of_size(bytes, &first.scores, progress)?),
            (goal, _) => goal,
        };
        let (engine, runtime) = (&mut *self.engine, &self.subject.runtime);
        let by_loss = matches!(goal, Goal::MaxLoss(_));
        let search = ScoreSearch::open(engine, held_out, runtime, self.subject.background, by_loss, progress)?;
        let whole = GaussianScene::from(runtime.clone());
        let total = whole.len();
        let found = search.best(engine, &whole, candidates.clone(), goal, progress)?;
        let (mut candidate, mut kept, mut outcomes) = (found.candidate, found.best.kept, found.outcomes);
        for ratio in SWEEP {
            let more = search.best(engine, &whole, vec![candidate], Goal::Remove(ratio), progress)?;
            candidate = more.candidate;
            outcomes.extend(more.outcomes);
        }
        let summary = search.summary(outcomes);
        let mut tried = Vec::new();
        let mut add = |score: &str, count: usize, psnr: f64| {
            if psnr.is_finite() {
                let ratio = 1.0 - count as f64 / total.max(1) as f64;
                tried.push(Tried { variant: score.to_owned(), ratio, kept: count, psnr });
            }
        };
        if let Some(psnr) = summary.psnr_before {
            add(&candidate.name, total, psnr);
        }
        for outcome in &summary.candidates {
            for trial in &outcome.trials {
                add(&outcome.score, trial.count, trial.psnr);
            }
        }
        if let Some(trials) = self.trials(scored, held_out, &candidates, goal, progress)? {
            let chosen = self.choose(&trials, &search, candidates, goal, (candidate, kept), progress)?;
            for (score, Trial { count, psnr }) in chosen.tried {
                add(&format!("{score}, {} steps", trials.steps()), count, psnr);
            }
            (candidate, kept) = (chosen.candidate, chosen.kept);
        }
        let held_out = format!("{}, {}", summary.views, summary.compared_with);
        Ok((highest(&candidate.scores, kept), Found { score: candidate.name, held_out, tried }))
    }
}

/// Checks before the scoring that the images of the held-out views exist, which measuring a loss needs.
fn require_images(goal: Goal, held_out: &[TrainingView]) -> Result<(), OfflineError> {
    let missing = held_out.iter().find(|view| !view.image.is_file());
    match (goal, missing) {
        (Goal::MaxLoss(_), Some(view)) => Err(OfflineError::at(
            &view.image,
            "is missing: a loss is told by the images of training views; put them beside the camera file, or give --ratio \
             or --keep",
        )),
        _ => Ok(()),
    }
}
