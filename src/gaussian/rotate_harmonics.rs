//! Rotation of the colors of Gaussians.
//!
//! In: colors and a rotation or reflection of space. Out: colors that have in each rotated direction the value of the
//! given colors in the direction before the rotation.
//!
//! The harmonics of one degree at `R d` are linear combinations of those at `d`, `Y(R d) = D Y(d)`. They are
//! orthonormal, so `D = ∫ Y(R d) Y(d)ᵀ`, an integral of polynomials of at most degree 6 over the sphere, for which 32
//! directions suffice: four heights by Gauss and Legendre, eight angles each. `D` is orthogonal, and the coefficients
//! `D c` have at `R d` the color of `c` at `d`.

use super::harmonics::{Harmonics, basis};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_4, TAU};

/// Heights on the unit sphere and their weights, which integrate polynomials up to degree 7 from −1 to 1.
const HEIGHTS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_8),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_8),
];

/// Number of angles around each height.
const ANGLES: u32 = 8;

/// Entries closer than this to 0, 1 or −1 are rounded to these numbers, so that an exchange of axes is exact.
const EXACT: f64 = 1e-6;

/// Rotates colors by an orthogonal matrix, which may include a reflection.
pub(crate) fn rotate_harmonics(harmonics: &mut Harmonics, turn: DMat3) {
    let degree = (harmonics.degree as usize).min(3);
    let stride = harmonics.coefficients * 3;
    if degree == 0 || stride == 0 || turn == DMat3::IDENTITY {
        return;
    }
    let matrix = matrix(turn);
    // One block for each harmonic in time.
    let blocks = harmonics.evaluated() / (degree + 1).pow(2);
    harmonics.values.par_chunks_exact_mut(stride).for_each(|values| {
        for block in values.chunks_mut(16 * 3).take(blocks) {
            for l in 1..=degree {
                rotate_band(block, l, &matrix);
            }
        }
    });
}

/// Rotates the coefficients of degree `l` in a block of coefficients.
fn rotate_band(block: &mut [f32], l: usize, matrix: &[[f32; 16]; 16]) {
    let (first, end) = (l * l, (l + 1) * (l + 1));
    let mut turned = [[0.0_f32; 3]; 7];
    for (to, row) in turned.iter_mut().zip(&matrix[first..end]) {
        for (factor, from) in row[first..end].iter().zip(block[first * 3..].chunks_exact(3)) {
            for (sum, value) in to.iter_mut().zip(from) {
                *sum += factor * value;
            }
        }
    }
    let turned = turned.as_flattened();
    block[first * 3..end * 3].copy_from_slice(&turned[..(end - first) * 3]);
}

/// Returns the block-diagonal matrix of all degrees; its zero entries between degrees are not used.
fn matrix(turn: DMat3) -> [[f32; 16]; 16] {
    let mut sums = [[0.0_f64; 16]; 16];
    for (z, weight) in HEIGHTS {
        let radius = (1.0 - z * z).sqrt();
        for angle in 0..ANGLES {
            let (sin, cos) = (f64::from(angle) * FRAC_PI_4).sin_cos();
            let direction = DVec3::new(radius * cos, radius * sin, z);
            let (before, after) = (basis(direction.as_vec3()), basis((turn * direction).as_vec3()));
            for (row, after) in sums.iter_mut().zip(after) {
                for (sum, before) in row.iter_mut().zip(before) {
                    *sum += weight * TAU / f64::from(ANGLES) * f64::from(after) * f64::from(before);
                }
            }
        }
    }
    sums.map(|row| row.map(|entry| if (entry - entry.round()).abs() < EXACT { entry.round() } else { entry } as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, Vec3};

    fn colors(degree: u32, degree_t: u32, coefficients: usize) -> Harmonics {
        let values = (0..2 * coefficients * 3).map(|i| ((i * 37 % 101) as f32 / 101.0 - 0.5) * 0.2).collect();
        let mut harmonics = Harmonics { coefficients, degree, degree_t, values };
        // Bright, so that no color is clamped at 0.
        for values in harmonics.values.chunks_exact_mut(coefficients * 3) {
            values[..3].fill(6.0);
        }
        harmonics
    }

    #[test]
    fn rotated_colors_seen_in_a_rotated_direction_are_unchanged() {
        let turn = DMat3::from_quat(DQuat::from_xyzw(0.3, -0.5, 0.1, 0.8).normalize());
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        let exchange = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        for turn in [turn, turn * mirror, mirror, exchange, flip, -DMat3::IDENTITY] {
            for (degree, degree_t, coefficients) in [(0, 0, 1), (1, 0, 4), (2, 0, 16), (3, 0, 16), (3, 2, 48)] {
                let before = colors(degree, degree_t, coefficients);
                let mut after = before.clone();
                rotate_harmonics(&mut after, turn);
                for i in 0..40_u8 {
                    let direction = Vec3::new(f32::from(i).sin(), f32::from(i * 3).cos(), f32::from(i) / 20.0 - 1.0);
                    let direction = direction.normalize();
                    let turned = (turn * direction.as_dvec3()).as_vec3();
                    let (seen, expected) = (after.color(1, turned, 0.1, 1.0), before.color(1, direction, 0.1, 1.0));
                    assert!(
                        seen.abs_diff_eq(expected, 2e-6),
                        "degree {degree}, {degree_t} in time: {seen}, not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_half_turn_about_an_axis_changes_only_signs() {
        let before = colors(3, 0, 16);
        let mut after = before.clone();
        rotate_harmonics(&mut after, DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)));
        for (index, (after, before)) in after.values.iter().zip(&before.values).enumerate() {
            assert_eq!(after.abs(), before.abs(), "value {index} changes only its sign");
        }
        let signs: Vec<f32> = (0..16).map(|k| (after.values[k * 3] / before.values[k * 3]).signum()).collect();
        let expected = [1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1].map(|sign: i8| f32::from(sign));
        assert_eq!(signs, expected, "harmonics that are odd in y and z together change their signs");
    }
}
