//! The change that packing makes to a Gaussian, so that training can draw a Gaussian as if it were packed.
//!
//! In: a packed scene, the Gaussian that a record was encoded from. Out: a [`Rounding`], which maps that Gaussian to
//! the decoded one, and Gaussians close to it to Gaussians close to the decoded one. CPU reference of
//! `shaders/offline/rounding.wgsl`.
//!
//! A difference is added to each attribute that may have any value. A shape is rotated and stretched instead: the
//! difference of two covariances, added to the covariance of a flat Gaussian that has rotated a little since, would
//! result in a negative variance.

use super::lanes::SharedRanges;
use super::scene::PackedScene;
use super::shape::Shape;
use crate::gaussian::Gaussian;
use glam::{DMat3, DVec3, Mat3, Vec3};

/// The change of one Gaussian by packing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// Added to the mean, capture units.
    pub mean: Vec3,
    /// Added to the temporal mean, timestamp units.
    pub mean_t: f32,
    /// Added to the velocity, capture units per timestamp unit.
    pub velocity: Vec3,
    /// Factor on `1/σ_t`; 1 if σ_t is infinite.
    pub rate: f32,
    /// Added to the variance along every axis before `shape`, capture units squared. It is the variance of the smallest
    /// stored scale, to which smaller scales have been raised; without it their factors would be unbounded.
    pub variance: f32,
    /// Rotates and stretches the shape: from the covariance C and the added variance V to `shape (C + V) shapeᵀ`.
    pub shape: Mat3,
    /// Added to the opacity, which stays between 0 and 1.
    pub opacity: f32,
}

impl Rounding {
    /// Returns a Gaussian with these changes.
    pub fn apply(&self, gaussian: &Gaussian) -> Gaussian {
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance;
        let covariance = Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let raised = covariance + Mat3::from_diagonal(Vec3::splat(self.variance));
        let Mat3 { x_axis: x, y_axis: y, z_axis: z } = self.shape * raised * self.shape.transpose();
        Gaussian {
            mean: (Vec3::from(gaussian.mean) + self.mean).to_array(),
            mean_t: gaussian.mean_t + self.mean_t,
            velocity: (Vec3::from(gaussian.velocity) + self.velocity).to_array(),
            sigma_t: gaussian.sigma_t / self.rate,
            covariance: [x.x, x.y, x.z, y.y, y.z, z.z],
            opacity: (gaussian.opacity + self.opacity).clamp(0.0, 1.0),
            padding: 0.0,
        }
    }
}

