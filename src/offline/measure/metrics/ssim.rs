//! Structural similarity.
//!
//! In: two pictures, values 0 to 1. Out: their SSIM as the original computes it: per channel, 11 × 11 Gaussian window
//! of σ = 1.5, zeros beyond the border, averaged over all pixels and channels.
//!
//! The window is separable, so each row of the result needs one vertical pass over eleven rows and one horizontal pass;
//! rows are independent and nothing picture-sized is stored.

use glam::DVec3;
use rayon::prelude::*;

use super::size_mismatch::{SizeMismatch, check_sizes};
use crate::view::Picture;

pub(crate) const WINDOW: usize = 11;
pub(crate) const RADIUS: usize = WINDOW / 2;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Window-weighted means of `a`, `b`, `a²`, `b²`, `ab`, each per channel.
pub(crate) type Moments = [DVec3; 5];

/// Returns the SSIM, at most 1 (for identical pictures).
///
/// # Errors
/// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
pub fn ssim(a: &Picture, b: &Picture) -> Result<f64, SizeMismatch> {
    check_sizes(a, b)?;
    let window = gaussian_window();
    // Rows are summed in order, so that the result does not depend on the number of threads.
    let rows: Vec<DVec3> = (0..a.size.y as usize).into_par_iter().map(|y| row_sum(a, b, y, &window)).collect();
    Ok(rows.into_iter().sum::<DVec3>().element_sum() / (3.0 * a.pixels.len() as f64))
}

/// Returns the SSIM, and its derivatives with respect to each pixel of `a`.
///
/// # Errors
/// As [`ssim`].
pub fn similarity_slopes(a: &Picture, b: &Picture) -> Result<(f64, Vec<DVec3>), SizeMismatch> {
    check_sizes(a, b)?;
    let window = gaussian_window();
    let (width, height) = (a.size.x as usize, a.size.y as usize);
    let values = 3.0 * a.pixels.len() as f64;
    let of_row = |y: usize| {
        let columns = column_moments(a, b, y, &window);
        (0..width).map(|x| slopes(&moments_at(&columns, x, &window))).collect::<Vec<_>>()
    };
    let maps: Vec<[DVec3; 4]> = (0..height).into_par_iter().flat_map_iter(of_row).collect();
    let sum: DVec3 = maps.iter().map(|[.., similarity]| *similarity).sum();
    // A pixel counts in all windows that it lies in, with the weights that they have there: the window is symmetric.
    let spread = |index: usize| {
        let (x, y) = (index % width, index / width);
        let mut spread = [DVec3::ZERO; 3];
        for (row, weight_y) in inside(&window, y, height) {
            for (column, weight_x) in inside(&window, x, width) {
                for (sum, slope) in spread.iter_mut().zip(&maps[row * width + column]) {
                    *sum += weight_x * weight_y * *slope;
                }
            }
        }
        let (p, q) = (a.pixels[index].as_dvec3(), b.pixels[index].as_dvec3());
        (spread[0] + 2.0 * p * spread[1] + q * spread[2]) / values
    };
    let slopes = (0..width * height).into_par_iter().map(spread).collect();
    Ok((sum.element_sum() / values, slopes))
}

/// Returns the derivatives of the similarity with respect to the means of `a`, `a²` and `ab`, and the similarity.
fn slopes(moments: &Moments) -> [DVec3; 4] {
    let [mean_a, mean_b, square_a, square_b, product] = *moments;
    let (a1, a2) = (2.0 * mean_a * mean_b + C1, 2.0 * (product - mean_a * mean_b) + C2);
    let b1 = mean_a * mean_a + mean_b * mean_b + C1;
    let b2 = square_a - mean_a * mean_a + square_b - mean_b * mean_b + C2;
    let similarity = a1 * a2 / (b1 * b2);
    let by_mean = 2.0 * mean_b * (a2 - a1) / (b1 * b2) + 2.0 * mean_a * similarity * (1.0 / b2 - 1.0 / b1);
    [by_mean, -similarity / b2, 2.0 * a1 / (b1 * b2), similarity]
}

