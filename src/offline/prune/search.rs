//! The search for the score to prune by and for the number of Gaussians to keep, on validation views.
//!
//! In: scores ([`Candidate`]), a [`Goal`], validation views. Out: the best candidate, and the outcome of each candidate
//! ([`SearchOutcome`]).

use super::select::{highest, kept_count, select};
use super::smallest_count::{Trial, smallest_count};
use super::{PruneError, ValidatedChoice};
use crate::offline::dataset::selection::to_draw;
use crate::offline::dataset::{DatasetError, TrainingView};
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::measure::reference_pictures::ReferencePictures;
use crate::offline::score::{ScoreError, Scores, Variant};
use crate::offline::store::StoreError;
use crate::offline::store::stored::{Stored, Text};
use crate::offline::work::{NoProgress, Progress, proceed};
use crate::scene::{GaussianScene, RuntimeScene};
use crate::view::Background;
use serde::{Serialize, Serializer};
use std::cmp::Ordering;
use std::fmt;

/// The scores to try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScoreChoice {
    /// The best of [`Variant::AUTO`] on the validation views.
    Auto,
    /// The best of all variants that the scene can be scored by.
    All,
    /// This variant alone.
    One(Variant),
}

impl ScoreChoice {
    /// Returns the scores of a choice. Without the volume of the Gaussians, `Auto` and `All` leave out the scores that
    /// need it.
    pub fn variants(self, has_volume: bool) -> Vec<Variant> {
        let known = |variants: &[Variant]| -> Vec<Variant> {
            variants.iter().copied().filter(|variant| has_volume || !variant.needs_volume()).collect()
        };
        match self {
            Self::Auto => known(&Variant::AUTO),
            Self::All => known(&Variant::ALL),
            Self::One(variant) => vec![variant],
        }
    }
}

/// A score to prune by.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Name of the score.
    pub name: String,
    /// The score of each Gaussian.
    pub scores: Vec<f32>,
}

/// The names, then the scores of all candidates one after the other.
impl Stored for Vec<Candidate> {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        let names: Vec<String> = self.iter().map(|candidate| candidate.name.clone()).collect();
        let values: Vec<f32> = self.iter().flat_map(|candidate| candidate.scores.iter().copied()).collect();
        (Text(names), values).encode()
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (Text(names), values): (Text<Vec<String>>, Vec<f32>) = Stored::decode(bytes)?;
        let count = values.len().checked_div(names.len()).filter(|count| count * names.len() == values.len())?;
        let scores = |index: usize| values[index * count..][..count].to_vec();
        Some(names.into_iter().enumerate().map(|(index, name)| Candidate { name, scores: scores(index) }).collect())
    }
}

/// Returns the scores of the candidate of this name; `None` if there is none.
pub fn of_name<'a>(candidates: &'a [Candidate], name: &str) -> Option<&'a [f32]> {
    candidates.iter().find(|candidate| candidate.name == name).map(|candidate| &candidate.scores[..])
}

/// Returns the candidates of a choice.
///
/// # Errors
/// A single score is chosen that needs the volume of the Gaussians, which the scene does not have.
pub fn candidates(choice: ScoreChoice, scores: &Scores) -> Result<Vec<Candidate>, ScoreError> {
    let named = |variant: Variant, scores| Candidate { name: variant.name().to_owned(), scores };
    let candidate = |variant: Variant| scores.of(variant).map(|scores| named(variant, scores));
    choice.variants(scores.has_volume()).into_iter().map(candidate).collect()
}

/// The goal of pruning, which determines the number of Gaussians. Default: `MaxLoss(0.1)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Keep this number of Gaussians.
    Keep(usize),
    /// Remove this fraction of the Gaussians, 0 to 1.
    Remove(f64),
    /// Keep the smallest number of Gaussians whose PSNR on the validation views is at most this much lower, dB.
    MaxLoss(f64),
    /// Keep the largest number of Gaussians that fits into a package of this many bytes.
    Size(u64),
}

impl Default for Goal {
    fn default() -> Self {
        Self::MaxLoss(0.1)
    }
}

impl Goal {
    /// Returns how many of `total` Gaussians to keep; `None` if that depends on a loss or on a package.
    pub fn count(self, total: usize) -> Option<usize> {
        match self {
            Self::Keep(count) => Some(count.min(total)),
            Self::Remove(ratio) => Some(kept_count(total, ratio)),
            Self::MaxLoss(_) | Self::Size(_) => None,
        }
    }

