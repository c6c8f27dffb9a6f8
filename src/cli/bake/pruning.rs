//! The stages score and prune of a bake.
//!
//! In: a checkpoint and its training views, some of them held out from scoring. Out: which Gaussians stay ([`Pruning`]), by which
//! score, and what every count that was tried gives on the held-out views.

use super::steps::Steps;
use super::{Bake, Inputs, bytes, words};
use crate::cli::contest::{Candidate, Goal, ScoreSearch, candidates};
use crate::cli::failure::Failure;
use crate::cli::interrupt;
use crate::cli::training::Choice;
use crate::offline::bake::{Fingerprint, Stage};
use crate::offline::dataset::TrainingView;
use crate::offline::prune::{highest, kept_count};
use crate::offline::report::Tried;
use crate::offline::score::variant::Variant;
use crate::scene::{Form, GaussianScene};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Loss allowed unless said otherwise, dB.
pub const MAX_LOSS: f64 = 0.1;
/// Shares removed that are tried for the report, whatever the goal.
const SWEEP: [f64; 4] = [0.2, 0.5, 0.7, 0.85];

/// Which Gaussians stay.
pub struct Pruning {
    /// Their indices, ascending.
    pub kept: Vec<u32>,
    /// How they were found.
    pub found: Found,
    /// Of everything so far.
    pub fingerprint: Fingerprint,
}

/// How the Gaussians that stay were found.
#[derive(Serialize, Deserialize)]
pub struct Found {
    /// The score.
    pub variant: String,
    /// What it was compared on.
    pub judged: String,
    /// The counts tried.
    pub tried: Vec<Tried>,
}

impl Bake {
    /// Scores and prunes.
    pub(super) fn prune(&self, steps: &mut Steps, inputs: &mut Inputs) -> Result<Pruning, Failure> {
        const FILES: [&str; 2] = ["kept.u32", "found.ron"];
        let goal = self.goal(inputs.scene.len());
        let (scored, held_out) = self.scoring.share(inputs.views.clone(), true);
        require_images(goal, &held_out)?;
        let (candidates, scores) = self.score(steps, inputs, &scored)?;
        let images: Vec<&Path> = held_out.iter().map(|view| view.image.as_path()).collect();
        let images = Fingerprint::of_files(&images).ok();
        let goals = format!("{:?} {:?} {:?}", self.ratio, self.keep, self.max_loss);
        let fingerprint = scores.and(&format!("{goals} {images:?} {held_out:?}"));
        let load = |file| inputs.work.load(file, fingerprint);
        let kept = load(FILES[0]).map(|bytes| words(&bytes));
        let kept = kept.filter(|kept| kept.iter().all(|&index| (index as usize) < inputs.scene.len()));
        let found = load(FILES[1]).and_then(|text| ron::de::from_bytes::<Found>(&text).ok());
        let (kept, found) = steps.run(Stage::Prune, kept.zip(found), || {
            let (kept, found) = find(inputs, &held_out, candidates, goal)?;
            let text = ron::to_string(&found)?;
            interrupt::whole(|| inputs.work.store(FILES[0], fingerprint, &bytes(&kept)))?;
            interrupt::whole(|| inputs.work.store(FILES[1], fingerprint, text.as_bytes()))?;
            Ok((kept, found))
        })?;
        Ok(Pruning { kept, found, fingerprint })
    }

    /// How many of `count` Gaussians to keep.
    fn goal(&self, count: usize) -> Goal {
        match (self.keep, self.ratio, self.max_loss) {
            (Some(keep), ..) => Goal::Keep(keep.min(count)),
            (_, Some(ratio), _) => Goal::Keep(kept_count(count, ratio)),
            (.., loss) => Goal::MaxLoss(loss.unwrap_or(MAX_LOSS)),
        }
    }

