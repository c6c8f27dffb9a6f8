//! FLIP: how different two pictures look when one flips between them (Andersson et al. 2020, for pictures of low
//! dynamic range).
//!
//! In: two pictures, sRGB-encoded, values 0 to 1. Out: the mean of their FLIP map, 0 (same) to 1, seen at 67 pixels per
//! degree: a 4K monitor 0.7 m wide from 0.7 m away.
//!
//! Two measures are combined. Color: the pictures filtered by the contrast sensitivity of the eye (in YCxCz), compared
//! in a Hunt-adjusted L\*a\*b\* by the HyAB distance. Features: edges and points of the luminance, which make a
//! difference of color more visible.

use std::f64::consts::{PI, SQRT_2};
use std::ops::{Add, Mul};
use std::sync::LazyLock;

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::size_mismatch::{SizeMismatch, check_sizes};
use crate::view::Picture;

const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;
/// The contrast sensitivity of luminance, red–green and blue–yellow: sums of Gaussians `a sqrt(π/b) exp(−π² x²/b)`, x
/// in degrees. Only the last has a second one.
const SENSITIVITY: [(DVec3, DVec3); 2] = [
    (DVec3::new(1.0, 1.0, 34.1), DVec3::new(0.0047, 0.0053, 0.04)),
    (DVec3::new(0.0, 0.0, 13.5), DVec3::new(0.025, 0.025, 0.025)),
];
/// The largest `b` of them, which sets the width of the filters.
const WIDEST: f64 = 0.04;
/// Width of the eye's edge detector, in degrees from peak to trough.
const DETECTOR_WIDTH: f64 = 0.082;
/// Exponent of the difference of color.
const COLOR_EXPONENT: f64 = 0.7;
/// Fraction of the largest difference of color at which the scale bends; it is mapped to `BEND_TO`.
const BEND_AT: f64 = 0.4;
const BEND_TO: f64 = 0.95;
/// Exponent of the difference of edges and points.
const FEATURE_EXPONENT: f64 = 0.5;

/// Returns the mean FLIP of `test` against `reference`, 0 to 1 for values within 0 to 1. Symmetric.
///
/// # Errors
/// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
pub fn flip(reference: &Picture, test: &Picture) -> Result<f64, SizeMismatch> {
    check_sizes(reference, test)?;
    let (a, b) = (Filtered::of(reference), Filtered::of(test));
    let largest = largest_distance();
    let differences = a.colors.iter().zip(&b.colors).zip(a.features.iter().zip(&b.features)).map(|((p, q), (f, g))| {
        let color = bent(hyab(*p, *q).powf(COLOR_EXPONENT), largest);
        let feature = ((*f - *g).abs().max_element() / SQRT_2).powf(FEATURE_EXPONENT);
        color.powf(1.0 - feature)
    });
    Ok(differences.sum::<f64>() / reference.pixels.len() as f64)
}

/// A picture after the filters of the eye.
struct Filtered {
    /// Filtered colors, Hunt-adjusted L\*a\*b\*.
    colors: Vec<DVec3>,
    /// Strength of edges and of points.
    features: Vec<DVec2>,
}

impl Filtered {
    fn of(picture: &Picture) -> Self {
        let width = picture.size.x as usize;
        let opponent: Vec<DVec3> = picture.pixels.par_iter().map(|p| opponent(linear(p.as_dvec3()))).collect();
        let filtered = SENSITIVITY.into_iter().map(|(height, spread)| {
            let (weights, total) = sensitivity(height, spread);
            let mut part = separable(&opponent, width, &weights, &weights);
            part.par_iter_mut().for_each(|p| *p *= total);
            part
        });
        let filtered = filtered.reduce(|mut sum, part| {
            sum.par_iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
            sum
        });
        let color = |p: DVec3| hunt(lab(from_opponent(p).clamp(DVec3::ZERO, DVec3::ONE)));
        Self {
            colors: filtered.unwrap_or_default().into_par_iter().map(color).collect(),
            features: features(&opponent, width),
        }
    }
}

/// Returns the weights of one Gaussian per channel along an axis, and the factor on their product over both axes with
/// which the sum of both Gaussians over the plane is one.
fn sensitivity(height: DVec3, spread: DVec3) -> (Vec<DVec3>, DVec3) {
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let gaussian = |spread: DVec3| -> Vec<DVec3> {
        let weight = |x: i32| (-(PI * f64::from(x) / PIXELS_PER_DEGREE).powi(2) * spread.recip()).exp();
        (-radius..=radius).map(weight).collect()
    };
    let amplitude = |height: DVec3, spread: DVec3| height * (PI * spread.recip()).map(f64::sqrt);
    let total = SENSITIVITY.into_iter().map(|(height, spread)| {
        let along: DVec3 = gaussian(spread).into_iter().sum();
        amplitude(height, spread) * along * along
    });
    (gaussian(spread), amplitude(height, spread) / total.sum::<DVec3>())
}

/// Returns the strength of edges (x) and points (y) of the luminance of opponent colors.
fn features(opponent: &[DVec3], width: usize) -> Vec<DVec2> {
    let deviation = 0.5 * DETECTOR_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i32;
    let weights = |value: fn(f64) -> f64| -> Vec<f64> {
        (-radius..=radius).map(|x| f64::from(x) / deviation).map(|x| value(x) * (-0.5 * x * x).exp()).collect()
    };
    let smooth = balanced(weights(|_| 1.0)).into_iter().map(DVec2::splat).collect::<Vec<_>>();
    let (slope, bend) = (balanced(weights(|x| -x)), balanced(weights(|x| x * x - 1.0)));
    let detector: Vec<DVec2> = slope.into_iter().zip(bend).map(DVec2::from).collect();
    let luminance: Vec<DVec2> = opponent.iter().map(|p| DVec2::splat((p.x + 16.0) / 116.0)).collect();
    let across = separable(&luminance, width, &detector, &smooth);
    let down = separable(&luminance, width, &smooth, &detector);
    across.into_par_iter().zip(down).map(|(x, y)| (x * x + y * y).map(f64::sqrt)).collect()
}

