//! Squared error and peak signal-to-noise ratio.
//!
//! In: pairs of pictures, peak value 1. Out: their [`SquaredError`], from which every PSNR of this crate derives:
//! pooled over all pixels, channels and pictures, or as the mean of the three channels. PSNR of finite pictures is
//! finite: identical pictures have [`MAX_PSNR`].

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::size_mismatch::{SizeMismatch, check_sizes};
use crate::view::Picture;

/// PSNR of identical pictures, dB. A mean squared error below 1e-20 counts as 1e-20.
pub const MAX_PSNR: f64 = 200.0;

/// The mean squared error of [`MAX_PSNR`].
const MIN_ERROR: f64 = 1e-20;

/// The squared error of any number of pairs of pictures. Default: of none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct SquaredError {
    /// Sum of the squared differences, per channel.
    sum: DVec3,
    /// Number of pixels.
    pixels: f64,
}

impl SquaredError {
    /// Returns the squared error of one pair of pictures.
    ///
    /// # Errors
    /// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
    pub fn of(a: &Picture, b: &Picture) -> Result<Self, SizeMismatch> {
        let mut error = Self::default();
        error.add(a, b)?;
        Ok(error)
    }

    /// Adds a pair of pictures.
    ///
    /// # Errors
    /// [`SizeMismatch`] if the pictures do not have the same size, or are empty; then nothing is added.
    pub fn add(&mut self, a: &Picture, b: &Picture) -> Result<(), SizeMismatch> {
        check_sizes(a, b)?;
        let squares = a.pixels.iter().zip(&b.pixels).map(|(p, q)| {
            let difference = p.as_dvec3() - q.as_dvec3();
            difference * difference
        });
        self.merge(&Self { sum: squares.sum(), pixels: a.pixels.len() as f64 });
        Ok(())
    }

    /// Adds the pairs of another squared error.
    pub fn merge(&mut self, other: &Self) {
        self.sum += other.sum;
        self.pixels += other.pixels;
    }

    /// Returns the mean squared error over all pixels, channels and pictures; NaN without pictures.
    pub fn mean_squared_error(&self) -> f64 {
        self.sum.element_sum() / (3.0 * self.pixels)
    }

    /// Returns whether all pictures are identical to their partners. False without pictures.
    pub fn is_identical(&self) -> bool {
        self.sum == DVec3::ZERO && self.pixels > 0.0
    }

    /// Returns the PSNR in dB of the [mean squared error](Self::mean_squared_error), at most [`MAX_PSNR`]. NaN without
    /// pictures, or if a pixel is not a number.
    pub fn psnr(&self) -> f64 {
        decibels(self.mean_squared_error())
    }

    /// Returns the PSNR in dB as the original reports it for one picture: the mean over the three color channels of the
    /// PSNR of each. A channel without any error is left out of the mean, unless all three are: then the result is
    /// [`MAX_PSNR`]. NaN without pictures, or if a pixel is not a number.
    pub fn channel_psnr(&self) -> f64 {
        if self.is_identical() {
            return MAX_PSNR;
        }
        let differing = self.sum.to_array().into_iter().filter(|sum| *sum != 0.0);
        let (total, count) =
            differing.fold((0.0, 0), |(total, count), sum| (total + decibels(sum / self.pixels), count + 1));
        total / f64::from(count)
    }
}

impl FromIterator<SquaredError> for SquaredError {
    fn from_iter<T: IntoIterator<Item = Self>>(errors: T) -> Self {
        errors.into_iter().fold(Self::default(), |mut all, error| {
            all.merge(&error);
            all
        })
    }
}

/// Returns the PSNR in dB of a mean squared error, at most [`MAX_PSNR`]; NaN stays NaN.
pub(crate) fn decibels(mean_squared_error: f64) -> f64 {
    let error = if mean_squared_error < MIN_ERROR { MIN_ERROR } else { mean_squared_error };
    -10.0 * error.log10()
}
