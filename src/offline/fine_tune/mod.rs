//! Fine-tuning: training what pruning has left, so that it makes up for what was removed.
//!
//! In: a scene in the trained form, its training views with their images, [`FineTuneSettings`]. Out: the scene with the best parameters that
//! were found ([`FineTuned`]), and how its quality developed. The number of Gaussians stays.
//!
//! The best step is chosen on validation views, which are not trained on; without validation views, the last step is kept. The loss is `0.9 L1 + 0.1 (1 − SSIM)` unless set otherwise, with further [`Terms`]
//! if these have weights, the optimizer Adam (section 6 of the 4DGS model). Views, backgrounds and rates of a step follow from its number
//! alone, so that a run which is resumed ends as one which was not interrupted, but for rounding if sums are [atomic](GradientSums::Atomic).
//! If the scene is compressed, further steps train codebooks of color with everything else, on request on pictures of rounded geometry.

mod adam;
mod coding;
mod loss;
mod neighbors;
mod optimized;
mod passes;
mod records;
mod regularizer;
mod resume;
mod rounding;
mod run;
mod schedule;
mod state;
mod sums;
mod targets;
mod terms;
mod tied;
mod trainer;
mod view_buffers;

pub use adam::{DECAY, Moments, adam};
pub use loss::{Loss, OpacityMask, loss, opacity_mask};
pub use neighbors::{NEIGHBORS, neighbors};
pub use schedule::{Behind, Rates};
pub use state::TrainerState;
pub use sums::GradientSums;
pub use targets::TrainingImages;
pub use terms::{Regularization, Terms, regularization};
pub use trainer::{Faults, GpuImage, Sample, Totals, Trainer, TrainerError};

use super::quantize::Quality;
use super::store::{Key, Store};
use super::{OfflineError, Progress};
use crate::gaussian::GradientMode;
use crate::renderer::Headless;
use crate::scene::GaussianScene;
use run::Run;
use serde::{Deserialize, Serialize};

/// Settings of fine-tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuneSettings {
    /// Number of steps. Default: 5000.
    pub steps: usize,
    /// Views of each step. Default: 2.
    pub batch: usize,
    /// Rates of the optimizer at first.
    pub rates: Rates,
    /// Factor on the rates at the end, which they fall to. Default: 0.2; 1 keeps them.
    pub last_rate: f64,
    /// Weight of SSIM in the loss; the weight of L1 is the rest. Default: 0.1; the original's is 0.2.
    pub similarity_share: f64,
    /// Weights of further terms of the loss. Default: 0.
    pub terms: Terms,
    /// Whether a step leaves Gaussians as they are that none of its views shows. Default: `false`.
    pub sparse: bool,
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
    /// How gradients are summed. Default: in a fixed order.
    pub sums: GradientSums,
    /// How the result is compressed, and the number of further steps in which the codebooks of color are trained; `None` leaves the scene in
    /// the trained form.
    pub compress: Option<(Quality, usize)>,
    /// Whether these further steps see geometry as the package will hold it, rounded. Default: `false`; it pays with few bits.
    pub rounding: bool,
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
            sparse: false,
            behind: Behind::default(),
            seed: 0,
            evaluate_every: 500,
            patience: None,
            refresh_filter: 1000,
            mode: GradientMode::default(),
            sums: GradientSums::default(),
            compress: None,
            rounding: false,
        }
    }
}

/// The quality after some steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Steps made.
    pub step: usize,
    /// Mean loss of the steps since the point before; `None` before the first.
    pub loss: Option<f64>,
    /// PSNR of these steps, all pixels together, dB; `None` before the first.
    pub training_psnr: Option<f64>,
    /// PSNR on the validation views, dB; `None` without validation views.
    pub psnr: Option<f64>,
}

/// A scene after fine-tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuned {
    /// The scene with the best parameters.
    pub scene: GaussianScene,
    /// The quality before the first step, at every evaluation and at the end.
    pub curve: Vec<CurvePoint>,
    /// The point with the best parameters: the highest PSNR on the validation views; without these, the last point.
    pub best: CurvePoint,
    /// Steps a second, of those made now, without evaluations; `None` if there were none.
    pub steps_per_second: Option<f64>,
    /// Number of validation views.
    pub validation: usize,
    /// Gradients that were not finite and have been left out.
    pub faults: Option<Faults>,
}

/// Where the state of training is stored, and what it depends on.
#[derive(Debug, Clone, Copy)]
pub struct Resume<'a> {
    /// The folder.
    pub store: &'a Store,
    /// Everything that the result depends on besides the settings.
    pub key: Key,
    /// Steps between two states.
    pub every: usize,
}

/// Trains a scene on images. What its temporal filter leaves out is not drawn in training either; a filter of the kind support, which
/// changes no picture, is computed again afterwards. Begins the task "fine-tuning".
///
/// # Errors
/// A scene that is not in the trained form or does not fit the GPU, no images, a lost device; [`OfflineError::Interrupted`], with the best
/// result so far, if the user has asked to end.
pub fn fine_tune(
    headless: &mut Headless,
    scene: GaussianScene,
    images: &TrainingImages,
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, OfflineError> {
    Run::open(headless, scene, images, settings)?.run(resume, progress)
}
