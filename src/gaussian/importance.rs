//! Importance: the order in which Gaussians are left out of a capture that must be drawn in less time.
//!
//! In: a [`Gaussian`], a [`Thinning`]. Out: its importance, and the Gaussian as it is drawn in a thinned capture. CPU
//! reference of `shaders/shared/importance.wgsl`.

use super::slice::Gaussian;
use crate::view::Thinning;

impl Gaussian {
    /// Returns its importance for pictures, capture units: its opacity squared times its extent.
    ///
    /// The extent is `(a²b² + b²c² + c²a²)^¼` of the deviations `a, b, c` along its axes, close to the side of the
    /// square that it covers, and small for needles. Opacity counts twice since faint Gaussians take as much time as
    /// opaque ones.
    pub fn importance(&self) -> f32 {
        let [xx, xy, xz, yy, yz, zz] = self.covariance;
        let minors = xx * yy - xy * xy + (yy * zz - yz * yz) + (xx * zz - xz * xz);
        self.opacity * self.opacity * minors.max(0.0).sqrt().sqrt()
    }
}

/// Returns a Gaussian as drawn in a thinned capture, but for [`Thinning::boosted`]; `None` if it is left out.
pub(crate) fn thinned(gaussian: &Gaussian, thinning: &Thinning) -> Option<Gaussian> {
    if thinning.is_none() {
        return Some(*gaussian);
    }
    let weight = thinning.weight(gaussian.importance());
    let covariance = gaussian.covariance.map(|entry| entry * thinning.growth);
    (weight > 0.0).then_some(Gaussian { covariance, opacity: gaussian.opacity * weight, ..*gaussian })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Mat3, Quat, Vec3};

    fn gaussian(deviations: Vec3, rotation: Quat, opacity: f32) -> Gaussian {
        let axes = Mat3::from_quat(rotation) * Mat3::from_diagonal(deviations);
        let m = axes * axes.transpose();
        let covariance = [m.x_axis.x, m.x_axis.y, m.x_axis.z, m.y_axis.y, m.y_axis.z, m.z_axis.z];
        Gaussian { covariance, opacity, ..bytemuck::Zeroable::zeroed() }
    }

    #[test]
    fn importance_is_opacity_squared_times_extent_in_every_orientation() {
        let deviations = Vec3::new(0.3, 0.05, 0.2);
        let square = |a: f32, b: f32| (a * b).powi(2);
        let sum = square(0.3, 0.05) + square(0.05, 0.2) + square(0.3, 0.2);
        let expected = 0.6 * 0.6 * sum.powf(0.25);
        for rotation in [Quat::IDENTITY, Quat::from_rotation_z(0.7), Quat::from_xyzw(0.2, -0.4, 0.1, 0.8).normalize()] {
            let found = gaussian(deviations, rotation, 0.6).importance();
            assert!((found / expected - 1.0).abs() < 1e-4, "{found}, expected {expected}");
        }
    }

    #[test]
    fn disks_count_by_their_side_and_needles_little() {
        let turn = Quat::from_rotation_x(0.4);
        let disk = gaussian(Vec3::new(0.2, 0.2, 0.0), turn, 1.0).importance();
        assert!((disk - 0.2).abs() < 1e-4, "a flat disk: {disk}");
        let needle = gaussian(Vec3::new(0.2, 1e-4, 1e-4), turn, 1.0).importance();
        assert!(needle < 0.01, "a needle of the same length: {needle}");
        let none = gaussian(Vec3::ZERO, turn, 1.0).importance();
        assert_eq!(none, 0.0, "a point");
    }

    #[test]
    fn a_thinned_gaussian_is_left_out_fainter_or_larger() {
        let one = gaussian(Vec3::splat(0.1), Quat::IDENTITY, 0.5);
        assert_eq!(thinned(&one, &Thinning::default()), Some(one), "unchanged without thinning");
        let importance = one.importance();
        assert_eq!(thinned(&one, &Thinning::new(importance * 1.01, 0.5)), None, "less important than the least");
        let thinning = Thinning::new(importance * 0.5, 0.5);
        let larger = thinned(&one, &thinning).expect("more important");
        assert_eq!(larger.opacity, 0.5, "its opacity stays");
        assert_eq!(larger.covariance[0], one.covariance[0] * thinning.growth, "its covariance grows");
    }
}
