//! The Gaussians of a scene in the runtime form.
//!
//! In: a scene of any form. Out: its Gaussians, without its color.

use crate::gaussian::{Gaussian, InvalidGaussian};
use crate::scene::GaussianScene;
use std::borrow::Cow;

/// Returns the Gaussians of a scene in the runtime form, without its color.
///
/// # Errors
/// The first Gaussian that cannot be drawn.
pub fn sliced(scene: &GaussianScene) -> Result<Cow<'_, [Gaussian]>, InvalidGaussian> {
    scene.gaussians()
}
