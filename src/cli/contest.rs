//! Which of several scores to prune by, and to how many Gaussians: found out on held-out training views.
//!
//! In: scores, a goal ([`Goal`]), views that were not scored. Out: the best of them ([`Outcome`]) with every trial.

use super::engine::Engine;
use super::failure::Failure;
use super::report::{Table, note, progress};
use super::training::Choice;
use crate::offline::dataset::{DatasetError, TrainingView};
use crate::offline::quality::{Evaluator, LossError, Trial, smallest_count};
use crate::offline::score::variant::Variant;
use crate::offline::score::{ScoreError, Scores};
use crate::scene::{GaussianScene, RuntimeScene};
use crate::view::Background;
use serde_json::{Value, json};

/// A score that may be pruned by.
pub struct Candidate {
    /// Its name.
    pub name: String,
    /// The score of each Gaussian.
    pub scores: Vec<f32>,
}

/// How many Gaussians to keep.
#[derive(Clone, Copy)]
pub enum Goal {
    /// This many.
    Keep(usize),
    /// As few as cost no more than this, dB.
    MaxLoss(f64),
}

/// What pruning by one candidate gives.
pub struct Outcome {
    /// The candidate.
    pub candidate: Candidate,
    /// Gaussians kept.
    pub kept: usize,
    /// PSNR on the held-out views, dB, if it was looked at.
    pub psnr: Option<f64>,
    /// Every count tried.
    pub trials: Vec<Trial>,
}

/// The held-out views, and what the whole scene shows there.
pub struct ScoreSearch {
    judge: Evaluator,
    /// PSNR of the whole scene; nothing where it is compared with itself.
    baseline: Option<f64>,
}

/// The scores that a choice stands for. `auto` leaves out what this scene does not tell.
///
/// # Errors
/// One score was asked for, and the scene does not tell it.
pub fn candidates(choice: Choice, scores: &Scores) -> Result<Vec<Candidate>, ScoreError> {
    let told: Vec<Variant> = scores.variants().collect();
    let variants: Vec<Variant> = match choice {
        Choice::Auto => Variant::AUTO.into_iter().filter(|variant| told.contains(variant)).collect(),
        Choice::All => told,
        Choice::One(variant) => vec![variant],
    };
    let named = |variant: Variant, scores| Candidate { name: variant.name().to_owned(), scores };
    variants.into_iter().map(|variant| scores.of(variant).map(|scores| named(variant, scores))).collect()
}

impl ScoreSearch {
    /// Loads the images of the held-out views. Without images, results are compared with the whole scene, unless images are `required`.
    ///
    /// # Errors
    /// Images that are required and missing, or cannot be used.
    pub fn open(
        engine: &mut Engine,
        held_out: &[TrainingView],
        scene: &RuntimeScene,
        background: Background,
        required: bool,
    ) -> Result<Self, Failure> {
        match Evaluator::by_images(held_out, &scene.trained_with, background) {
            Ok(judge) => {
                let baseline = Some(judge.psnr(engine, scene)?);
                Ok(Self { judge, baseline })
            }
            Err(LossError::Dataset(error @ DatasetError::MissingImages { .. })) if !required => {
                note(&format!("note: {error}. Compared with what the whole scene shows instead"));
                Ok(Self { judge: Evaluator::by_scene(held_out, scene, background, engine)?, baseline: None })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Prunes by each candidate and keeps the best: the highest PSNR at a count, or the smallest count within a loss. `scene` is in the
    /// runtime form.
    ///
    /// # Errors
    /// The engine's.
    pub fn best(
        &self,
        engine: &mut Engine,
        scene: &GaussianScene,
        candidates: Vec<Candidate>,
        goal: Goal,
    ) -> Result<(Outcome, Vec<Value>), Failure> {
        let bar = progress(candidates.len(), "comparing scores");
        let mut outcomes = Vec::with_capacity(candidates.len());
        for candidate in candidates {
            outcomes.push(self.try_one(engine, scene, candidate, goal)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let rows = outcomes.iter().map(Outcome::json).collect();
        let psnr = |outcome: &Outcome| outcome.psnr.unwrap_or(f64::NEG_INFINITY);
        let better = |a: &Outcome, b: &Outcome| match goal {
            Goal::Keep(_) => psnr(b).total_cmp(&psnr(a)),
            Goal::MaxLoss(_) => a.kept.cmp(&b.kept).then(psnr(b).total_cmp(&psnr(a))),
        };
        let best = outcomes.into_iter().min_by(better);
        Ok((best.ok_or_else(|| Failure::new("there is no score to prune by"))?, rows))
    }

    fn try_one(
        &self,
        engine: &mut Engine,
        scene: &GaussianScene,
        candidate: Candidate,
        goal: Goal,
    ) -> Result<Outcome, LossError> {
        let mut psnr = |count: usize| self.judge.psnr_of_highest(engine, scene, &candidate.scores, count);
        let (kept, trials) = match (goal, self.baseline) {
            (Goal::Keep(count), _) => (count, vec![Trial { count, psnr: psnr(count)? }]),
            (Goal::MaxLoss(loss), Some(baseline)) => smallest_count(scene.len(), baseline - loss, psnr)?,
            (Goal::MaxLoss(_), None) => (scene.len(), Vec::new()),
        };
        let at_kept = trials.iter().find(|trial| trial.count == kept).map(|trial| trial.psnr);
        Ok(Outcome { candidate, kept, psnr: at_kept.or(self.baseline), trials })
    }

    /// For people: one row for each outcome.
    pub fn table(&self, rows: &[Value]) -> String {
        let mut table = Table::new(&["score", "kept", "PSNR", "loss"]);
        for row in rows {
            let psnr = row["psnr"].as_f64();
            let decibels = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
            let loss = psnr.zip(self.baseline).map(|(psnr, baseline)| baseline - psnr);
            let name = row["score"].as_str().unwrap_or_default().to_owned();
            table.row([name, row["kept"].to_string(), decibels(psnr), decibels(loss)]);
        }
        format!("{table}dB on {} held-out training views, {}\n", self.judge.views(), self.reference())
    }

    /// For programs.
    pub fn json(&self, rows: Vec<Value>) -> Value {
        json!({
            "views": self.judge.views(),
            "compared_with": self.reference(),
            "psnr_before": self.baseline,
            "candidates": rows,
        })
    }

    fn reference(&self) -> &'static str {
        if self.baseline.is_some() { "against their images" } else { "against the whole scene" }
    }
}

impl Outcome {
    fn json(&self) -> Value {
        json!({ "score": self.candidate.name, "kept": self.kept, "psnr": self.psnr, "trials": self.trials })
    }
}
