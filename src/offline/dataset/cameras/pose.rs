//! Poses of cameras.
//!
//! In: matrices, or quaternions with translations, of a file. Out: world-to-camera matrices in double precision, those
//! that are counted from an origin in single precision, or the fault.

use crate::codec::text::printable;
use crate::offline::dataset::FrameProblem;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Mat4};
use serde_json::Value;
use std::slice;

/// A determinant below this fraction of the product of the lengths of its columns counts as zero.
const SINGULAR: f64 = 1e-9;
/// Largest error of a rotation and of a scale: that of numbers rounded to three decimals.
pub(crate) const ROUNDED: f64 = 2e-3;

const FORM: &str =
    "must be four rows of four numbers, or the first three of them, or these numbers in one list, row by row";
const MIRRORED: &str = "mirrors the picture (its determinant is negative): negate one axis of the cameras, or write \
                        the file without mirroring the scene";
const SHEARED: &str =
    "is sheared, or stretched along an axis: it must be a rotation, possibly times one factor, and a translation";

fn fault(reason: &'static str) -> FrameProblem {
    FrameProblem::Matrix(reason.into())
}

/// Returns the rows of a matrix in a file: four rows, of which the last may be left out, or all their numbers in one
/// list, row by row.
pub(crate) fn rows(value: &Value) -> Result<[[f64; 4]; 4], FrameProblem> {
    let list = value.as_array().map_or(&[][..], Vec::as_slice);
    let entries = || list.iter().flat_map(|row| row.as_array().map_or(slice::from_ref(row), Vec::as_slice));
    if let Some(entry) = entries().find(|entry| !entry.is_number()) {
        let reason = format!("holds {}, which is no number", printable(&entry.to_string()));
        return Err(FrameProblem::Matrix(reason.into()));
    }
    let are_rows = list.iter().all(|row| row.as_array().is_some_and(|row| row.len() == 4));
    let numbers: Vec<f64> = entries().filter_map(Value::as_f64).collect();
    if !(matches!(numbers.len(), 12 | 16) && (are_rows || list.len() == numbers.len())) {
        return Err(fault(FORM));
    }
    let mut rows = DMat4::IDENTITY.to_cols_array_2d();
    for (row, numbers) in rows.iter_mut().zip(numbers.chunks_exact(4)) {
        row.copy_from_slice(numbers);
    }
    Ok(rows)
}

/// Returns the matrix with these rows, which must be finite and affine, and turn, move and scale alone.
pub(crate) fn pose(rows: &[[f64; 4]; 4]) -> Result<DMat4, FrameProblem> {
    let matrix = DMat4::from_cols_array_2d(rows).transpose();
    if !matrix.is_finite() {
        return Err(fault("holds a value that is not finite"));
    }
    if !matrix.row(3).abs_diff_eq(DVec4::W, 1e-6) {
        return Err(fault("must end in the row 0 0 0 1"));
    }
    if !is_invertible(matrix) {
        return Err(fault("cannot be inverted"));
    }
    let linear = DMat3::from_mat4(matrix);
    if linear.determinant() < 0.0 {
        return Err(fault(MIRRORED));
    }
    let turn = linear * (1.0 / scale(&matrix));
    let is_turn = (turn.transpose() * turn).abs_diff_eq(DMat3::IDENTITY, ROUNDED);
    if is_turn { Ok(matrix) } else { Err(fault(SHEARED)) }
}

/// Returns the world-to-camera matrix of a rotation (w, x, y, z; of any length but 0) and a translation.
pub(crate) fn of_rotation([w, x, y, z]: [f64; 4], translation: [f64; 3]) -> Result<DMat4, FrameProblem> {
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let length = quaternion.length();
    if !(length.is_finite() && length > f64::MIN_POSITIVE) {
        return Err(fault("has a rotation of length 0, or one that is not finite"));
    }
    let quaternion = DQuat::from_vec4(DVec4::from(quaternion) / length);
    let matrix = DMat4::from_rotation_translation(quaternion.normalize(), DVec3::from(translation));
    if matrix.is_finite() { Ok(matrix) } else { Err(fault("holds a value that is not finite")) }
}

/// Returns the world-to-camera matrix of a camera with OpenGL's axes (right, up, backwards), from its matrix to the
/// world.
pub(crate) fn of_opengl(mut camera_to_world: DMat4) -> DMat4 {
    // To OpenCV's axes: the camera's y and z are negated.
    camera_to_world.y_axis = -camera_to_world.y_axis;
    camera_to_world.z_axis = -camera_to_world.z_axis;
    camera_to_world.inverse()
}

/// Returns the factor by which a matrix scales.
pub(crate) fn scale(matrix: &DMat4) -> f64 {
    DMat3::from_mat4(*matrix).determinant().abs().cbrt()
}

/// Returns a world-to-camera matrix without its scale. The camera stays at its place.
pub(crate) fn unscaled(world_to_camera: DMat4, scale: f64) -> DMat4 {
    DMat4::from_scale(DVec3::splat(1.0 / scale)) * world_to_camera
}

/// Returns the place of a camera in the world.
pub(crate) fn center(world_to_camera: &DMat4) -> DVec3 {
    world_to_camera.inverse().w_axis.truncate()
}

