//! Eigenvalues: the axes of a covariance in space, or in space and time.
//!
//! In: a symmetric matrix. Out: its eigenvalues, which are variances, and its eigenvectors, the axes.

use glam::{DMat4, DVec4};

/// Returns eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi rotations. Zero off-diagonal entries
/// are skipped, so that a 3D matrix in the first three rows and columns is decomposed by itself.
pub(crate) fn eigen(mut a: DMat4) -> (DVec4, DMat4) {
    let mut vectors = DMat4::IDENTITY;
    // Convergence is quadratic: these sweeps are more than enough.
    for _ in 0..16 {
        for (p, q) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let off = a.col(q)[p];
            if off.abs() <= 1e-300 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * off);
            let sign = if theta < 0.0 { -1.0 } else { 1.0 };
            let t = sign / (theta.abs() + (theta * theta + 1.0).sqrt());
            let cos = (t * t + 1.0).sqrt().recip();
            let sin = t * cos;
            let mut turn = DMat4::IDENTITY;
            turn.col_mut(p)[p] = cos;
            turn.col_mut(q)[q] = cos;
            turn.col_mut(q)[p] = sin;
            turn.col_mut(p)[q] = -sin;
            a = turn.transpose() * a * turn;
            vectors *= turn;
        }
    }
    (DVec4::new(a.x_axis.x, a.y_axis.y, a.z_axis.z, a.w_axis.w), vectors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DQuat};

    #[test]
    fn eigenvalues_and_eigenvectors_reproduce_the_matrix() {
        let turn = DMat4::from_quat(DQuat::from_xyzw(0.1, -0.5, 0.7, 0.3).normalize());
        let mixed =
            DMat4::from_cols_array(&[4.0, 1.0, 0.5, 0.2, 1.0, 3.0, -0.3, 0.9, 0.5, -0.3, 2.0, 0.0, 0.2, 0.9, 0.0, 1.0]);
        for matrix in [mixed, turn * DMat4::from_diagonal(DVec4::new(1e-9, 1.0, 4.0, 1.0)) * turn.transpose()] {
            let (values, axes) = eigen(matrix);
            let again = axes * DMat4::from_diagonal(values) * axes.transpose();
            assert!(again.abs_diff_eq(matrix, 1e-12), "eigenvalues {values} along {axes} give the matrix");
        }
    }

    #[test]
    fn a_3d_matrix_leaves_the_fourth_axis_unchanged() {
        let space = DMat3::from_cols_array(&[4.0, 1.0, 0.5, 1.0, 3.0, -0.3, 0.5, -0.3, 2.0]);
        let (values, axes) = eigen(DMat4::from_mat3(space));
        assert_eq!((values.w, axes.w_axis, axes.row(3)), (1.0, DVec4::W, DVec4::W), "the fourth axis is unchanged");
    }
}
