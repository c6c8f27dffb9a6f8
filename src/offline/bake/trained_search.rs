//! The search for the score to prune by and for the number of Gaussians to keep, if the remaining Gaussians are
//! trained.
//!
//! In: scores, a [`Goal`], images to train on, a search on validation views. Out: the score and the count that are best
//! after a short training, and every count tried ([`Chosen`]).

use super::BakeError;
use crate::offline::engine::Engine;
use crate::offline::prune::search::{Candidate, Goal, ScoreSearch};
use crate::offline::prune::select::{highest, select};
use crate::offline::prune::smallest_count::{Trial, smallest_count};
use crate::offline::train::{FineTuneSettings, TrainingImages, fine_tune};
use crate::offline::work::Progress;
use crate::scene::GaussianScene;

/// Tolerance of the count within a loss, as a fraction of the count that pruning alone needs.
const TOLERANCE: usize = 50;

/// Short trainings of the Gaussians kept by different scores and counts.
pub(crate) struct TrainedSearch<'a> {
    /// The engine that trains and draws.
    pub engine: &'a mut Engine,
    /// The images to train on.
    pub images: &'a TrainingImages,
    /// The settings of a short training.
    pub settings: &'a FineTuneSettings,
    /// The scene with all its Gaussians.
    pub whole: &'a GaussianScene,
    /// The search on the validation views.
    pub search: &'a ScoreSearch,
}

/// The outcome of short trainings.
pub(crate) struct Chosen {
    /// The best score.
    pub candidate: Candidate,
    /// The number of Gaussians to keep.
    pub kept: usize,
    /// Name of the score, count and PSNR on the validation views, for each training.
    pub tried: Vec<(String, Trial)>,
}

impl TrainedSearch<'_> {
    /// Returns the PSNR on the validation views of a scene after a short training.
    fn measure(&mut self, scene: GaussianScene, progress: &mut dyn Progress) -> Result<f64, BakeError> {
        let scene = match self.engine {
            Engine::Gpu(headless) => fine_tune(headless, scene, self.images, self.settings, None, progress)?.scene,
            Engine::Cpu => scene,
        };
        Ok(self.search.psnr(self.engine, &scene.into_runtime()?)?)
    }

    /// Trains the Gaussians that each candidate keeps, and searches for the smallest count if the goal is a loss.
    /// `alone` is the choice without training. Begins the task "training trials".
    ///
    /// The loss is measured against the whole scene before training, or after the same short training if its PSNR is
    /// lower then: the checkpoint was trained on the validation views, unless these come from a separate file, and a
    /// scene not trained on these views cannot reach it.
    ///
    /// # Errors
    /// A scene that cannot be trained, a failure of the engine.
    pub(crate) fn best(
        &mut self,
        candidates: &[Candidate],
        goal: Goal,
        alone: (Candidate, usize),
        progress: &mut dyn Progress,
    ) -> Result<Chosen, BakeError> {
        let (mut candidate, mut kept) = alone;
        let (total, mut tried) = (self.whole.len(), Vec::new());
        let steps = if matches!(goal, Goal::MaxLoss(_)) { TOLERANCE.ilog2() as usize + 2 } else { 0 };
        progress.begin("training trials", steps + candidates.len());
        let floor = match (goal, self.search.baseline()) {
            (Goal::MaxLoss(loss), Some(baseline)) => {
                let trained = self.measure(self.whole.clone(), progress)?;
                progress.advance();
                tried.push((candidate.name.clone(), Trial { count: total, psnr: trained }));
                Some(baseline.min(trained) - loss)
            }
            _ => None,
        };
        // If no Gaussian is removed, all scores give the same scene.
        let compared = if floor.is_some() { kept.div_ceil(2) } else { kept };
        let mut best = f64::NEG_INFINITY;
        let several = candidates.len() > 1;
        for other in candidates.iter().filter(|_| several) {
            let psnr = self.measure(select(self.whole, &highest(&other.scores, compared)), progress)?;
            progress.advance();
            tried.push((other.name.clone(), Trial { count: compared, psnr }));
            if psnr > best {
                (best, candidate) = (psnr, other.clone());
            }
        }
        if let Some(floor) = floor {
            let measure = |count| {
                let psnr = self.measure(select(self.whole, &highest(&candidate.scores, count)), progress);
                progress.advance();
                psnr
            };
            let (fewest, measured) = smallest_count(kept, kept / TOLERANCE, floor, measure)?;
            tried.extend(measured.into_iter().map(|trial| (candidate.name.clone(), trial)));
            kept = fewest;
        }
        progress.finish();
        Ok(Chosen { candidate, kept, tried })
    }
}
