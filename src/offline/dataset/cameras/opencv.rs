//! Cameras as OpenCV describes them.
//!
//! In: a camera matrix K, coefficients of distortion, a rotation and a translation from the world to the camera. Out:
//! lens, distortion and pose, or the fault. Principal points are left as they are: OpenCV counts them from the middle
//! of the first pixel, other programs from its corner.

use super::distortion::Distortion;
use super::lens::OriginalLens;
use super::pose::pose;
use crate::offline::dataset::FrameProblem;
use glam::{DMat3, DMat4, DQuat, DVec2, DVec3};

/// Largest skew that counts as 0, in focal lengths.
const STRAIGHT: f64 = 1e-6;
/// Numbers of coefficients that OpenCV writes, and none.
const COUNTS: [usize; 6] = [0, 4, 5, 8, 12, 14];
/// Coefficients that can be undone, from the first: k1, k2, p1, p2, k3, k4, k5 and k6.
const UNDONE: usize = 8;

/// The middle of the first pixel, for which OpenCV writes 0.
const MIDDLE: f64 = 0.5;

/// Returns the lens of a camera matrix of OpenCV, row by row, whose center counts from the middle of the first pixel.
pub(crate) fn own_lens(matrix: &[f64; 9]) -> Result<OriginalLens, FrameProblem> {
    let mut from_corner = *matrix;
    // The third column of the first two rows.
    from_corner[2] += MIDDLE;
    from_corner[5] += MIDDLE;
    lens(&from_corner)
}

/// Returns the lens of a camera matrix, row by row, whose center counts from the corner of the first pixel.
pub(crate) fn lens(matrix: &[f64; 9]) -> Result<OriginalLens, FrameProblem> {
    let &[fx, skew, cx, below, fy, cy, a, b, c] = matrix;
    if !matrix.iter().all(|value| value.is_finite()) {
        return Err(FrameProblem::Lens);
    }
    if [below, a, b, c] != [0.0, 0.0, 0.0, 1.0] {
        return Err(FrameProblem::Matrix("K must have the rows fx 0 cx, 0 fy cy and 0 0 1".into()));
    }
    if skew.abs() > STRAIGHT * fx.abs() {
        return Err(FrameProblem::Distorted { entry: "the skew of K", value: skew.to_string() });
    }
    Ok(OriginalLens::Intrinsics { focal: DVec2::new(fx, fy), center: DVec2::new(cx, cy) })
}

/// Returns the distortion of coefficients in the order k1, k2, p1, p2, k3, k4, k5, k6, and others, which must be 0.
pub(crate) fn distortion(coefficients: &[f64]) -> Result<Distortion, FrameProblem> {
    if !coefficients.iter().all(|value| value.is_finite()) {
        return Err(FrameProblem::Lens);
    }
    let are_zero = |values: &[f64]| values.iter().all(|value| *value == 0.0);
    let is_undone = COUNTS.contains(&coefficients.len()) && are_zero(coefficients.get(UNDONE..).unwrap_or_default());
    if !is_undone && !are_zero(coefficients) {
        return Err(FrameProblem::Coefficients(coefficients.len()));
    }
    let at = |index: usize| coefficients.get(index).copied().unwrap_or(0.0);
    Ok(Distortion {
        fisheye: false,
        radial: [at(0), at(1), at(4), 0.0],
        denominator: [at(5), at(6), at(7)],
        tangential: [at(2), at(3)],
    })
}

/// Returns the world-to-camera matrix of a rotation about a vector by its length, in radians (Rodrigues), and a
/// translation.
pub(crate) fn pose_of_vector(rotation: [f64; 3], translation: [f64; 3]) -> Result<DMat4, FrameProblem> {
    let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::from(rotation)));
    pose_of_rows(&turn.transpose().to_cols_array(), translation)
}

/// Returns the world-to-camera matrix of a rotation, whose numbers are row by row, and a translation.
pub(crate) fn pose_of_rows(rotation: &[f64; 9], translation: [f64; 3]) -> Result<DMat4, FrameProblem> {
    let &[a, b, c, d, e, f, g, h, i] = rotation;
    let [x, y, z] = translation;
    pose(&[[a, b, c, x], [d, e, f, y], [g, h, i, z], [0.0, 0.0, 0.0, 1.0]])
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: [f64; 9] = [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0];

    fn with(index: usize, value: f64) -> [f64; 9] {
        let mut changed = K;
        changed[index] = value;
        changed
    }

    #[test]
    fn camera_matrices_without_skew_are_lenses() {
        let found = lens(&with(1, 1e-5)).expect("a skew of a rounded number");
        let OriginalLens::Intrinsics { focal, center } = found else { panic!("intrinsics: {found:?}") };
        assert_eq!((focal, center), (DVec2::new(500.0, 510.0), DVec2::new(320.0, 240.0)), "the entries");
        for (index, value, part) in
            [(1, 2.0, "the skew of K is not 0 but 2"), (3, 1.0, "rows"), (8, 2.0, "rows"), (4, f64::NAN, "finite")]
        {
            let error = lens(&with(index, value)).expect_err(part).to_string();
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }

    #[test]
    fn coefficients_have_the_order_of_opencv() {
        let expected = Distortion {
            fisheye: false,
            radial: [0.1, 0.2, 0.5, 0.0],
            denominator: [0.6, 0.7, 0.8],
            tangential: [0.3, 0.4],
        };
        let eight = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];
        assert_eq!(distortion(&eight).expect("eight coefficients"), expected, "k1, k2, p1, p2, k3, k4, k5, k6");
        let twelve = [&eight[..], &[0.0; 4]].concat();
        assert_eq!(distortion(&twelve).expect("no prism"), expected, "others that are 0");
        let four = Distortion { radial: [0.1, 0.2, 0.0, 0.0], denominator: [0.0; 3], ..expected };
        assert_eq!(distortion(&eight[..4]).expect("four coefficients"), four, "k3 is 0");
        for none in [&[][..], &[0.0; 6], &[0.0; 5]] {
            assert_eq!(distortion(none).expect("no distortion"), Distortion::default(), "{none:?}");
        }
        for refused in [&eight[..3], &[&eight[..], &[0.0, 0.1, 0.0, 0.0]].concat()[..], &[f64::NAN; 4]] {
            assert!(distortion(refused).is_err(), "{refused:?} is refused");
        }
    }

    #[test]
    fn vectors_turn_about_themselves_by_their_length() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let found = pose_of_vector([0.0, 0.0, quarter], [1.0, 2.0, 3.0]).expect("a quarter turn about z");
        let point = found.transform_point3(DVec3::X);
        assert!(point.abs_diff_eq(DVec3::new(1.0, 3.0, 3.0), 1e-12), "x is turned to y, then moved: {point}");
        let same = pose_of_rows(&[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.0]).expect("a rotation");
        assert!(found.abs_diff_eq(same, 1e-12), "the same rotation as a matrix: {same}");
        assert_eq!(pose_of_vector([0.0; 3], [0.0; 3]).expect("no turn"), DMat4::IDENTITY, "a vector of length 0");
        for wrong in [f64::NAN, f64::INFINITY, 1e300] {
            assert!(pose_of_vector([wrong, 0.0, 0.0], [0.0; 3]).is_err(), "{wrong} is refused");
        }
    }
}
