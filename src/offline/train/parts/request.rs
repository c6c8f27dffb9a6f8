//! What a training asks of its optional parts.
//!
//! In: the settings of a run, its images. Out: [`Request`], from which each part knows whether and how it is made.

use crate::offline::compress::codebook::Centers;
use crate::offline::train::settings::FineTuneSettings;
use crate::scene::Bits;

/// What the parts of a training are made from.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The settings of the run.
    pub settings: &'a FineTuneSettings,
    /// The camera of each view, by the number of the view, numbered from 0. Used only if exposures are trained.
    pub cameras: &'a [u32],
    /// Views of each step.
    pub batch: usize,
    /// Codebooks whose entries are trained in place of all color coefficients but the first of each Gaussian. Rows are
    /// Gaussians.
    pub codebooks: Option<&'a Centers>,
    /// How geometry is rounded.
    pub rounding: Option<RoundingSettings>,
}

/// When and how geometry is rounded: when the part is made, and again before steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundingSettings {
    /// The bits of the packed form.
    pub bits: Bits,
    /// Number of the first step, from 0, which is drawn as the part was made.
    pub first: usize,
    /// Steps between two roundings.
    pub every: usize,
}

impl<'a> Request<'a> {
    /// Returns what fine-tuning or training with these settings asks for: neither codebooks nor rounding.
    pub fn of(settings: &'a FineTuneSettings) -> Self {
        Self { settings, cameras: &[], batch: settings.batch, codebooks: None, rounding: None }
    }
}
