//! Choosing the score and the count of a bake by short trainings: what is best before training is not what is best after it.
//!
//! In: scores, a goal, the views that were scored and those held out. Out: the best score and the count, and every count tried ([`Chosen`]).

use super::Bake;
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::fine_tune::{FineTuneSettings, TrainingImages, fine_tune_on};
use crate::offline::prune::{highest, select};
use crate::offline::quality::{Trial, smallest_count};
use crate::offline::search::{Candidate, Goal, ScoreSearch};
use crate::offline::{OfflineError, Progress};
use crate::scene::GaussianScene;

/// A short training has this share of the steps.
const SHARE: usize = 5;
/// The count that a loss allows is found to within this share of what pruning alone needs.
const TOLERANCE: usize = 50;

/// What short trainings need.
pub(super) struct Trials {
    images: TrainingImages,
    settings: FineTuneSettings,
}

/// The outcome of short trainings.
pub(super) struct Chosen {
    pub candidate: Candidate,
    pub kept: usize,
    /// Name of the score, count and PSNR on the held-out views.
    pub tried: Vec<(String, Trial)>,
}

impl Trials {
    /// Short trainings on these images, with what else the whole training is done with.
    pub fn new(images: TrainingImages, settings: &FineTuneSettings) -> Self {
        let steps = settings.steps.div_ceil(SHARE);
        let settings = FineTuneSettings { steps, evaluate_every: steps.max(1), compress: None, ..settings.clone() };
        Self { images, settings }
    }

    /// Returns the number of steps of a training.
    pub fn steps(&self) -> usize {
        self.settings.steps
    }

    /// Trains a scene. It is returned as it is if there is no GPU.
    pub fn tune(
        &self,
        engine: &mut Engine,
        scene: GaussianScene,
        progress: &mut dyn Progress,
    ) -> Result<GaussianScene, OfflineError> {
        match engine {
            Engine::Gpu(headless) => {
                Ok(fine_tune_on(headless, scene, &self.images, &self.settings, None, progress)?.scene)
            }
            Engine::Cpu => Ok(scene),
        }
    }
}

impl Bake<'_> {
    /// Returns what trials need; `None` if the remaining Gaussians are not trained, or nothing depends on it.
    pub(super) fn trials(
        &self,
        scored: &[TrainingView],
        held_out: &[TrainingView],
        candidates: &[Candidate],
        goal: Goal,
        progress: &mut dyn Progress,
    ) -> Result<Option<Trials>, OfflineError> {
        let open = candidates.len() > 1 || matches!(goal, Goal::MaxLoss(_));
        let Some(settings) = self.tunes().filter(|_| open) else { return Ok(None) };
        let trained_with = &self.subject.scene.trained_with;
        let images = TrainingImages::load_apart(scored.to_vec(), held_out, trained_with, progress)?;
        Ok(Some(Trials::new(images, settings)))
    }

    /// Trains what is left by each candidate, and searches for the smallest count if a loss decides. `alone` is what was found without
    /// training. Begins the task "training trials".
    pub(super) fn choose(
        &mut self,
        trials: &Trials,
        search: &ScoreSearch,
        candidates: Vec<Candidate>,
        goal: Goal,
        alone: (Candidate, usize),
        progress: &mut dyn Progress,
    ) -> Result<Chosen, OfflineError> {
        let Self { engine, subject, .. } = self;
        let mut measure = |candidate: &Candidate, count: usize, progress: &mut dyn Progress| {
            let pruned = select(&subject.scene, &highest(&candidate.scores, count));
            let tuned = trials.tune(engine, pruned, progress)?;
            let psnr = search.psnr(engine, &tuned.into_runtime()?)?;
            progress.advance();
            Ok::<_, OfflineError>(psnr)
        };
        let (mut candidate, mut kept) = alone;
        let floor = match (goal, search.baseline()) {
            (Goal::MaxLoss(loss), Some(baseline)) => Some(baseline - loss),
            _ => None,
        };
        // Where nothing is lost, scores do not differ.
        let compared = if floor.is_some() { kept.div_ceil(2) } else { kept };
        let steps = if floor.is_some() { TOLERANCE.ilog2() as usize + 1 } else { 0 };
        progress.begin("training trials", steps + candidates.len());
        let (mut best, mut tried) = (f64::NEG_INFINITY, Vec::new());
        let several = candidates.len() > 1;
        for other in candidates.into_iter().filter(|_| several) {
            let psnr = measure(&other, compared, progress)?;
            tried.push((other.name.clone(), Trial { count: compared, psnr }));
            if psnr > best {
                (best, candidate) = (psnr, other);
            }
        }
        if let Some(floor) = floor {
            let psnr = |count| measure(&candidate, count, progress);
            let (fewest, measured) = smallest_count(kept, kept / TOLERANCE, floor, psnr)?;
            tried.extend(measured.into_iter().map(|trial| (candidate.name.clone(), trial)));
            kept = fewest;
        }
        progress.finish();
        Ok(Chosen { candidate, kept, tried })
    }
}
