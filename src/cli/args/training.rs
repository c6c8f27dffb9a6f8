//! Options of the steps of training, which `finetune` and `train` share.
//!
//! In: options. Out: [`FineTuneSettings`], in which the verb sets the others.

use super::values;
use crate::offline::train::{Behind, FineTuneSettings, Terms};

/// Settings of each step.
#[derive(clap::Args)]
pub(crate) struct TrainingArgs {
    /// Views of each step.
    #[arg(long, value_name = "N", default_value = "2", value_parser = values::count(1000))]
    batch: usize,
    /// Weight, in the loss, of opacity where images have none: the original's opacity mask.
    #[arg(long, help_heading = "Experimental", value_name = "WEIGHT", default_value = "0", value_parser = values::not_negative)]
    mask_weight: f64,
    /// Weight, in the loss, of motion: the mean length of 0.1 times the velocity.
    #[arg(long, help_heading = "Experimental", value_name = "WEIGHT", default_value = "0", value_parser = values::not_negative)]
    motion_weight: f64,
    /// Weight, in the loss, of motion that differs from that of the 20 nearest Gaussians: the original's rigid term.
    #[arg(long, help_heading = "Experimental", value_name = "WEIGHT", default_value = "0", value_parser = values::not_negative)]
    rigid_weight: f64,
    /// Train an exposure for each camera: gains, mixtures and offsets of red, green and blue, for pictures whose
    /// cameras differ in exposure or white balance. OUT has the mean exposure of the training cameras; exposures are
    /// not stored in it, and no evaluation uses them [default: on in training from pictures of several cameras that
    /// stand still, else off].
    #[arg(long, value_name = "SWITCH", require_equals = true, num_args = 0..=1, default_missing_value = "on", value_parser = values::switch())]
    pub exposure: Option<bool>,
    /// Background of images with transparent pixels: random, a random color for each view, or fixed, the background of
    /// training.
    #[arg(long, value_name = "WHAT", default_value = "random", value_parser = values::one_of(&BEHIND))]
    behind: Behind,
    /// End after this number of evaluations without an improvement; 0: make all steps [default: 5 in training from
    /// opaque pictures, unless they are of several cameras that stand still; else 0].
    #[arg(long, value_name = "N", value_parser = values::count_or_none(1_000_000))]
    pub patience: Option<usize>,
    /// Seed of all random choices, such as the order of views and random backgrounds.
    #[arg(long, value_name = "N", default_value = "0")]
    pub seed: u64,
}

const BEHIND: [(&str, Behind); 2] = [("random", Behind::Random), ("fixed", Behind::Fixed)];

impl TrainingArgs {
    /// Returns the settings with these options, all others as by default.
    pub(crate) fn settings(&self) -> FineTuneSettings {
        FineTuneSettings {
            batch: self.batch,
            terms: Terms {
                mask: self.mask_weight,
                motion: self.motion_weight,
                rigid: self.rigid_weight,
                ..Terms::default()
            },
            exposure: self.exposure.unwrap_or(false),
            behind: self.behind,
            patience: self.patience.filter(|&patience| patience > 0),
            seed: self.seed,
            ..FineTuneSettings::default()
        }
    }
}