    /// Orders outcomes, the better one first: the higher PSNR at a count, the smaller count within a loss.
    fn compare(self, a: &Outcome, b: &Outcome) -> Ordering {
        let psnr = |outcome: &Outcome| outcome.psnr.unwrap_or(f64::NEG_INFINITY);
        let by_psnr = psnr(b).total_cmp(&psnr(a));
        match self {
            Self::Keep(_) | Self::Remove(_) | Self::Size(_) => by_psnr,
            Self::MaxLoss(_) => a.kept.cmp(&b.kept).then(by_psnr),
        }
    }
}

/// The outcome of pruning by one candidate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Name of the candidate.
    pub score: String,
    /// Gaussians kept.
    pub kept: usize,
    /// PSNR on the validation views, dB; `None` if it was not measured.
    pub psnr: Option<f64>,
    /// Every count tried, in order.
    pub trials: Vec<Trial>,
}

/// The best candidate, and how it was found.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchOutcome {
    /// The best candidate.
    pub candidate: Candidate,
    /// The outcome of pruning by it.
    pub best: Outcome,
    /// The outcomes of all candidates, in their order.
    pub outcomes: Vec<Outcome>,
}

/// The references for pictures of the validation views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ComparedWith {
    /// The images of the dataset.
    Images,
    /// The pictures of the whole scene, if images are missing.
    WholeScene,
}

impl fmt::Display for ComparedWith {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Images => "against their images",
            Self::WholeScene => "against the whole scene",
        })
    }
}

