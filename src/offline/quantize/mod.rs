//! Compression: from a scene ready to draw to the packed form.
//!
//! In: a [`RuntimeScene`] and [`CompressSettings`] (or a [`Quality`] that selects them). Out: a scene in the packed
//! form, its Gaussians in Morton order, and a [`CompressReport`].
//!
//! 1. [`CompressSettings`] specify how much may be lost.
//! 2. [`order`] sorts the Gaussians, so that neighbors share a box.
//! 3. [`codebook`] trains the codebooks of color.
//! 4. [`scene::packed`](crate::scene::packed) encodes the result as records.

pub mod codebook;
pub mod order;
mod settings;

pub use settings::{CompressSettings, Quality};

use super::prune::select_harmonics;
use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian};
use crate::scene::packed::MAX_STAGES;
use crate::scene::packed::encode::Bits;
use crate::scene::{
    CodedColors, FilterKind, Form, GaussianScene, PackedColors, PackedScene, RuntimeScene, SceneForm, TemporalFilter,
};
use codebook::Codebooks;
use ndarray::Array2;
use order::morton_order;
use serde::Serialize;

/// Figures of a compression. Default: zeros.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CompressReport {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Bytes of Gaussians and colors in memory before compression.
    pub memory_before: usize,
    /// The same after compression, which is what the GPU holds.
    pub memory_after: usize,
    /// Entries of each codebook.
    pub codebooks: Vec<u32>,
}

/// Why a scene cannot be compressed.
#[derive(Debug, thiserror::Error)]
pub enum CompressError {
    /// It is in the packed form already.
    #[error("the scene is packed already: compress the checkpoint or the lossless package it was made from")]
    AlreadyPacked,
    /// Codebooks need quantized geometry.
    #[error("codebooks need quantised geometry: choose a quality other than lossless, or no codebooks")]
    CodebooksAlone,
    /// Too many codebooks, or a codebook with no or too many entries.
    #[error("at most {MAX_STAGES} codebooks of 1 to 65536 entries each, not {0:?}")]
    Codebooks(Vec<usize>),
    /// A Gaussian cannot be drawn.
    #[error(transparent)]
    Invalid(#[from] InvalidGaussian),
}

/// Compresses a scene.
///
/// # Errors
/// If the scene is packed already or the settings contradict each other.
///
/// # Panics
/// If `settings.weights` has fewer values than the scene has Gaussians.
pub fn compress(
    scene: RuntimeScene,
    settings: &CompressSettings,
) -> Result<(GaussianScene, CompressReport), CompressError> {
    compress_with(scene, settings, || {})
}

/// As [`compress`]; calls `done` after each codebook.
///
/// # Errors
/// As [`compress`].
///
/// # Panics
/// As [`compress`].
pub fn compress_with(
    scene: RuntimeScene,
    settings: &CompressSettings,
    done: impl FnMut(),
) -> Result<(GaussianScene, CompressReport), CompressError> {
    let Form::Sliced(sliced) = &scene.form else { return Err(CompressError::AlreadyPacked) };
    let books = &settings.codebooks;
    if books.len() > MAX_STAGES || books.iter().any(|&entries| !(1..=1 << 16).contains(&entries)) {
        return Err(CompressError::Codebooks(books.clone()));
    }
    let mut report = CompressReport { gaussians: scene.len(), memory_before: scene.size(), ..Default::default() };
    let Some(bits) = &settings.geometry else {
        if !books.is_empty() {
            return Err(CompressError::CodebooksAlone);
        }
        report.memory_after = report.memory_before;
        return Ok((scene.into(), report));
    };
    let order = morton_order(&sliced.gaussians);
    let gaussians: Vec<Gaussian> = order.iter().map(|&index| sliced.gaussians[index as usize]).collect();
    let (colors, base) = if books.is_empty() {
        let whole = rounded(select_harmonics(&sliced.harmonics, &order), settings.color_step);
        (PackedColors::Whole(whole), [0.0; 2])
    } else {
        let weights = match &settings.weights {
            Some(weights) => order.iter().map(|&index| weights[index as usize]).collect(),
            None => gaussians.iter().map(|gaussian| gaussian.opacity).collect::<Vec<_>>(),
        };
        let (coded, base) = code(&sliced.harmonics, &order, &weights, books, bits, done);
        report.codebooks.clone_from(&coded.entries);
        (PackedColors::Coded(coded), base)
    };
    let packed = PackedScene::encode(&gaussians, bits, colors, base, scene.trained_with.time_span());
    let filter = scene.filter.map(|filter| match filter.kind {
        // Lifespans are rounded too: the filter must be exact for the Gaussians that are drawn.
        FilterKind::Support => {
            let gaussians = (0..packed.len()).map(|index| packed.gaussian(index));
            TemporalFilter::support(gaussians, scene.trained_with.time_interval, filter.segments)
        }
        FilterKind::KeyFrame | FilterKind::Interval => filter.select(&order),
    });
    report.memory_after = packed.size();
    let scene = GaussianScene {
        form: SceneForm::Ready(Form::Packed(packed)),
        filter,
        environment: scene.environment,
        trained_with: scene.trained_with,
        playback: scene.playback,
    };
    Ok((scene, report))
}

/// Rounds coefficients to multiples of `step`, if it is positive.
fn rounded(mut harmonics: Harmonics, step: f32) -> Harmonics {
    if step > 0.0 {
        harmonics.values.iter_mut().for_each(|value| *value = (*value / step).round() * step);
    }
    harmonics
}

/// Returns the colors by codebooks of these numbers of entries, in the given order, and the ends of the range of their
/// first coefficients.
fn code(
    harmonics: &Harmonics,
    order: &[u32],
    weights: &[f32],
    entries: &[usize],
    bits: &Bits,
    done: impl FnMut(),
) -> (CodedColors, [f32; 2]) {
    let used = harmonics.evaluated() * 3;
    let of = |&index: &u32| &harmonics.of(index as usize)[..used];
    let base: Vec<[f32; 3]> = order.iter().map(of).map(|row| [row[0], row[1], row[2]]).collect();
    let (mut colors, ends) = CodedColors::of_base(harmonics.degree, harmonics.degree_t, &base, bits.base);
    let columns = used - 3;
    if columns > 0 {
        let mut rest = Array2::zeros((order.len(), columns));
        for (mut row, index) in rest.rows_mut().into_iter().zip(order) {
            row.iter_mut().zip(&of(index)[3..]).for_each(|(to, from)| *to = *from);
        }
        let books = Codebooks::train(rest, weights, entries, done);
        for ((book, scales), codes) in books.entries.iter().zip(&books.scales).zip(&books.codes) {
            let bytes: Vec<i8> = book.iter().copied().collect();
            colors.push_codebook(&bytes, &scales.to_vec(), codes);
        }
    }
    (colors, ends)
}
