//! The colors of a scene by codebooks.
//!
//! In: the coefficients of spherical harmonics of all Gaussians. Out: codebooks for all coefficients but the first of
//! each Gaussian, and the colors as [`CodedColors`].

use super::codebook::Centers;
use super::{CompressError, CompressSettings};
use crate::gaussian::Harmonics;
use crate::scene::{Bits, CodedColors, Form, RuntimeScene};
use ndarray::Array2;

/// Trains codebooks on the colors of a scene, as [`compress`](super::compress) does, but with codes in the order of the
/// scene.
///
/// # Errors
/// A scene that is packed.
pub(crate) fn train_codebooks(scene: &RuntimeScene, settings: &CompressSettings) -> Result<Centers, CompressError> {
    let Form::Sliced(sliced) = &scene.form else { return Err(CompressError::AlreadyPacked) };
    let order: Vec<u32> = (0..scene.len() as u32).collect();
    let opacities = || sliced.gaussians.iter().map(|gaussian| gaussian.opacity).collect();
    let weights = settings.weights.clone().unwrap_or_else(opacities);
    Ok(Centers::train(rest_of(&sliced.harmonics, &order), &weights, &settings.codebooks, || {}))
}

/// Returns the colors by the codebooks that `train` returns, in the given order, and the range (low, high) of their
/// first coefficients. `train` is given a row of all other evaluated coefficients for each Gaussian.
pub(super) fn coded_colors(
    harmonics: &Harmonics,
    order: &[u32],
    bits: &Bits,
    train: impl FnOnce(Array2<f32>) -> Centers,
) -> (CodedColors, [f32; 2]) {
    let used = harmonics.evaluated() * 3;
    let of = |&index: &u32| &harmonics.of(index as usize)[..used];
    let base: Vec<[f32; 3]> = order.iter().map(of).map(|row| [row[0], row[1], row[2]]).collect();
    let (mut colors, ends) = CodedColors::of_base(harmonics.degree, harmonics.degree_t, &base, bits.base);
    if used > 3 {
        let books = train(rest_of(harmonics, order)).quantized();
        for ((book, scales), codes) in books.entries.iter().zip(&books.scales).zip(&books.codes) {
            let bytes: Vec<i8> = book.iter().copied().collect();
            colors.push_codebook(&bytes, &scales.to_vec(), codes);
        }
    }
    (colors, ends)
}

/// Returns all evaluated coefficients but the first, a row for each of these Gaussians.
fn rest_of(harmonics: &Harmonics, order: &[u32]) -> Array2<f32> {
    let used = harmonics.evaluated() * 3;
    let mut rest = Array2::zeros((order.len(), used - 3));
    for (mut row, &index) in rest.rows_mut().into_iter().zip(order) {
        row.iter_mut().zip(&harmonics.of(index as usize)[3..used]).for_each(|(to, from)| *to = *from);
    }
    rest
}
