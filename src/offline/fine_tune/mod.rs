//! Fine-tuning: training what pruning has left, so that it makes up for what was removed.
//!
//! In: a scene in the trained form, its training views with their images, [`FineTuneSettings`]. Out: the scene with the best parameters that
//! were found ([`FineTuned`]), and how its quality developed. The number of Gaussians stays.
//!
//! Some training views are held out: they tell which parameters are the best. The loss is `0.8 L1 + 0.2 (1 − SSIM)`, with further [`Terms`]
//! if these have weights, the optimizer Adam (section 6 of the 4DGS model). Views, backgrounds and rates of a step follow from its number
//! alone, so that a run which is resumed ends as one which was not interrupted, but for rounding if sums are [atomic](GradientSums::Atomic).
//! If the scene is compressed, further steps train codebooks of color with everything else, on request on pictures of rounded geometry.

mod adam;
mod belonging;
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

use super::dataset::TrainingView;
use super::quantize::Quality;
use super::work::{Fingerprint, Work};
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
    /// Factor on the rates at the end, which they fall to. Default: 0.05; 1 keeps them.
    pub last_rate: f64,
    /// Share of SSIM in the loss. Default: 0.2.
    pub similarity_share: f64,
    /// Weights of further terms of the loss. Default: 0.
    pub terms: Terms,
    /// Whether a step leaves Gaussians as they are that none of its views shows. Default: `false`.
    pub sparse: bool,
    /// What is behind images that do not cover all of their pixels.
    pub behind: Behind,
    /// Seed of the order of views and of random backgrounds.
    pub seed: u64,
    /// Training views that are not trained on; they tell which parameters are the best. Default: 8; at most a quarter of all are.
    pub held_out: usize,
    /// Steps between two evaluations on them. Default: 500.
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
            last_rate: 0.05,
            similarity_share: 0.2,
            terms: Terms::default(),
            sparse: false,
            behind: Behind::default(),
            seed: 0,
            held_out: 8,
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
    /// PSNR on the held-out views, dB.
    pub psnr: f64,
}

/// A scene after fine-tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuned {
    /// The scene with the best parameters.
    pub scene: GaussianScene,
    /// The quality before the first step, at every evaluation and at the end.
    pub curve: Vec<CurvePoint>,
    /// The point with the best parameters.
    pub best: CurvePoint,
    /// Steps a second, of those made now, without evaluations; `None` if there were none.
    pub steps_per_second: Option<f64>,
    /// Number of held-out views.
    pub held_out: usize,
    /// Gradients that were not finite and have been left out.
    pub faults: Option<Faults>,
    /// Whether it ended before all steps were made because the user wanted it to.
    pub interrupted: bool,
}

/// Where the state of training is stored, and what it depends on.
#[derive(Debug, Clone, Copy)]
pub struct Resume<'a> {
    /// The folder.
    pub work: &'a Work,
    /// Everything that the result depends on besides the settings.
    pub fingerprint: Fingerprint,
    /// Steps between two states.
    pub every: usize,
}

/// Trains a scene on views. What its temporal filter leaves out is not drawn in training either; a filter of the kind support, which changes no
/// picture, is computed again afterwards. Begins the tasks "loading images" and "fine-tuning".
///
/// # Errors
/// A scene that is not in the trained form or does not fit the GPU, images that are missing or show something else, a lost device.
pub fn fine_tune(
    headless: &mut Headless,
    scene: GaussianScene,
    views: &[TrainingView],
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, OfflineError> {
    let images = TrainingImages::load(views, settings.held_out, &scene.trained_with, progress)?;
    fine_tune_on(headless, scene, &images, settings, resume, progress)
}

/// As [`fine_tune`], on images that have been loaded. Begins the task "fine-tuning".
///
/// # Errors
/// As [`fine_tune`].
pub fn fine_tune_on(
    headless: &mut Headless,
    scene: GaussianScene,
    images: &TrainingImages,
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, OfflineError> {
    Run::open(headless, scene, images, settings)?.run(resume, progress)
}