/// Returns the weights with the sum of their positive part scaled to 1 and that of their negative part to −1.
fn balanced(mut weights: Vec<f64>) -> Vec<f64> {
    let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = -weights.iter().filter(|w| **w < 0.0).sum::<f64>();
    weights.iter_mut().for_each(|w| *w /= if *w < 0.0 { negative } else { positive });
    weights
}

/// Filters along rows, then along columns; the outermost pixels are repeated beyond the border.
fn separable<T>(image: &[T], width: usize, across: &[T], down: &[T]) -> Vec<T>
where
    T: Copy + Default + Send + Sync + Add<Output = T> + Mul<Output = T>,
{
    let height = image.len() / width;
    let along_row = |i: usize| weighted(across, i % width, width, |x| image[i / width * width + x]);
    let rows: Vec<T> = (0..image.len()).into_par_iter().map(along_row).collect();
    let along_column = |i: usize| weighted(down, i / width, height, |y| rows[y * width + i % width]);
    (0..image.len()).into_par_iter().map(along_column).collect()
}

/// Returns the weighted sum of the values `at` the positions about `center`.
fn weighted<T>(weights: &[T], center: usize, length: usize, at: impl Fn(usize) -> T) -> T
where
    T: Copy + Default + Add<Output = T> + Mul<Output = T>,
{
    let radius = weights.len() / 2;
    weights
        .iter()
        .enumerate()
        .fold(T::default(), |sum, (i, &weight)| sum + weight * at((center + i).saturating_sub(radius).min(length - 1)))
}

/// Converts an sRGB-encoded color to linear RGB.
fn linear(color: DVec3) -> DVec3 {
    color.map(|v| if v > 0.04045 { ((v + 0.055) / 1.055).powf(2.4) } else { v / 12.92 })
}

/// Linear RGB to XYZ relative to the white of D65.
static TO_XYZ: LazyLock<DMat3> = LazyLock::new(|| {
    let to_xyz = DMat3::from_cols(
        DVec3::new(10_135_552.0 / 24_577_794.0, 2_613_072.0 / 12_288_897.0, 1_425_312.0 / 73_733_382.0),
        DVec3::new(8_788_810.0 / 24_577_794.0, 8_788_810.0 / 12_288_897.0, 8_788_810.0 / 73_733_382.0),
        DVec3::new(4_435_075.0 / 24_577_794.0, 887_015.0 / 12_288_897.0, 70_074_185.0 / 73_733_382.0),
    );
    let white = to_xyz * DVec3::ONE;
    DMat3::from_diagonal(white.recip()) * to_xyz
});
static FROM_XYZ: LazyLock<DMat3> = LazyLock::new(|| TO_XYZ.inverse());

/// Converts linear RGB to YCxCz.
fn opponent(color: DVec3) -> DVec3 {
    let DVec3 { x, y, z } = *TO_XYZ * color;
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Converts YCxCz to linear RGB.
fn from_opponent(color: DVec3) -> DVec3 {
    let y = (color.x + 16.0) / 116.0;
    *FROM_XYZ * DVec3::new(y + color.y / 500.0, y, y - color.z / 200.0)
}

/// Converts linear RGB to L\*a\*b\*.
fn lab(color: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let bent = |v: f64| if v > DELTA.powi(3) { v.cbrt() } else { v / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let DVec3 { x, y, z } = (*TO_XYZ * color).map(bent);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Applies the Hunt effect: colors look stronger the lighter they are.
fn hunt(lab: DVec3) -> DVec3 {
    let strength = 0.01 * lab.x;
    DVec3::new(lab.x, strength * lab.y, strength * lab.z)
}

fn hyab(a: DVec3, b: DVec3) -> f64 {
    let difference = a - b;
    difference.x.abs() + difference.y.hypot(difference.z)
}

/// Returns the largest difference of color, between green and blue, with its exponent.
fn largest_distance() -> f64 {
    hyab(hunt(lab(DVec3::Y)), hunt(lab(DVec3::Z))).powf(COLOR_EXPONENT)
}

/// Maps a difference to 0..1, with those above the bend compressed into the range from `BEND_TO` to 1.
fn bent(difference: f64, largest: f64) -> f64 {
    let bend = BEND_AT * largest;
    if difference < bend {
        BEND_TO / bend * difference
    } else {
        BEND_TO + (difference - bend) / (largest - bend) * (1.0 - BEND_TO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_sum_to_one() {
        let sum: DVec3 = SENSITIVITY
            .into_iter()
            .map(|(height, spread)| {
                let (weights, total) = sensitivity(height, spread);
                let along: DVec3 = weights.into_iter().sum();
                along * along * total
            })
            .sum();
        assert!(sum.abs_diff_eq(DVec3::ONE, 1e-12), "both Gaussians of each channel: {sum}");
        let flat = separable(&[2.0f64; 12], 4, &[0.25, 0.5, 0.25], &[0.1, 0.8, 0.1]);
        assert!(flat.iter().all(|v| (v - 2.0).abs() < 1e-12), "borders repeat: {flat:?}");
    }

    #[test]
    fn opponent_colors_turn_back() {
        let color = DVec3::new(0.2, 0.7, 0.4);
        assert!(from_opponent(opponent(color)).abs_diff_eq(color, 1e-12), "there and back");
        assert!(opponent(DVec3::ONE).abs_diff_eq(DVec3::new(100.0, 0.0, 0.0), 1e-12), "white has no color");
    }
}
