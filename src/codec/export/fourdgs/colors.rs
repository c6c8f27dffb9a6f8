//! Colors of a `.4dgs` file: the bytes of the format, and their residuals.
//!
//! In: color coefficients. Out: [`Colors`]: a byte and a residual for each coefficient of degree 1 and above.
//!
//! The format has 256 values from -4 to 4 for each coefficient, and colors of degree 0 from 0 to 1. The residuals are
//! written to a record of this program, `import::fourdgs::exact`, which other players skip.

use super::steps::REACH;
use crate::codec::import::fourdgs::exact::COEFFICIENT;
use crate::gaussian::Harmonics;
use fourdgs::quantization::{SH_QUANT_HI, SH_QUANT_LO, sh_coefficient};
use fourdgs::sh::band_range;

/// Degrees whose coefficients are all smaller are left out: the bytes nearest to 0 differ more from it.
const SMALLEST: f32 = 1.0 / 1024.0;

/// Coefficients of degree 1 and above.
#[derive(Debug, Clone)]
pub(super) struct Colors {
    /// The highest degree, 0 to 3.
    pub degree: u8,
    /// Coefficients for each channel.
    pub coefficients: usize,
    /// Three times as many bytes for each Gaussian: all of red, of green, of blue.
    codes: Vec<u8>,
    /// The residuals of the bytes, in multiples of [`COEFFICIENT`], in the same order.
    residuals: Vec<i32>,
    /// The largest magnitude of a residual.
    pub worst: f64,
}

impl Colors {
    /// Codes the coefficients.
    pub(super) fn of(harmonics: &Harmonics) -> Self {
        let degree = degree(harmonics);
        let coefficients = (degree as usize + 1).pow(2) - 1;
        let mut colors = Self { degree, coefficients, codes: Vec::new(), residuals: Vec::new(), worst: 0.0 };
        for (index, own) in harmonics.values.chunks_exact(harmonics.coefficients * 3).enumerate() {
            for number in 0..coefficients * 3 {
                let (channel, coefficient) = (number / coefficients, number % coefficients);
                let value = f64::from(own[(coefficient + 1) * 3 + channel]);
                // Both bytes beside 0 are equally near: they alternate, so that not all errors have one sign.
                let code = code(value, (index + number).is_multiple_of(2));
                let residual = value - sh_coefficient(code);
                colors.codes.push(code);
                colors.residuals.push((residual / COEFFICIENT).round().clamp(-REACH, REACH) as i32);
                colors.worst = colors.worst.max(residual.abs());
            }
        }
        colors
    }

    /// Returns the residuals of a Gaussian.
    pub(super) fn residuals(&self, index: usize) -> &[i32] {
        let width = self.coefficients * 3;
        &self.residuals[index * width..][..width]
    }

    /// Returns the bytes of a Gaussian in a band, 1 to 3.
    pub(super) fn band(&self, index: usize, band: u8) -> impl Iterator<Item = i64> {
        let (first, last) = band_range(band).unwrap_or_default();
        let own = &self.codes[index * self.coefficients * 3..][..self.coefficients * 3];
        own.chunks_exact(self.coefficients).flat_map(move |channel| &channel[first..last]).map(|&code| i64::from(code))
    }
}

/// Returns the highest degree with a coefficient of at least [`SMALLEST`].
fn degree(harmonics: &Harmonics) -> u8 {
    let is_used = |degree: u32| {
        let [first, last] = [degree as usize, degree as usize + 1].map(|side| side * side * 3);
        let mut all = harmonics.values.chunks_exact(harmonics.coefficients * 3);
        all.any(|own| own[first..last].iter().any(|value| value.abs() >= SMALLEST))
    };
    (1..=harmonics.degree.min(3)).rev().find(|&degree| is_used(degree)).unwrap_or(0) as u8
}

/// Returns the byte of a coefficient; of two that are equally near the higher one if `is_up`.
fn code(value: f64, is_up: bool) -> u8 {
    let place = (value - SH_QUANT_LO) / (SH_QUANT_HI - SH_QUANT_LO) * 255.0;
    let is_between = place - place.floor() == 0.5;
    let code = if is_between && !is_up { place.floor() } else { place.round() };
    code.clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_is_the_nearest_one_and_zeros_alternate() {
        for byte in 0..=255 {
            assert_eq!(code(sh_coefficient(byte), true), byte, "a value of the format");
        }
        assert_eq!([code(0.0, false), code(0.0, true)], [127, 128], "0 is between two bytes");
        assert_eq!([code(-9.0, true), code(9.0, true)], [0, 255], "values beyond the range");
    }

    #[test]
    fn degrees_without_color_are_left_out() {
        let mut values = vec![0.0; 48];
        let of = |values: &[f32]| {
            Colors::of(&Harmonics { coefficients: 16, degree: 3, degree_t: 0, values: values.to_vec() })
        };
        assert_eq!((of(&values).degree, of(&values).worst), (0, 0.0), "zeros, which no byte is");
        // Coefficient 5, of degree 2, of green.
        values[16] = 0.5;
        let colors = of(&values);
        assert_eq!((colors.degree, colors.coefficients), (2, 8), "degree 2 without degree 3");
        let band: Vec<i64> = colors.band(0, 2).collect();
        assert_eq!(band.len(), 15, "five coefficients of three channels");
        assert_eq!(band[6], i64::from(code(0.5, true)), "the second coefficient of green");
        let found = sh_coefficient(code(0.5, true)) + COEFFICIENT * f64::from(colors.residuals(0)[8 + 4]);
        assert!((found - 0.5).abs() <= COEFFICIENT / 2.0, "byte and residual together: {found}");
    }
}