impl PackedScene {
    /// Returns the change by packing of the Gaussian with this index, which was encoded from `gaussian`.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn rounding(&self, index: usize, gaussian: &Gaussian) -> Rounding {
        let decoded = self.gaussian(index);
        let (scale, rotation) = self.shape(index);
        // The encoder decomposed the same covariance: its axes are in the order of the decoded axes.
        let own = Shape::of(gaussian, 0.0);
        let [smallest, _] = SharedRanges::read(&self.ranges).log_scale;
        let variance = (2.0 * smallest).exp();
        let raised = (own.log_scale * 2.0).map(f64::exp) + DVec3::splat(f64::from(variance));
        let stretch = DMat3::from_diagonal(scale.as_dvec3() / raised.map(f64::sqrt));
        let shape = DMat3::from_quat(rotation.as_dquat()) * stretch * DMat3::from_quat(own.rotation).transpose();
        let always = !gaussian.sigma_t.is_finite();
        Rounding {
            mean: Vec3::from(decoded.mean) - Vec3::from(gaussian.mean),
            mean_t: decoded.mean_t - gaussian.mean_t,
            velocity: Vec3::from(decoded.velocity) - Vec3::from(gaussian.velocity),
            rate: if always { 1.0 } else { gaussian.sigma_t / decoded.sigma_t },
            variance,
            shape: shape.as_mat3(),
            opacity: decoded.opacity - gaussian.opacity,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::encode::Bits;
    use super::super::{PackedColors, shape};
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::scene::random::Random;
    use glam::Quat;

    const COARSE: Bits =
        Bits { mean: 6, mean_t: 6, velocity: 5, sigma_t: 5, scale: 4, rotation: 4, opacity: 4, base: 8, escape: 0.02 };

    /// Returns Gaussians of many shapes, including needles and disks of no thickness; every fourth is present at every
    /// time.
    fn gaussians() -> Vec<Gaussian> {
        let mut random = Random::new(3);
        let mut three = |low: f32, high: f32| [(); 3].map(|()| random.in_range(low, high));
        let mut gaussian = |index: usize| {
            let [x, y, z] = three(-1.0, 1.0);
            let mut scale = Vec3::from(three(-7.0, -1.0)).map(f32::exp);
            if index.is_multiple_of(5) {
                scale.z = 0.0;
            }
            let [mean_t, sigma_t, opacity] = three(0.05, 0.95);
            let (mean, velocity) = (three(-1.0, 1.0), three(-0.3, 0.3));
            let always = index.is_multiple_of(4);
            Gaussian {
                mean,
                mean_t,
                velocity: if always { [0.0; 3] } else { velocity },
                sigma_t: if always { f32::INFINITY } else { sigma_t },
                covariance: shape::covariance(scale, Quat::from_xyzw(x, y, z, 0.7).normalize()),
                opacity,
                padding: 0.0,
            }
        };
        (0..600).map(&mut gaussian).collect()
    }

    fn packed(gaussians: &[Gaussian]) -> PackedScene {
        PackedScene::encode(gaussians, &COARSE, PackedColors::Whole(Harmonics::default()), [0.0; 2], 1.0)
    }

    fn matrix([xx, xy, xz, yy, yz, zz]: [f32; 6]) -> DMat3 {
        DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz].map(f64::from))
    }

    fn size(gaussian: &Gaussian) -> f32 {
        gaussian.covariance[0] + gaussian.covariance[3] + gaussian.covariance[5]
    }

    #[test]
    fn a_rounding_maps_its_gaussian_to_the_decoded_gaussian() {
        let gaussians = gaussians();
        let packed = packed(&gaussians);
        let mut far = 0;
        for (index, gaussian) in gaussians.iter().enumerate() {
            let (found, expected) = (packed.rounding(index, gaussian).apply(gaussian), packed.gaussian(index));
            let values = |g: &Gaussian| [&g.mean[..], &[g.mean_t], &g.velocity, &[g.opacity]].concat();
            let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(apart(&values(&found), &values(&expected)) < 1e-6, "{index}: {found:?}, expected {expected:?}");
            assert_eq!(
                found.sigma_t.is_finite(),
                expected.sigma_t.is_finite(),
                "{index}: σ_t is infinite in both or in neither"
            );
            if expected.sigma_t.is_finite() {
                assert!(
                    (found.sigma_t / expected.sigma_t - 1.0).abs() < 1e-6,
                    "{index}: {found:?}, expected {expected:?}"
                );
            }
            let shapes = apart(&found.covariance, &expected.covariance);
            assert!(shapes < 1e-5 * size(&expected), "{index}: {found:?}, expected {expected:?}");
            far += usize::from(apart(&gaussian.covariance, &expected.covariance) > 0.05 * size(&expected));
        }
        assert!(far > 300, "with so few bits most shapes change: {far}");
    }

    #[test]
    fn the_rounding_of_a_rotated_and_scaled_gaussian_leaves_no_negative_variance() {
        let gaussians = gaussians();
        let packed = packed(&gaussians);
        let change = DMat3::from_quat(Quat::from_rotation_x(0.05).as_dquat()) * DMat3::from_diagonal(DVec3::splat(0.8));
        for (index, gaussian) in gaussians.iter().enumerate() {
            let moved = change * matrix(gaussian.covariance) * change.transpose();
            let [x, y, z] = [moved.x_axis, moved.y_axis, moved.z_axis].map(|axis| axis.as_vec3());
            let opacity = 0.5 * gaussian.opacity;
            let moved = Gaussian { covariance: [x.x, x.y, x.z, y.y, y.z, z.z], opacity, ..*gaussian };
            let found = packed.rounding(index, gaussian).apply(&moved);
            found.check().unwrap_or_else(|reason| panic!("{index}: {reason}"));
            let covariance = matrix(found.covariance);
            let least = (0..200u32).map(|k| {
                let angle = f64::from(k) * 2.4;
                let height = f64::from(k) / 100.0 - 0.995;
                let around = (1.0 - height * height).sqrt();
                let direction = DVec3::new(around * angle.cos(), around * angle.sin(), height);
                direction.dot(covariance * direction)
            });
            let least = least.fold(f64::INFINITY, f64::min);
            let (before, after) = (size(gaussian), size(&found));
            assert!(
                least > -1e-5 * f64::from(after),
                "{index}: the smallest variance is {least:e}, their sum {after:e}"
            );
            assert!((0.25..4.0).contains(&(after / before)), "{index}: the size changes from {before:e} to {after:e}");
        }
    }
}