    /// Every score that may be pruned by.
    fn score(
        &self,
        steps: &mut Steps,
        inputs: &mut Inputs,
        views: &[TrainingView],
    ) -> Result<(Vec<Candidate>, Fingerprint), Failure> {
        let Inputs { scene, runtime, background, engine, work, fingerprint, .. } = inputs;
        let volume = matches!(scene.form, Form::Trained(_));
        let variants: Vec<Variant> = match self.variant {
            Choice::Auto => Variant::AUTO.into_iter().filter(|variant| volume || !variant.needs_volume()).collect(),
            Choice::All => Variant::ALL.into_iter().filter(|variant| volume || !variant.needs_volume()).collect(),
            Choice::One(variant) => vec![variant],
        };
        let fingerprint = fingerprint.and(&format!("{:?} {variants:?} {views:?}", self.scoring));
        let file = |name: &str| format!("score-{name}.f32");
        let load = |variant: &Variant| {
            let words = words(&work.load(&file(variant.name()), fingerprint)?);
            let scores: Vec<f32> = words.into_iter().map(f32::from_bits).collect();
            (scores.len() == scene.len()).then(|| Candidate { name: variant.name().to_owned(), scores })
        };
        let stored: Option<Vec<Candidate>> = variants.iter().map(load).collect();
        let found = steps.run(Stage::Score, stored, || {
            let scores = self.scoring.scores(engine, scene, runtime, *background, views)?;
            let found = candidates(self.variant, &scores)?;
            for candidate in &found {
                let words: Vec<u32> = candidate.scores.iter().map(|score| score.to_bits()).collect();
                interrupt::whole(|| work.store(&file(&candidate.name), fingerprint, &bytes(&words)))?;
            }
            Ok(found)
        })?;
        Ok((found, fingerprint))
    }
}

/// A loss can be told from images alone: says so before anything is scored.
fn require_images(goal: Goal, held_out: &[TrainingView]) -> Result<(), Failure> {
    let missing = held_out.iter().find(|view| !view.image.is_file());
    match (goal, missing) {
        (Goal::MaxLoss(_), Some(view)) => Err(Failure::about(
            &view.image,
            "is missing: a loss is told by the images of training views; put them beside the camera file, or give --ratio or --keep",
        )),
        _ => Ok(()),
    }
}

/// Prunes by each candidate, keeps the best, and tries a few more counts with it.
fn find(
    inputs: &mut Inputs,
    held_out: &[TrainingView],
    candidates: Vec<Candidate>,
    goal: Goal,
) -> Result<(Vec<u32>, Found), Failure> {
    let Inputs { runtime, background, engine, .. } = inputs;
    let contest = ScoreSearch::open(engine, held_out, runtime, *background, matches!(goal, Goal::MaxLoss(_)))?;
    let whole = GaussianScene::from(runtime.clone());
    let total = whole.len();
    let (outcome, mut rows) = contest.best(engine, &whole, candidates, goal)?;
    let mut candidate = outcome.candidate;
    for ratio in SWEEP {
        let count = kept_count(total, ratio);
        let (outcome, more) = contest.best(engine, &whole, vec![candidate], Goal::Keep(count))?;
        candidate = outcome.candidate;
        rows.extend(more);
    }
    let all = contest.json(rows);
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let judged = format!("{}, {}", all["views"], text(&all["compared_with"]));
    let mut tried = Vec::new();
    let mut add = |variant: &str, count: &Value, psnr: &Value| {
        if let (Some(count), Some(psnr)) = (count.as_u64(), psnr.as_f64()) {
            let ratio = 1.0 - count as f64 / total.max(1) as f64;
            tried.push(Tried { variant: variant.to_owned(), ratio, kept: count as usize, psnr });
        }
    };
    add(&candidate.name, &Value::from(total), &all["psnr_before"]);
    for row in all["candidates"].as_array().into_iter().flatten() {
        for trial in row["trials"].as_array().into_iter().flatten() {
            add(&text(&row["score"]), &trial["count"], &trial["psnr"]);
        }
    }
    Ok((highest(&candidate.scores, outcome.kept), Found { variant: candidate.name, judged, tried }))
}
