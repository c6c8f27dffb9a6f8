//! The Gaussians of a scene in the runtime form.
//!
//! In: a scene of any form. Out: its Gaussians, without its color.

use crate::gaussian::{Gaussian, InvalidGaussian, SliceSettings};
use crate::scene::{Form, GaussianScene, SceneForm, Trained};
use std::borrow::Cow;

/// Returns the Gaussians of a scene in the runtime form, without its color.
///
/// # Errors
/// The first Gaussian that cannot be drawn.
pub fn sliced(scene: &GaussianScene) -> Result<Cow<'_, [Gaussian]>, InvalidGaussian> {
    match &scene.form {
        SceneForm::Trained(Trained { parameters, .. }) => {
            let prefilter_var = scene.trained_with.prefilter_var;
            Ok(Cow::Owned(parameters.slice(&SliceSettings { prefilter_var, ..SliceSettings::default() })?))
        }
        SceneForm::Ready(Form::Sliced(sliced)) => Ok(Cow::Borrowed(&sliced.gaussians)),
        SceneForm::Ready(packed @ Form::Packed(_)) => Ok(Cow::Owned(packed.iter().collect())),
    }
}