impl Serialize for ComparedWith {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The summary of a search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchSummary {
    /// Number of validation views.
    pub views: usize,
    /// The references of the comparison.
    pub compared_with: ComparedWith,
    /// PSNR of the whole scene, dB; `None` if it is compared with itself.
    pub psnr_before: Option<f64>,
    /// The outcomes of the candidates.
    pub candidates: Vec<Outcome>,
}

/// Returns the error of a search without validation views: for a loss, or for the best score.
pub(crate) fn no_validation(by_loss: bool) -> PruneError {
    PruneError::NoValidation { choice: if by_loss { ValidatedChoice::Loss } else { ValidatedChoice::Score } }
}

/// A search on validation views.
#[derive(Debug)]
pub struct ScoreSearch {
    references: ReferencePictures,
    /// PSNR of the whole scene, dB; `None` if it is compared with itself.
    baseline: Option<f64>,
}

impl ScoreSearch {
    /// Loads the images of the validation views. If images are missing and not `required`, reports a note and compares
    /// with the pictures of the whole scene instead.
    ///
    /// # Errors
    /// No validation views, images that are required and missing, cannot be read, or do not fit the memory; a failure
    /// of the engine.
    pub fn open(
        engine: &mut Engine,
        validation: &[TrainingView],
        scene: &RuntimeScene,
        background: Background,
        required: bool,
        progress: &mut dyn Progress,
    ) -> Result<Self, PruneError> {
        if validation.is_empty() {
            return Err(no_validation(required));
        }
        Pictures::compared(validation).require(engine.headless(), Purpose::Dataset)?;
        match ReferencePictures::of_images(validation, &scene.trained_with, background) {
            Ok(references) => {
                let baseline = Some(references.psnr(engine, scene)?);
                Ok(Self { references, baseline })
            }
            Err(error @ DatasetError::MissingImages { .. }) if !required => {
                progress.note(&format!("note: {error}. Compared with pictures of the whole scene instead"));
                let views = to_draw(validation, scene.trained_with.optics());
                let references = ReferencePictures::of_scene(engine, scene, views, background, &mut NoProgress)?;
                Ok(Self { references, baseline: None })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Prunes by each candidate and returns the best: the highest PSNR at a count, or the smallest count within a loss.
    /// Pass `scene` in the runtime form. Begins the task "comparing scores".
    ///
    /// # Errors
    /// No candidates, a failure of the engine.
    pub fn best(
        &self,
        engine: &mut Engine,
        scene: &GaussianScene,
        candidates: Vec<Candidate>,
        goal: Goal,
        progress: &mut dyn Progress,
    ) -> Result<SearchOutcome, PruneError> {
        progress.begin("comparing scores", candidates.len());
        let mut outcomes = Vec::with_capacity(candidates.len());
        for candidate in &candidates {
            proceed(progress)?;
            outcomes.push(self.outcome(engine, scene, candidate, goal)?);
            progress.advance();
        }
        progress.finish();
        let best = candidates.into_iter().zip(&outcomes).min_by(|(_, a), (_, b)| goal.compare(a, b));
        let (candidate, best) = best.ok_or(PruneError::NoScore)?;
        let best = best.clone();
        Ok(SearchOutcome { candidate, best, outcomes })
    }

    /// Returns the PSNR of a scene on the validation views, dB.
    ///
    /// # Errors
    /// A failure of the engine.
    pub fn psnr(&self, engine: &mut Engine, scene: &RuntimeScene) -> Result<f64, PruneError> {
        Ok(self.references.psnr(engine, scene)?)
    }

    /// Returns the PSNR of the whole scene on the validation views, dB; `None` if it is compared with itself.
    pub fn baseline(&self) -> Option<f64> {
        self.baseline
    }

    /// Summarizes the search, given the outcomes of all candidates.
    pub fn summary(&self, outcomes: Vec<Outcome>) -> SearchSummary {
        let compared_with = if self.baseline.is_some() { ComparedWith::Images } else { ComparedWith::WholeScene };
        SearchSummary {
            views: self.references.count(),
            compared_with,
            psnr_before: self.baseline,
            candidates: outcomes,
        }
    }

    fn outcome(
        &self,
        engine: &mut Engine,
        scene: &GaussianScene,
        candidate: &Candidate,
        goal: Goal,
    ) -> Result<Outcome, PruneError> {
        let total = scene.len();
        let mut psnr = |count: usize| {
            let pruned = select(scene, &highest(&candidate.scores, count)).into_runtime()?;
            self.psnr(engine, &pruned)
        };
        let (kept, trials) = match (goal, self.baseline) {
            (Goal::MaxLoss(loss), Some(baseline)) => smallest_count(total, total / 500, baseline - loss, psnr)?,
            (Goal::MaxLoss(_), None) => (total, Vec::new()),
            (Goal::Keep(_) | Goal::Remove(_) | Goal::Size(_), _) => {
                let count = goal.count(total).unwrap_or(total);
                (count, vec![Trial { count, psnr: psnr(count)? }])
            }
        };
        let at_kept = trials.iter().find(|trial| trial.count == kept).map(|trial| trial.psnr);
        Ok(Outcome { score: candidate.name.clone(), kept, psnr: at_kept.or(self.baseline), trials })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(kept: usize, psnr: Option<f64>) -> Outcome {
        Outcome { score: "energy".to_owned(), kept, psnr, trials: Vec::new() }
    }

    #[test]
    fn goals_determine_counts_and_order_outcomes() {
        assert_eq!(Goal::Keep(7).count(5), Some(5), "a goal above the number of Gaussians keeps all");
        assert_eq!(Goal::Remove(0.4).count(2000), Some(1200), "a fraction is removed");
        assert_eq!(Goal::default().count(5), None, "a loss determines no count");
        let (sharp, small) = (outcome(9, Some(30.0)), outcome(5, Some(29.0)));
        assert_eq!(Goal::Keep(9).compare(&sharp, &small), Ordering::Less, "at a count, the higher PSNR is better");
        assert_eq!(
            Goal::MaxLoss(2.0).compare(&sharp, &small),
            Ordering::Greater,
            "within a loss, the smaller count is better"
        );
        assert_eq!(
            Goal::Keep(9).compare(&outcome(9, None), &small),
            Ordering::Greater,
            "an outcome without PSNR comes last"
        );
    }

    #[test]
    fn stored_candidates_are_read_without_loss() {
        let candidate = |name: &str, scores: &[f32]| Candidate { name: name.to_owned(), scores: scores.to_vec() };
        let all = vec![candidate("energy", &[1.0, 2.0]), candidate("full", &[0.5, 0.0])];
        let read = Vec::<Candidate>::decode(&all.encode().expect("candidates can be stored")).expect("the same bytes");
        assert_eq!(read, all, "names and values");
        assert_eq!(of_name(&read, "full"), Some(&[0.5, 0.0][..]), "a score by its name");
        assert_eq!(of_name(&read, "removal"), None, "a score that was not computed");
    }

    #[test]
    fn choices_leave_out_scores_that_need_the_volume_of_the_runtime_form() {
        assert_eq!(ScoreChoice::All.variants(true), Variant::ALL, "every score of a trained scene");
        assert!(
            ScoreChoice::Auto.variants(false).iter().all(|variant| !variant.needs_volume()),
            "no score of Auto needs the volume"
        );
        assert_eq!(ScoreChoice::One(Variant::Full).variants(false), [Variant::Full], "a named score is kept");
    }
}
