//! Affine maps of Gaussians: rotation, mirroring, scale, translation.
//!
//! In: [`Columns`] and an affine map. Out: the columns in the space that the map leads to, exactly, except that a map
//! which shears or stretches rotates view-dependent colors by the nearest rotation.

use super::columns::Columns;
use super::error::ImportError;
use crate::gaussian::eigen::eigen;
use crate::gaussian::rotate_harmonics::rotate_harmonics;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4};
use rayon::prelude::*;

/// Largest difference between `RᵀR` and 1 for a rotation: transforms in files are in single precision.
const ORTHOGONAL: f64 = 1e-5;

/// Smallest variance of a Gaussian that a map has flattened, relative to its largest.
const FLATTEST: f64 = 1e-14;

/// Maps Gaussians to another space, which has an origin of its own. Returns whether the colors are exact, too.
///
/// # Errors
/// A map that is not finite or flattens space.
pub(crate) fn place(columns: &mut Columns, map: &DAffine3) -> Result<bool, ImportError> {
    let linear = map.matrix3;
    let determinant = linear.determinant();
    if !map.is_finite() || !determinant.is_finite() || determinant == 0.0 {
        return Err(ImportError::damaged("a transformation that is not finite or flattens space"));
    }
    if *map == DAffine3::IDENTITY {
        return Ok(true);
    }
    columns.origin = [0.0; 3];
    columns.mean.par_iter_mut().for_each(|mean| {
        *mean = map.transform_point3(DVec3::from(mean.map(f64::from))).as_vec3().to_array();
    });
    columns.motion.par_iter_mut().for_each(|motion| {
        motion.velocity = (linear * DVec3::from(motion.velocity.map(f64::from))).as_vec3().to_array();
    });
    let scale = determinant.abs().cbrt();
    let turn = linear * scale.recip();
    let is_turn = (turn.transpose() * turn).abs_diff_eq(DMat3::IDENTITY, ORTHOGONAL);
    if is_turn {
        turn_shapes(columns, turn, scale.ln() as f32);
        rotate_harmonics(&mut columns.harmonics, turn);
    } else {
        stretch_shapes(columns, linear);
        rotate_harmonics(&mut columns.harmonics, nearest_turn(linear));
    }
    Ok(is_turn || columns.harmonics.degree == 0)
}

/// Turns and scales covariances by an orthogonal matrix and a factor.
fn turn_shapes(columns: &mut Columns, turn: DMat3, log_scale: f32) {
    // An ellipsoid is symmetric about its center: `-turn` maps it as `turn` does, and is a rotation if `turn` mirrors.
    let turn = if turn.determinant() < 0.0 { -turn } else { turn };
    let turn = DQuat::from_mat3(&turn).normalize();
    columns.rotation.par_iter_mut().for_each(|rotation| *rotation = from_quat(turn * to_quat(*rotation)));
    columns.log_scale.par_iter_mut().for_each(|scale| *scale = scale.map(|scale| scale + log_scale));
}

/// Maps covariances `C` to `A C Aᵀ`.
fn stretch_shapes(columns: &mut Columns, linear: DMat3) {
    let shapes = columns.rotation.par_iter_mut().zip(&mut columns.log_scale);
    shapes.for_each(|(rotation, log_scale)| {
        let quat = to_quat(*rotation);
        // A rotation of length zero is refused where all Gaussians are checked.
        if !(quat.length_squared() > 0.0 && quat.is_finite()) {
            return;
        }
        let largest = log_scale.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let scale = DVec3::from(log_scale.map(|scale| f64::from(scale - largest).exp()));
        let factor = linear * DMat3::from_quat(quat.normalize()) * DMat3::from_diagonal(scale);
        let (variances, axes) = eigen(DMat4::from_mat3(factor * factor.transpose()));
        let variances = variances.truncate();
        let floor = variances.max_element() * FLATTEST;
        *log_scale = variances.to_array().map(|variance| (0.5 * variance.max(floor).ln()) as f32 + largest);
        let axes = DMat3::from_mat4(axes);
        let axes = if axes.determinant() < 0.0 { -axes } else { axes };
        *rotation = from_quat(DQuat::from_mat3(&axes));
    });
}

