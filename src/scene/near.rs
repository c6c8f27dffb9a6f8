//! The near plane of captures that are not checkpoints of the original, and other lengths that depend on the size of a
//! scene.
//!
//! In: the size of a scene, or its Gaussians. Out: the near plane of its cameras, capture units; [`Lengths`]. The near
//! plane of the original, at 0.2 units, would hide a scene of millimeters; it is nearer in small scenes.

use super::bounds::Bounds;
use super::form::SceneForm;
use crate::gaussian::Gaussian;
use crate::view::NEAR;

/// The near plane as a fraction of the size of the scene.
const SHARE: f32 = 0.1;
/// Least distance of the near plane, capture units: projection adds 1e-7 to depths, which must be much larger.
const LEAST: f32 = 1e-6;
/// Standard deviations from the mean of a Gaussian to its visible border.
const REACH: f32 = 3.0;

/// Returns the near plane for a scene of this size, capture units: a tenth of the size, and at most that of the
/// original. The size of an imported scene is its [`extent`]; that of a scene to be trained is the distance from its
/// cameras to their subject. A size that is 0 or not a number is unknown and gives the near plane of the original.
/// Checkpoints of the original keep the original near plane at any size.
pub(crate) fn near_limit(size: f32) -> f32 {
    if size > 0.0 { (SHARE * size).clamp(LEAST, NEAR) } else { NEAR }
}

/// The lengths that are computed from the Gaussians of a scene if its file does not state them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lengths {
    /// Near plane, capture units.
    pub near: f32,
    /// Extent of the cameras, the factor of positional learning rates: 1, or the size of a smaller scene.
    pub spatial_lr_scale: f64,
}

impl Lengths {
    /// Returns the lengths of a scene of these Gaussians.
    pub(crate) fn of(form: &SceneForm) -> Self {
        let size = match form {
            SceneForm::Trained(trained) => {
                let parameters = &trained.parameters;
                let largest = |scale: &[f32; 3]| scale.iter().copied().fold(f32::NEG_INFINITY, f32::max).exp();
                extent_of(&parameters.mean, parameters.log_scale.iter().map(largest).collect())
            }
            SceneForm::Ready(form) => extent(form.iter()),
        };
        let spatial_lr_scale = if size > 0.0 { f64::from(size).min(1.0) } else { 1.0 };
        Self { near: near_limit(size), spatial_lr_scale }
    }
}

/// Returns the radius of the [core](Bounds::core) of a scene, capture units; if the median Gaussian is larger, as in a
/// scene of one Gaussian, three standard deviations of that Gaussian. 0 without Gaussians.
pub(crate) fn extent(gaussians: impl Iterator<Item = Gaussian>) -> f32 {
    let largest = |gaussian: &Gaussian| {
        let [xx, _, _, yy, _, zz] = gaussian.covariance;
        xx.max(yy).max(zz).max(0.0).sqrt()
    };
    let both = gaussians.map(|gaussian| (gaussian.mean, largest(&gaussian)));
    let (means, deviations): (Vec<[f32; 3]>, Vec<f32>) = both.unzip();
    extent_of(&means, deviations)
}

/// Returns the [`extent`] of Gaussians with these means and largest standard deviations.
fn extent_of(means: &[[f32; 3]], mut deviations: Vec<f32>) -> f32 {
    let radius = Bounds::core_of(means).map_or(0.0, Bounds::radius);
    if deviations.is_empty() {
        return radius;
    }
    let middle = deviations.len() / 2;
    let (_, &mut median, _) = deviations.select_nth_unstable_by(middle, f32::total_cmp);
    if median > radius { REACH * median } else { radius }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blob(x: f32, deviation: f32) -> Gaussian {
        let variance = deviation * deviation;
        Gaussian {
            mean: [x, 0.0, 0.0],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [variance, 0.0, 0.0, variance, 0.0, variance],
            opacity: 0.5,
            padding: 0.0,
        }
    }

    #[test]
    fn the_near_plane_is_a_tenth_of_the_size_and_at_most_that_of_the_original() {
        let found = [1e9, 2.0, 1.0, 0.01, 1e-9].map(near_limit);
        for (found, expected) in found.into_iter().zip([NEAR, NEAR, 0.1, 0.001, LEAST]) {
            assert!((found / expected - 1.0).abs() < 1e-6, "a tenth of the size, at most 0.2: {found}, not {expected}");
        }
        assert_eq!(
            [0.0, -1.0, f32::NAN].map(near_limit),
            [NEAR; 3],
            "an unknown size gives the near plane of the original"
        );
        assert_eq!(near_limit(f32::INFINITY), NEAR, "a scene of infinite size has the near plane of the original");
    }

    #[test]
    fn the_extent_is_that_of_the_means_or_of_a_single_gaussian() {
        let of = |gaussians: &[Gaussian]| extent(gaussians.iter().copied());
        assert_eq!(of(&[blob(-1.0, 0.01), blob(1.0, 0.01)]), 1.0, "half the distance of two small Gaussians");
        assert!((of(&[blob(7.0, 0.01)]) - 0.03).abs() < 1e-6, "three standard deviations of the only one");
        assert_eq!(of(&[]), 0.0, "a scene without Gaussians has extent 0");
    }
}
