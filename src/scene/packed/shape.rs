//! Shapes: a covariance as scales and a rotation, and a rotation as three of its four components.
//!
//! In: the covariance of a Gaussian. Out: the logarithms of its scales, the three smaller components of its rotation
//! and which component is the largest; and back.

use crate::gaussian::Gaussian;
use glam::{DMat3, DQuat, DVec3, Mat3, Quat, Vec3};

/// A covariance, decomposed.
pub(super) struct Shape {
    /// Logarithm of the scale along each rotated axis.
    pub log_scale: DVec3,
    /// Rotation of the axes, of length 1.
    pub rotation: DQuat,
}

impl Shape {
    /// Returns the scales, at least `flattest`, and the rotation of the conditional covariance.
    pub fn of(gaussian: &Gaussian, flattest: f64) -> Self {
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance.map(f64::from);
        let covariance = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let (values, mut vectors) = eigen(covariance);
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

/// Returns eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi rotations.
fn eigen(mut a: DMat3) -> (DVec3, DMat3) {
    let mut vectors = DMat3::IDENTITY;
    // Convergence is quadratic: a dozen sweeps are more than enough.
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a.col(q)[p];
            if off.abs() <= 1e-300 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let t = if theta == 0.0 { 1.0 } else { t };
            let cos = (t * t + 1.0).sqrt().recip();
            let sin = t * cos;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cos;
            turn.col_mut(q)[q] = cos;
            turn.col_mut(q)[p] = sin;
            turn.col_mut(p)[q] = -sin;
            a = turn.transpose() * a * turn;
            vectors *= turn;
        }
    }
    (DVec3::new(a.x_axis.x, a.y_axis.y, a.z_axis.z), vectors)
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