/// Returns the orthogonal matrix nearest to a matrix: `A (AᵀA)^(−1/2)`.
fn nearest_turn(linear: DMat3) -> DMat3 {
    let (squares, axes) = eigen(DMat4::from_mat3(linear.transpose() * linear));
    let inverse = squares.max(DVec4::splat(f64::MIN_POSITIVE)).map(|square| square.sqrt().recip());
    linear * DMat3::from_mat4(axes * DMat4::from_diagonal(inverse) * axes.transpose())
}

fn to_quat([w, x, y, z]: [f32; 4]) -> DQuat {
    DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into())
}

fn from_quat(quat: DQuat) -> [f32; 4] {
    [quat.w, quat.x, quat.y, quat.z].map(|component| component as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::columns::Motion;
    use crate::codec::import::testing::gaussians_of_columns;
    use crate::gaussian::Harmonics;

    fn columns() -> Columns {
        Columns {
            mean: vec![[1.0, 2.0, 3.0], [-0.5, 0.25, 0.0]],
            log_scale: vec![[-1.0, -3.0, -2.0], [0.5, -6.0, -0.25]],
            rotation: vec![[0.8, 0.2, -0.4, 0.1], [-0.3, 1.5, 0.7, -2.0]],
            opacity_logit: vec![0.5, -1.0],
            harmonics: Harmonics {
                coefficients: 4,
                degree: 1,
                degree_t: 0,
                values: (0..24_u8).map(|i| f32::from(i) / 24.0).collect(),
            },
            motion: vec![Motion { velocity: [1.0, 0.0, 2.0], mean_t: 0.25, sigma_t: 0.5 }; 2],
            ..Columns::default()
        }
    }

    fn covariances(columns: &Columns) -> Vec<DMat3> {
        let matrix = |[xx, xy, xz, yy, yz, zz]: [f64; 6]| DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        gaussians_of_columns(columns).iter().map(|gaussian| matrix(gaussian.covariance.map(f64::from))).collect()
    }

    #[test]
    fn covariances_means_and_velocities_follow_every_map() {
        let turn = DMat3::from_quat(DQuat::from_xyzw(0.1, 0.7, -0.4, 0.5).normalize());
        let mirror = DMat3::from_diagonal(DVec3::new(-2.0, 2.0, 2.0));
        let stretch = DMat3::from_cols_array(&[2.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.3, -0.25]);
        for (linear, is_exact) in [(turn, true), (turn * mirror, true), (stretch, false), (turn * stretch, false)] {
            let map = DAffine3::from_mat3_translation(linear, DVec3::new(1.0, -2.0, 0.5));
            let (before, mut after) = (columns(), Columns { origin: [5e5, 0.0, 7.0], ..columns() });
            assert_eq!(place(&mut after, &map).expect("a valid map"), is_exact, "whether the colors are exact");
            for ((found, expected), scale) in covariances(&after).iter().zip(covariances(&before)).zip([0.1, 3.0]) {
                let expected = linear * expected * linear.transpose();
                assert!(found.abs_diff_eq(expected, 1e-5 * scale), "{found}, not {expected}");
            }
            let mean = map.transform_point3(DVec3::new(1.0, 2.0, 3.0)).as_vec3().to_array();
            assert_eq!(after.mean[0], mean, "the mean is mapped");
            assert_eq!(after.origin, [0.0; 3], "the coordinates of the files are left");
            let velocity = (linear * DVec3::new(1.0, 0.0, 2.0)).as_vec3().to_array();
            assert_eq!(after.motion[1].velocity, velocity, "the velocity is mapped without the translation");
        }
    }

    #[test]
    fn a_map_that_flattens_space_is_refused() {
        for linear in [DMat3::ZERO, DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0)), DMat3::IDENTITY * f64::NAN] {
            let map = DAffine3::from_mat3(linear);
            assert!(place(&mut columns(), &map).is_err(), "{linear} has no inverse");
        }
    }

    #[test]
    fn the_rotation_nearest_to_a_stretched_rotation_is_that_rotation() {
        let turn = DMat3::from_quat(DQuat::from_xyzw(0.1, 0.7, -0.4, 0.5).normalize());
        for turn in [turn, -turn] {
            let found = nearest_turn(turn * DMat3::from_diagonal(DVec3::new(1.0, 3.0, 0.2)));
            assert!(found.abs_diff_eq(turn, 1e-9), "{found}, not {turn}");
        }
    }
}
