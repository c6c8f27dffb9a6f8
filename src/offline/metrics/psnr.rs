//! Peak signal-to-noise ratio.
//!
//! In: two pictures, peak value 1. Out: decibels; infinite for equal pictures.

use glam::DVec3;

use super::{SizeMismatch, check_sizes};
use crate::view::Picture;

/// Returns the PSNR in dB as the original reports it: `−10 log10(MSE)` per color channel, then the mean of the three.
///
/// Infinite if any channel is identical.
///
/// # Errors
/// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
pub fn psnr(a: &Picture, b: &Picture) -> Result<f64, SizeMismatch> {
    let error = mean_squared_error(a, b)?;
    Ok(error.to_array().into_iter().map(decibels).sum::<f64>() / 3.0)
}

/// Returns the PSNR in dB of the mean squared error over all channels together. Never above [`psnr`].
///
/// # Errors
/// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
pub fn psnr_pooled(a: &Picture, b: &Picture) -> Result<f64, SizeMismatch> {
    Ok(decibels(mean_squared_error(a, b)?.element_sum() / 3.0))
}

fn mean_squared_error(a: &Picture, b: &Picture) -> Result<DVec3, SizeMismatch> {
    check_sizes(a, b)?;
    let squares = a.pixels.iter().zip(&b.pixels).map(|(p, q)| {
        let difference = p.as_dvec3() - q.as_dvec3();
        difference * difference
    });
    Ok(squares.sum::<DVec3>() / a.pixels.len() as f64)
}

fn decibels(mean_squared_error: f64) -> f64 {
    -10.0 * mean_squared_error.log10()
}
