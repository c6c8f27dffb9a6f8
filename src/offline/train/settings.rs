//! The settings of training, which is fine-tuning unless they have [`Growth`].
//!
//! In: the choices of a caller. Out: [`FineTuneSettings`], with a default for each; what they say of one step.

use super::densification::Growth;
use super::images::Coarse;
use super::reference::terms::Terms;
use super::schedule::{Behind, Rates, Step};
use crate::gaussian::GradientMode;
use crate::offline::compress::{PackedOrder, Quality};

/// Settings of training.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuneSettings {
    /// Number of steps. Default: 5000.
    pub steps: usize,
    /// Views of each step (the batch). Default: 2.
    pub batch: usize,
    /// Rates of the optimizer at first.
    pub rates: Rates,
    /// Factor on the rates at the end, which they fall to. Default: 0.2; 1 keeps them.
    pub last_rate: f64,
    /// Weight of SSIM in the loss; the weight of L1 is the rest. Default: 0.1; the original's is 0.2.
    pub similarity_share: f64,
    /// Weights of further terms of the loss. Default: 0.
    pub terms: Terms,
    /// Whether a correction of color is trained for each camera: an exposure, which the scene does not have. Default:
    /// `false`.
    pub exposure: bool,
    /// The sizes of the images during the steps; `None`, the default: always whole.
    pub coarse: Option<Coarse>,
    /// What is behind images that do not cover all of their pixels.
    pub behind: Behind,
    /// Seed of the order of views and of random backgrounds.
    pub seed: u64,
    /// Steps between two evaluations on the validation views. Default: 500.
    pub evaluate_every: usize,
    /// Evaluations without an improvement after which training ends. Default: `None`, all steps are made.
    pub patience: Option<usize>,
    /// Steps after which a temporal filter that depends on what views see is computed again. Default: 1000.
    pub refresh_filter: usize,
    /// Whether gradients are those of the original, with its deviations.
    pub mode: GradientMode,
    /// Relocation, noise and schedules of training from pictures alone; `None`, the default, fine-tunes.
    pub growth: Option<Growth>,
    /// How the result is compressed, and the number of further steps in which the codebooks of color are trained;
    /// `None` leaves the scene in the trained form.
    pub compress: Option<(Quality, usize)>,
    /// The order of the Gaussians of the compressed result. Default: spatial.
    pub order: PackedOrder,
    /// Whether these further steps see geometry as the package will hold it, rounded. Default: `false`; it pays with
    /// few bits.
    pub rounding: bool,
    /// Whether native 4D Gaussians of a temporal scale of at least two time intervals are kept at rest, with the same
    /// look at all times. Default: `false`.
    pub standing: bool,
}

impl FineTuneSettings {
    /// Returns the name of the task.
    pub(crate) fn task(&self) -> &'static str {
        if self.growth.is_some() { "training" } else { "fine-tuning" }
    }

    /// Returns the step of this number, from 0, which is number `count` since the moments were 0, with this factor on
    /// all rates. Steps after the last train codebooks, and are those of fine-tuning.
    pub(crate) fn step(&self, index: usize, count: usize, factor: f64) -> Step {
        let step = Step { index, ..Step::new(self.rates, factor, count) };
        let Some(growth) = self.growth.filter(|_| index < self.steps) else { return step };
        let mean = self.rates.mean * growth.mean_rate(index, self.steps);
        let color_values = Some(growth.color_values(index));
        Step { rates: Rates { mean, ..self.rates }, color_values, grows: true, ..step }
    }
}

impl Default for FineTuneSettings {
    fn default() -> Self {
        Self {
            steps: 5000,
            batch: 2,
            rates: Rates::OURS,
            last_rate: 0.2,
            similarity_share: 0.1,
            terms: Terms::default(),
            exposure: false,
            coarse: None,
            behind: Behind::default(),
            seed: 0,
            evaluate_every: 500,
            patience: None,
            refresh_filter: 1000,
            mode: GradientMode::default(),
            growth: None,
            compress: None,
            order: PackedOrder::Spatial,
            rounding: false,
            standing: false,
        }
    }
}