/// Returns the weights of the window along one axis; they sum to one.
pub(crate) fn gaussian_window() -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let distance = i as f64 - RADIUS as f64;
        (-distance * distance / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Returns the positions from `0..length` under the window centered on `center`, with their weights; values beyond them
/// count as zero.
fn inside(window: &[f64; WINDOW], center: usize, length: usize) -> impl Iterator<Item = (usize, f64)> {
    let taps = window.iter().enumerate();
    taps.filter_map(move |(i, &weight)| Some(((center + i).checked_sub(RADIUS)?, weight)))
        .filter(move |&(position, _)| position < length)
}

/// Returns the SSIM summed over row `y`, per channel.
fn row_sum(a: &Picture, b: &Picture, y: usize, window: &[f64; WINDOW]) -> DVec3 {
    let columns = column_moments(a, b, y, window);
    (0..columns.len()).map(|x| similarity(&moments_at(&columns, x, window))).sum()
}

/// Applies the window about row `y` down each column.
pub(crate) fn column_moments(a: &Picture, b: &Picture, y: usize, window: &[f64; WINDOW]) -> Vec<Moments> {
    let (width, height) = (a.size.x as usize, a.size.y as usize);
    let mut columns = vec![Moments::default(); width];
    for (row, weight) in inside(window, y, height) {
        let span = row * width..(row + 1) * width;
        let pixels = a.pixels[span.clone()].iter().zip(&b.pixels[span]);
        for (column, (p, q)) in columns.iter_mut().zip(pixels) {
            let (p, q) = (p.as_dvec3(), q.as_dvec3());
            accumulate(column, weight, &[p, q, p * p, q * q, p * q]);
        }
    }
    columns
}

/// Applies the window about column `x` along the row that [`column_moments`] returned.
pub(crate) fn moments_at(columns: &[Moments], x: usize, window: &[f64; WINDOW]) -> Moments {
    let mut moments = Moments::default();
    for (column, weight) in inside(window, x, columns.len()) {
        accumulate(&mut moments, weight, &columns[column]);
    }
    moments
}

fn accumulate(sum: &mut Moments, weight: f64, values: &Moments) {
    for (sum, value) in sum.iter_mut().zip(values) {
        *sum += weight * *value;
    }
}

fn similarity(moments: &Moments) -> DVec3 {
    let (luminance, contrast) = factors(moments);
    luminance * contrast
}

/// Returns the two factors of SSIM: that of the means, and that of contrast and structure together.
pub(crate) fn factors(&[mean_a, mean_b, square_a, square_b, product]: &Moments) -> (DVec3, DVec3) {
    let (mean_aa, mean_bb, mean_ab) = (mean_a * mean_a, mean_b * mean_b, mean_a * mean_b);
    let (variance_a, variance_b, covariance) = (square_a - mean_aa, square_b - mean_bb, product - mean_ab);
    ((2.0 * mean_ab + C1) / (mean_aa + mean_bb + C1), (2.0 * covariance + C2) / (variance_a + variance_b + C2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn window_sums_to_one_and_is_symmetric() {
        let window = gaussian_window();
        assert!((window.iter().sum::<f64>() - 1.0).abs() < 1e-15, "sum of {window:?}");
        assert!((0..WINDOW).all(|i| window[i] == window[WINDOW - 1 - i]), "asymmetric: {window:?}");
        // exp(-1/4.5) / sum: the published value of the window next to its center.
        assert!((window[RADIUS + 1] / window[RADIUS] - (-1.0f64 / 4.5).exp()).abs() < 1e-15, "shape of {window:?}");
    }

    #[test]
    fn taps_beyond_the_border_are_left_out() {
        let window = gaussian_window();
        let at_start: Vec<_> = inside(&window, 0, 3).map(|(position, _)| position).collect();
        assert_eq!(at_start, [0, 1, 2], "a picture narrower than the window");
        assert_eq!(inside(&window, 10, 40).count(), WINDOW, "far from the border");
        assert_eq!(inside(&window, 39, 40).map(|(position, _)| position).min(), Some(34), "at the far border");
    }
}
