//! One Gaussian at rest for files of other makes: scales and a rotation instead of a covariance, color without time.
//!
//! In: a scene in any form. Out: [`Ready`], its sliced Gaussians; the axes of a covariance; coefficients with the
//! harmonics in time evaluated.

use crate::codec::import::columns::logit;
use crate::gaussian::eigen::eigen;
use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Model, Parameters, SliceSettings};
use crate::scene::{Form, GaussianScene, SceneForm, Trained};
use glam::{DMat3, DMat4, DQuat};
use std::borrow::Cow;

/// The number of values of one harmonic in time.
const BLOCK: usize = 16 * 3;

/// The sliced Gaussians of a scene, and their color.
pub(super) struct Ready<'a> {
    pub gaussians: Cow<'a, [Gaussian]>,
    pub harmonics: Cow<'a, Harmonics>,
    /// The parameters of a static scene, whose scales, rotations and opacities are exported unchanged.
    at_rest: Option<&'a Parameters>,
    /// Harmonics in time that are evaluated, 0 to 2.
    degree_t: u32,
}

/// Scales, rotation and opacity of a Gaussian.
pub(super) struct Still {
    pub log_scale: [f32; 3],
    pub rotation: [f32; 4],
    pub opacity_logit: f32,
}

impl<'a> Ready<'a> {
    /// Slices or unpacks the Gaussians of a scene; those in the sliced form are borrowed.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn.
    pub(super) fn of(scene: &'a GaussianScene) -> Result<Self, InvalidGaussian> {
        let prefilter_var = scene.trained_with.prefilter_var;
        let settings = SliceSettings { prefilter_var, ..SliceSettings::default() };
        let (gaussians, harmonics, at_rest) = match &scene.form {
            SceneForm::Trained(Trained { parameters, harmonics }) => {
                let at_rest = (parameters.model() == Model::Static3d).then_some(parameters);
                (Cow::Owned(parameters.slice(&settings)?), Cow::Borrowed(harmonics), at_rest)
            }
            SceneForm::Ready(Form::Sliced(sliced)) => {
                (Cow::Borrowed(&*sliced.gaussians), Cow::Borrowed(&sliced.harmonics), None)
            }
            SceneForm::Ready(Form::Packed(packed)) => {
                let sliced = packed.clone().unpack();
                (Cow::Owned(sliced.gaussians), Cow::Owned(sliced.harmonics), None)
            }
        };
        let has_time = harmonics.degree == 3 && !scene.trained_with.force_sh_3d;
        let degree_t = if has_time { harmonics.degree_t } else { 0 };
        Ok(Self { gaussians, harmonics, at_rest, degree_t })
    }

    /// Returns scales, rotation and opacity of one Gaussian, whose opacity is multiplied by `factor`.
    pub(super) fn still(&self, index: usize, factor: f32) -> Still {
        if let Some(parameters) = self.at_rest {
            return Still {
                log_scale: parameters.log_scale[index],
                rotation: parameters.rotation_l[index],
                opacity_logit: parameters.opacity_logit[index],
            };
        }
        let gaussian = &self.gaussians[index];
        let (log_scale, rotation) = axes(gaussian.covariance);
        Still { log_scale, rotation, opacity_logit: logit(gaussian.opacity * factor) }
    }

    /// Writes the coefficients of one Gaussian at a time to `to`; `factor` returns the factor of a harmonic in time.
    pub(super) fn write_colors(&self, index: usize, factor: impl Fn(usize) -> f32, to: &mut [f32]) {
        let from = self.harmonics.of(index);
        to.copy_from_slice(&from[..to.len()]);
        for n in 1..=self.degree_t as usize {
            let factor = factor(n);
            for (to, from) in to.iter_mut().zip(&from[n * BLOCK..]) {
                *to += factor * from;
            }
        }
    }

    /// Returns empty harmonics for `count` Gaussians, of time degree 0.
    pub(super) fn harmonics_at_rest(&self, count: usize) -> Harmonics {
        let degree = self.harmonics.degree;
        let coefficients = (degree as usize + 1).pow(2);
        Harmonics { coefficients, degree, degree_t: 0, values: vec![0.0; count * coefficients * 3] }
    }
}

/// Returns the logarithms of the scales and the rotation, w, x, y, z, of a covariance.
fn axes([xx, xy, xz, yy, yz, zz]: [f32; 6]) -> ([f32; 3], [f32; 4]) {
    let covariance = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz].map(f64::from));
    let (variances, vectors) = eigen(DMat4::from_mat3(covariance));
    let mut vectors = DMat3::from_mat4(vectors);
    if vectors.determinant() < 0.0 {
        vectors.x_axis = -vectors.x_axis;
    }
    // A flat Gaussian has a variance near 0 that rounding may have made negative.
    let least = variances.truncate().max_element() * 1e-14 + 1e-30;
    let log_scale = variances.truncate().to_array().map(|variance| (0.5 * variance.max(least).ln()) as f32);
    let DQuat { x, y, z, w } = DQuat::from_mat3(&vectors).normalize();
    (log_scale, [w, x, y, z].map(|component| component as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_axes_of_a_covariance_give_the_covariance_again() {
        let turn = DMat3::from_quat(DQuat::from_xyzw(0.1, -0.5, 0.7, 0.3).normalize());
        for scales in [DVec3::new(1.0, 2.0, 0.5), DVec3::splat(0.3), DVec3::new(1e-3, 5.0, 1e-3), DVec3::ZERO] {
            let covariance = turn * DMat3::from_diagonal(scales * scales) * turn.transpose();
            let [x, y, z] = covariance.to_cols_array_2d();
            let upper = [x[0], x[1], x[2], y[1], y[2], z[2]].map(|value| value as f32);
            let (log_scale, [w, x, y, z]) = axes(upper);
            let rotation = DMat3::from_quat(DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into()));
            let variances = DVec3::from(log_scale.map(|s| f64::from(2.0 * s).exp()));
            let again = rotation * DMat3::from_diagonal(variances) * rotation.transpose();
            let error = again - covariance;
            let most = error.to_cols_array().into_iter().fold(0.0f64, |most, error| most.max(error.abs()));
            let largest = scales.max_element().powi(2);
            assert!(most <= largest * 1e-6 + 1e-29, "scales {scales}: {again} is {covariance}");
            assert!((rotation.determinant() - 1.0).abs() < 1e-5, "scales {scales}: a proper rotation");
        }
    }
}
