//! Poses of cameras.
//!
//! In: matrices, or quaternions with translations, of a file. Out: world-to-camera matrices in single precision, or the fault.

use super::FrameProblem;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Mat4};

/// A determinant below this fraction of the product of the lengths of its columns counts as zero.
const SINGULAR: f64 = 1e-9;

/// Returns the matrix with these rows, which must be finite, affine and invertible.
pub(super) fn pose(rows: &[[f64; 4]; 4]) -> Result<DMat4, FrameProblem> {
    let matrix = DMat4::from_cols_array_2d(rows).transpose();
    if !matrix.is_finite() {
        return Err(FrameProblem::Matrix("holds a value that is not finite"));
    }
    if !matrix.row(3).abs_diff_eq(DVec4::W, 1e-6) {
        return Err(FrameProblem::Matrix("must end in the row 0 0 0 1"));
    }
    if is_invertible(matrix) { Ok(matrix) } else { Err(FrameProblem::Matrix("cannot be inverted")) }
}

/// Returns the world-to-camera matrix of a rotation (w, x, y, z; of any length but 0) and a translation.
pub(super) fn of_rotation([w, x, y, z]: [f64; 4], translation: [f64; 3]) -> Result<Mat4, FrameProblem> {
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let length = quaternion.length();
    if !(length.is_finite() && length > f64::MIN_POSITIVE) {
        return Err(FrameProblem::Matrix("has a rotation of length 0, or one that is not finite"));
    }
    let quaternion = DQuat::from_vec4(DVec4::from(quaternion) / length);
    single_precision(DMat4::from_rotation_translation(quaternion.normalize(), DVec3::from(translation)))
}

/// Narrows a matrix, which must stay finite and invertible.
pub(super) fn single_precision(matrix: DMat4) -> Result<Mat4, FrameProblem> {
    let narrow = matrix.as_mat4();
    let usable = narrow.is_finite() && is_invertible(narrow.as_dmat4());
    if usable { Ok(narrow) } else { Err(FrameProblem::Matrix("is too large or too small for float32")) }
}

/// Returns whether the linear part is invertible; false if its determinant overflows.
fn is_invertible(matrix: DMat4) -> bool {
    let linear = DMat3::from_mat4(matrix);
    let volume = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
    volume.is_finite() && linear.determinant().abs() > SINGULAR * volume
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_must_be_finite_affine_and_invertible() {
        let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let with = |row: usize, column: usize, value: f64| {
            let mut rows = identity;
            rows[row][column] = value;
            pose(&rows).is_ok()
        };
        assert!(with(0, 3, 5.0), "a translation is valid");
        assert!(!with(1, 1, 0.0), "a singular matrix is refused");
        assert!(!with(1, 1, f64::NAN) && !with(0, 3, f64::INFINITY), "values that are not finite are refused");
        assert!(!with(3, 3, 2.0), "a matrix that is not affine is refused");
        let huge = DMat4::from_scale(DVec3::splat(1e60));
        assert!(
            single_precision(huge).is_err() && single_precision(huge.inverse()).is_err(),
            "values beyond float32 are refused"
        );
    }

    #[test]
    fn rotations_are_normalized_and_may_not_be_zero() {
        let turned = of_rotation([2.0, 0.0, 0.0, 2.0], [1.0, 2.0, 3.0]).expect("a rotation of length 2.8");
        let found = turned.transform_point3(glam::Vec3::X);
        assert!(found.abs_diff_eq(glam::Vec3::new(1.0, 3.0, 3.0), 1e-6), "a quarter turn about z: {found}");
        for rotation in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0, 1.0]] {
            assert!(of_rotation(rotation, [0.0; 3]).is_err(), "{rotation:?} is refused");
        }
    }
}
