//! What the tests of readers and writers of other makes share.
//!
//! In: an imported capture, or columns. Out: its Gaussians, sliced.

use super::columns::{Columns, Motion};
use super::imported::Imported;
use crate::gaussian::{Gaussian, Parameters, SliceSettings};
use crate::scene::{Form, SceneForm};

/// Returns the Gaussians of a capture that is in the sliced form, as moving ones are.
pub(crate) fn gaussians(imported: &Imported) -> &[Gaussian] {
    let SceneForm::Ready(Form::Sliced(sliced)) = &imported.scene.form else { panic!("sliced") };
    &sliced.gaussians
}

/// Returns the Gaussians of columns, which all move.
pub(crate) fn gaussians_of_columns(columns: &Columns) -> Vec<Gaussian> {
    let parameters = Parameters {
        mean: columns.mean.clone(),
        log_scale: columns.log_scale.clone(),
        rotation_l: columns.rotation.clone(),
        opacity_logit: columns.opacity_logit.clone(),
        ..Parameters::default()
    };
    let gaussians = parameters.slice(&SliceSettings::default()).expect("Gaussians that can be drawn");
    let moving = gaussians.into_iter().zip(&columns.motion);
    moving.map(|(own, &Motion { velocity, mean_t, sigma_t })| Gaussian { velocity, mean_t, sigma_t, ..own }).collect()
}