/// Returns the world-to-camera matrix for a world whose places are counted from an origin.
pub(crate) fn counted_from(origin: DVec3, world_to_camera: DMat4) -> DMat4 {
    // Without an origin every bit stays as it is, also that of minus 0.
    if origin == DVec3::ZERO { world_to_camera } else { world_to_camera * DMat4::from_translation(origin) }
}

/// Narrows a matrix, which must stay finite and invertible.
pub(crate) fn single_precision(matrix: DMat4) -> Result<Mat4, FrameProblem> {
    let narrow = matrix.as_mat4();
    let usable = narrow.is_finite() && is_invertible(narrow.as_dmat4());
    if usable { Ok(narrow) } else { Err(fault("is too large or too small for float32")) }
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
    use serde_json::json;

    const IDENTITY: [[f64; 4]; 4] =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

    fn refusal(rows: &[[f64; 4]; 4]) -> String {
        pose(rows).expect_err("the matrix is refused").to_string()
    }

    #[test]
    fn poses_must_be_finite_affine_and_invertible() {
        let with = |row: usize, column: usize, value: f64| {
            let mut rows = IDENTITY;
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
    fn poses_must_be_turns_of_one_scale() {
        let turned = DMat4::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.1);
        let rows = |matrix: DMat4| matrix.transpose().to_cols_array_2d();
        let narrow = turned.as_mat4().as_dmat4();
        let rounded = DMat4::from_cols_array(&turned.to_cols_array().map(|value| (value * 1000.0).round() / 1000.0));
        for accepted in [turned, narrow, rounded, turned * DMat4::from_scale(DVec3::splat(40.0))] {
            assert_eq!(pose(&rows(accepted)).expect("a turn of one scale"), accepted, "the matrix stays as it is");
        }
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let mirrored = refusal(&rows(turned * DMat4::from_scale(DVec3::ONE - 2.0 * axis)));
            assert!(mirrored.contains("mirrors"), "a reflection is refused: {mirrored}");
            let stretched = refusal(&rows(turned * DMat4::from_scale(DVec3::ONE + 0.01 * axis)));
            assert!(stretched.contains("stretched"), "a scale along one axis is refused: {stretched}");
        }
        let mut sheared = IDENTITY;
        sheared[0][1] = 0.01;
        assert!(refusal(&sheared).contains("sheared"), "a shear is refused");
    }

    #[test]
    fn matrices_have_twelve_or_sixteen_numbers() {
        let whole = json!([[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]);
        let flat = json!([1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1]);
        let expected = rows(&whole).expect("four rows");
        assert_eq!(expected[1], [0.0, 1.0, 0.0, 6.0], "the second row");
        let first = |value: &Value, count: usize| Value::from(value.as_array().expect("a list")[..count].to_vec());
        for value in [first(&whole, 3), flat.clone(), first(&flat, 12)] {
            assert_eq!(rows(&value).expect("the same rows"), expected, "{value}");
        }
        for (value, part) in [
            (Value::Null, "four rows"),
            (json!([]), "four rows"),
            (json!({"a": 1}), "four rows"),
            (first(&whole, 2), "four rows"),
            (first(&flat, 9), "four rows"),
            (json!([[1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 6, 7]]), "four rows"),
            (json!([[1, 0, 0, 5], 0, 1, 0, 6, 0, 0, 1, 7]), "four rows"),
            (json!([[1, 0, 0, null]]), "null"),
            (json!([[[1]]]), "[1], which is no number"),
            (json!(["NaN in line 3"]), "NaN in line 3"),
        ] {
            let reason = rows(&value).expect_err("no matrix").to_string();
            assert!(reason.contains(part), "{value}: {part:?} is not in: {reason}");
        }
    }

    #[test]
    fn scales_are_undone_and_origins_subtracted() {
        let place = DVec3::new(500_000.0, 5_400_000.0, 300.0);
        let to_world = DMat4::from_rotation_translation(DQuat::from_rotation_y(0.7), place);
        let scaled = (to_world * DMat4::from_scale(DVec3::splat(2.5))).inverse();
        assert!((scale(&scaled) - 0.4).abs() < 1e-12, "the scale of the inverse matrix");
        let found = unscaled(scaled, scale(&scaled));
        assert!(found.abs_diff_eq(to_world.inverse(), 1e-6), "a turn: {found}");
        assert!(center(&found).abs_diff_eq(place, 1e-6), "the place of the camera stays: {}", center(&found));
        let moved = counted_from(place - DVec3::X, found);
        assert!(center(&moved).abs_diff_eq(DVec3::X, 1e-6), "one unit from the origin: {}", center(&moved));
        let minus = DMat4::from_translation(DVec3::new(-0.0, 1.0, 2.0));
        let bits = |matrix: DMat4| matrix.to_cols_array().map(f64::to_bits);
        assert_eq!(bits(counted_from(DVec3::ZERO, minus)), bits(minus), "no origin changes no bit");
    }

    #[test]
    fn rotations_are_normalized_and_may_not_be_zero() {
        let turned = of_rotation([2.0, 0.0, 0.0, 2.0], [1.0, 2.0, 3.0]).expect("a rotation of length 2.8");
        let found = turned.transform_point3(DVec3::X);
        assert!(found.abs_diff_eq(DVec3::new(1.0, 3.0, 3.0), 1e-12), "a quarter turn about z: {found}");
        for rotation in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0, 1.0]] {
            assert!(of_rotation(rotation, [0.0; 3]).is_err(), "{rotation:?} is refused");
        }
    }
}
