//! A 4D covariance as raw parameters of a Gaussian: scales and a pair of quaternions.
//!
//! In: a symmetric 4D matrix. Out: the standard deviations along its axes, with the axis closest to time last, and the
//! quaternions of the rotation to these axes, as [`rotation_4d`] reads them.

use super::eigen::eigen;
use super::rotation_4d;
use glam::{DMat4, DVec4, Vec3};

/// A covariance, decomposed: `Q diag(s)² Qᵀ` with the rotation `Q` of the two quaternions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axes {
    /// Standard deviations.
    pub scale: DVec4,
    /// Left quaternion.
    pub left: DVec4,
    /// Right quaternion.
    pub right: DVec4,
}

impl Axes {
    /// Decomposes a covariance. `least` is the smallest standard deviation; variances below its square, also negative
    /// ones, are raised to it.
    pub(crate) fn of(covariance: DMat4, least: f64) -> Self {
        let (values, mut axes) = eigen(covariance);
        let mut scale = values.max(DVec4::splat(least * least)).map(f64::sqrt);
        let most_time = (0..4).max_by(|&a, &b| axes.col(a).w.abs().total_cmp(&axes.col(b).w.abs())).unwrap_or(3);
        let (time, last) = (axes.col(most_time), axes.w_axis);
        *axes.col_mut(most_time) = last;
        axes.w_axis = time;
        (scale[most_time], scale.w) = (scale.w, scale[most_time]);
        if axes.determinant() < 0.0 {
            axes.x_axis = -axes.x_axis;
        }
        let (left, right) = quaternions(axes);
        Self { scale, left, right }
    }
}

/// Returns a pair of unit quaternions of a rotation: the inverse of [`rotation_4d`]. The negated pair is the same
/// rotation.
///
/// `rotation_4d` is linear in each quaternion, and its sixteen products of unit axes are orthogonal matrices of norm 2.
/// The coordinates in that basis are therefore the products of the components of both quaternions.
fn quaternions(rotation: DMat4) -> (DVec4, DVec4) {
    let product = |i: usize, j: usize| {
        let basis = rotation_4d(DVec4::AXES[i], DVec4::AXES[j]);
        (0..4).map(|column| basis.col(column).dot(rotation.col(column))).sum::<f64>() * 0.25
    };
    let rows: [DVec4; 4] = std::array::from_fn(|i| DVec4::from_array(std::array::from_fn(|j| product(i, j))));
    let longest = (0..4).max_by(|&a, &b| rows[a].length_squared().total_cmp(&rows[b].length_squared())).unwrap_or(0);
    let right = rows[longest].normalize_or(DVec4::X);
    let left = DVec4::from_array(rows.map(|row| row.dot(right)));
    (left.normalize_or(DVec4::X), right)
}

/// Returns the raw scales and rotations of a Gaussian of this squared scale in all directions that moves.
pub(crate) fn moving(square: f32, scale_t: f32, velocity: Vec3) -> ([f32; 3], f32, [[f32; 4]; 2]) {
    if velocity == Vec3::ZERO || !velocity.is_finite() {
        return ([0.5 * square.ln(); 3], scale_t.ln(), [[1.0, 0.0, 0.0, 0.0]; 2]);
    }
    let (velocity, variance_t) = (velocity.as_dvec3(), f64::from(scale_t).powi(2));
    // Σ = diag(σ², σ², σ², 0) + v u uᵀ with u = (velocity, 1): the velocity c/v of section 2 of the 4DGS model.
    let along = velocity.extend(1.0);
    let mut covariance = DMat4::from_diagonal(DVec4::new(1.0, 1.0, 1.0, 0.0) * f64::from(square));
    for column in 0..4 {
        *covariance.col_mut(column) += along * along[column] * variance_t;
    }
    let Axes { scale, left, right } = Axes::of(covariance, f64::MIN_POSITIVE);
    let logs = scale.map(f64::ln).as_vec4().to_array();
    ([logs[0], logs[1], logs[2]], logs[3], [left, right].map(|quaternion| quaternion.as_vec4().to_array()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns pairs of unit quaternions.
    fn pairs() -> Vec<(DVec4, DVec4)> {
        let quaternion = |seed: f64| DVec4::new(seed.sin(), (2.3 * seed).cos(), (0.7 * seed).sin(), 0.2 - seed.cos());
        let mut pairs: Vec<_> = (1..30)
            .map(|i| (quaternion(f64::from(i)).normalize(), quaternion(f64::from(i) * 1.7 + 0.3).normalize()))
            .collect();
        pairs.extend([(DVec4::X, DVec4::X), (DVec4::Y, DVec4::W), (-DVec4::Z, DVec4::X)]);
        pairs
    }

    #[test]
    fn quaternions_of_a_rotation_give_the_same_rotation() {
        for (left, right) in pairs() {
            let rotation = rotation_4d(left, right);
            let (l, r) = quaternions(rotation);
            assert!(rotation_4d(l, r).abs_diff_eq(rotation, 1e-12), "{left} and {right} became {l} and {r}");
        }
    }

    #[test]
    fn decomposed_axes_give_the_same_covariance() {
        for (left, right) in pairs() {
            let factor = rotation_4d(left, right) * DMat4::from_diagonal(DVec4::new(0.01, 0.2, 0.05, 3.0));
            let covariance = factor * factor.transpose();
            let axes = Axes::of(covariance, 1e-9);
            let again = rotation_4d(axes.left, axes.right) * DMat4::from_diagonal(axes.scale);
            assert!((again * again.transpose()).abs_diff_eq(covariance, 1e-10), "{left} and {right}");
            assert!((rotation_4d(axes.left, axes.right).determinant() - 1.0).abs() < 1e-9, "the rotation is proper");
        }
    }

    #[test]
    fn flat_covariances_have_a_least_scale() {
        let axes = Axes::of(DMat4::from_diagonal(DVec4::new(0.0, 4.0, -1e-20, 1.0)), 0.5);
        assert_eq!(axes.scale.w, 1.0, "the axis of time is last");
        assert!(
            axes.scale.min_element() >= 0.5 && axes.scale.max_element() == 2.0,
            "scales are at least 0.5: {}",
            axes.scale
        );
    }
}
