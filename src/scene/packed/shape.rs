//! Shapes: a covariance as scales and a rotation, and a rotation as three of its four components.
//!
//! In: the covariance of a Gaussian. Out: the logarithms of its scales, the three smaller components of its rotation
//! and which component is the largest; and back.

use crate::gaussian::Gaussian;
use crate::gaussian::eigen::eigen;
use glam::{DMat3, DMat4, DQuat, DVec3, Mat3, Quat, Vec3};

/// A covariance, decomposed.
pub(super) struct Shape {
    /// Logarithm of the scale along each rotated axis.
    pub log_scale: DVec3,
    /// Rotation of the axes, of length 1.
    pub rotation: DQuat,
}

impl Shape {
    /// Returns the scales, at least `flattest`, and the rotation of the conditional covariance.
    pub(super) fn of(gaussian: &Gaussian, flattest: f64) -> Self {
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance.map(f64::from);
        let covariance = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let (values, vectors) = eigen(DMat4::from_mat3(covariance));
        let (values, mut vectors) = (values.truncate(), DMat3::from_mat4(vectors));
        if vectors.determinant() < 0.0 {
            vectors.z_axis = -vectors.z_axis;
        }
        // Rounding can make a variance of a flat Gaussian negative.
        let floor = (flattest * flattest).max(values.max_element() * 1e-12).max(1e-30);
        Self {
            log_scale: values.max(DVec3::splat(floor)).map(|v| 0.5 * v.ln()),
            rotation: DQuat::from_mat3(&vectors).normalize(),
        }
    }
}

/// Returns the covariance xx, xy, xz, yy, yz, zz of these scales along the rotated axes.
pub(super) fn covariance(scale: Vec3, rotation: Quat) -> [f32; 6] {
    let m = Mat3::from_quat(rotation) * Mat3::from_diagonal(scale);
    let Mat3 { x_axis: x, y_axis: y, z_axis: z } = m * m.transpose();
    [x.x, x.y, x.z, y.y, y.z, z.z]
}

/// Returns the three smaller components in the order w, x, y, z, with the sign that makes the largest positive, and the
/// index of the largest.
pub(super) fn smallest_three(q: DQuat) -> ([f64; 3], u16) {
    let all = [q.w, q.x, q.y, q.z];
    let largest = (0..4).fold(0, |best, i| if all[i].abs() > all[best].abs() { i } else { best });
    let sign = if all[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut others = (0..4).filter(|&i| i != largest).map(|i| all[i] * sign);
    (std::array::from_fn(|_| others.next().unwrap_or_default()), largest as u16)
}

/// Returns the unit quaternion whose largest component was left out; `three` are the others in the order w, x, y, z.
pub(super) fn with_largest(three: Vec3, largest: u16) -> Quat {
    let rest = (1.0 - three.length_squared()).max(0.0).sqrt();
    let [a, b, c] = three.to_array();
    let [w, x, y, z] = match largest {
        0 => [rest, a, b, c],
        1 => [a, rest, b, c],
        2 => [a, b, rest, c],
        _ => [a, b, c, rest],
    };
    Quat::from_xyzw(x, y, z, w)
}
