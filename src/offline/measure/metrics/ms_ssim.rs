//! Structural similarity at five scales.
//!
//! In: two pictures, values 0 to 1. Out: their MS-SSIM as torchmetrics computes it (data range 1): only windows that
//! lie inside the picture count, channels are averaged before the scales are multiplied, and each scale averages 2 × 2
//! pixels of the one before.

use std::borrow::Cow;

use glam::{DVec3, UVec2, Vec3};
use rayon::prelude::*;

use super::size_mismatch::{SizeMismatch, check_sizes};
use super::ssim::{RADIUS, WINDOW, column_moments, factors, gaussian_window, moments_at};
use crate::view::Picture;

/// The smallest side that has a window at every scale, in pixels.
pub const MS_SSIM_MIN_SIDE: u32 = 176;

/// Exponents of the scales, finest first.
const EXPONENTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Returns the MS-SSIM, from 0 to 1 for identical pictures; `None` if a side is shorter than [`MS_SSIM_MIN_SIDE`].
///
/// # Errors
/// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
pub fn ms_ssim(a: &Picture, b: &Picture) -> Result<Option<f64>, SizeMismatch> {
    check_sizes(a, b)?;
    if a.size.min_element() < MS_SSIM_MIN_SIDE {
        return Ok(None);
    }
    let window = gaussian_window();
    let (mut a, mut b) = (Cow::Borrowed(a), Cow::Borrowed(b));
    let mut product = 1.0;
    for (scale, exponent) in EXPONENTS.into_iter().enumerate() {
        if scale > 0 {
            (a, b) = (Cow::Owned(halved(&a)), Cow::Owned(halved(&b)));
        }
        let [whole, contrast] = similarity(&a, &b, &window);
        // The luminance is used at the coarsest scale only.
        let factor = if scale + 1 == EXPONENTS.len() { whole } else { contrast };
        // A negative factor counts as 0; NaN stays NaN.
        product *= if factor < 0.0 { 0.0 } else { factor.powf(exponent) };
    }
    Ok(Some(product))
}

/// Returns SSIM and its contrast factor, averaged over channels and all windows that lie inside.
fn similarity(a: &Picture, b: &Picture, window: &[f64; WINDOW]) -> [f64; 2] {
    let (width, height) = (a.size.x as usize, a.size.y as usize);
    let row = |y: usize| {
        let columns = column_moments(a, b, y, window);
        (RADIUS..width - RADIUS).fold([DVec3::ZERO; 2], |[whole, contrast], x| {
            let factors = factors(&moments_at(&columns, x, window));
            [whole + factors.0 * factors.1, contrast + factors.1]
        })
    };
    // Rows are summed in order, so that the result does not depend on the number of threads.
    let rows: Vec<[DVec3; 2]> = (RADIUS..height - RADIUS).into_par_iter().map(row).collect();
    let count = 3.0 * ((width - 2 * RADIUS) * (height - 2 * RADIUS)) as f64;
    [0, 1].map(|which| rows.iter().map(|row| row[which]).sum::<DVec3>().element_sum() / count)
}

/// Returns the means of 2 × 2 pixels; an odd last row or column is left out.
fn halved(picture: &Picture) -> Picture {
    let size = picture.size / 2;
    let mean = |i: u32| {
        let at = UVec2::new(i % size.x, i / size.x) * 2;
        let sum = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| picture.pixel(at.x + x, at.y + y));
        sum.into_iter().sum::<Vec3>() * 0.25
    };
    Picture { size, pixels: (0..size.x * size.y).map(mean).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_averages_squares_of_four() {
        let pixels = (0..15).map(|i| Vec3::splat(i as f32)).collect();
        let half = halved(&Picture { size: UVec2::new(5, 3), pixels });
        assert_eq!(half.size, UVec2::new(2, 1), "the odd row and column are left out");
        assert_eq!(half.pixels, [Vec3::splat(3.0), Vec3::splat(5.0)], "means of 0 1 5 6 and of 2 3 7 8");
    }
}
