//! The offline half: from a trained checkpoint and its training views to a small, fast capture.
//!
//! In: a [`GaussianScene`], the views it was trained on, something that scores a view
//! ([`ScoreEngine`](score::ScoreEngine)) and something that draws one ([`Draw`](loss::Draw)): the CPU twins here, or the GPU. Out: scores
//! of the Gaussians, the scene with the best of them, and which of them are active when.
//!
//! 1. [`views`] chooses among the training views.
//! 2. [`score`] sums what every Gaussian does to them; [`variant`] names the scores that come of it.
//! 3. [`prune`] keeps the Gaussians that score highest; [`loss`] tells what that costs, and how many a given loss takes.
//! 4. [`masks`] makes the temporal filter.
//! 5. [`pack`] compresses: [`order`], [`quantize`], [`codebook`].
//! 6. [`bake`] lets these stages take up where they left off; [`report`] says what they cost.

pub mod bake;
pub mod dataset;
pub mod metrics;
pub mod prune;
pub mod quality;
pub mod quantize;
pub mod report;
mod save;
pub mod score;
pub mod temporal_filter;

pub use save::{save, write_beside};

use crate::gaussian::{Gaussian, InvalidGaussian, SliceSettings};
use crate::scene::{Form, GaussianScene};
use std::borrow::Cow;

/// The Gaussians of a scene in the runtime form, without its colour.
///
/// # Errors
/// The first Gaussian that cannot be drawn.
pub fn sliced(scene: &GaussianScene) -> Result<Cow<'_, [Gaussian]>, InvalidGaussian> {
    match &scene.form {
        Form::Trained(parameters) => {
            let prefilter_var = scene.trained_with.prefilter_var;
            Ok(Cow::Owned(parameters.slice(&SliceSettings { prefilter_var, ..SliceSettings::default() })?))
        }
        Form::Runtime(gaussians) => Ok(Cow::Borrowed(gaussians)),
        Form::Packed(packed) => Ok(Cow::Owned((0..packed.len()).map(|index| packed.gaussian(index)).collect())),
    }
}
