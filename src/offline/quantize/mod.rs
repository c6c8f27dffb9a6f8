//! Compression: from a scene ready to draw to the packed form.
//!
//! In: a [`RuntimeScene`] and [`CompressSettings`] (or a [`Quality`] that selects them). Out: a scene in the packed
//! form, its Gaussians in Morton order and without levels of detail, and a [`CompressReport`]. `promise` states what the
//! quality promises and the result does not keep.
//!
//! 1. [`CompressSettings`] specify how much may be lost.
//! 2. `codebook` trains the codebooks of color, if there are any.
//! 3. `scene::packed` moves temporal means close to the time interval, sorts the Gaussians and encodes them as records.

pub(crate) mod codebook;
mod promise;
pub(crate) mod roundings;
mod settings;

pub(crate) use promise::broken_promises;
pub(crate) use roundings::roundings;
pub use settings::{CompressSettings, Quality};

use crate::gaussian::{Harmonics, InvalidGaussian};
use crate::scene::packed::MAX_STAGES;
use crate::scene::packed::anchor::move_near;
use crate::scene::packed::order::{is_filler, morton_order};
use crate::scene::packed::pack::pack_ordered;
use crate::scene::{
    Bits, CodedColors, Form, GaussianScene, PackError, PackedColors, Packing, RuntimeScene, SceneForm, TrainedWith,
};
use codebook::Centers;
use ndarray::Array2;
use serde::Serialize;

/// Figures of a compression. Default: zeros.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CompressReport {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Number of invisible Gaussians that were added to fill blocks, so that Gaussians far from the others do not take the
    /// digits of these.
    pub fillers: usize,
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
    #[error("the scene is packed already: name the checkpoint or the lossless package that it was made from")]
    AlreadyPacked,
    /// Codebooks need quantized geometry.
    #[error("codebooks need quantized geometry: choose a quality other than lossless, or no codebooks")]
    CodebooksAlone,
    /// Too many codebooks, or a codebook with no or too many entries.
    #[error("at most {MAX_STAGES} codebooks of 1 to 65536 entries each, not {0:?}")]
    Codebooks(Vec<usize>),
    /// Colors cannot be rounded to multiples of this.
    #[error("colors cannot be rounded to multiples of {0:?}: the step must be 0, or a number from {least:e} up", least = f32::MIN_POSITIVE)]
    ColorStep(f32),
    /// The values of the scene have too large a range.
    #[error(
        "the scene does not fit the packed form ({0}): some of its values are too large or too far apart; choose the quality lossless, or \
         prune it first"
    )]
    Range(&'static str),
    /// A Gaussian could not be drawn any more.
    #[error(
        "Gaussian {index} does not fit the packed form ({reason}): its values are too large or too small; choose the quality lossless, or \
         prune the scene first"
    )]
    Extreme {
        /// Its index in the scene.
        index: u32,
        /// What would be wrong with it.
        reason: &'static str,
    },
    /// A Gaussian cannot be drawn.
    #[error(transparent)]
    Invalid(#[from] InvalidGaussian),
}

impl From<PackError> for CompressError {
    fn from(error: PackError) -> Self {
        match error {
            PackError::AlreadyPacked => Self::AlreadyPacked,
            PackError::ColorStep(step) => Self::ColorStep(step),
            PackError::Range(reason) => Self::Range(reason),
            PackError::Extreme { index, reason } => Self::Extreme { index, reason },
        }
    }
}

/// Checks that a scene has not been compressed before, which would round its values twice.
///
/// # Errors
/// [`CompressError::AlreadyPacked`].
pub(crate) fn require_unpacked(form: &SceneForm) -> Result<(), CompressError> {
    match form {
        SceneForm::Ready(Form::Packed(_)) => Err(CompressError::AlreadyPacked),
        SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => Ok(()),
    }
}

/// Compresses a scene.
///
/// # Errors
/// If the scene is packed already, the settings contradict each other, or the packed form cannot hold its values.
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
pub(crate) fn compress_with(
    scene: RuntimeScene,
    settings: &CompressSettings,
    done: impl FnMut(),
) -> Result<(GaussianScene, CompressReport), CompressError> {
    let scene = anchored(scene, settings);
    compress_by(scene, settings, |colors, weights, entries| Centers::train(colors, weights, entries, done))
}

/// As [`compress`], with codebooks that have been trained: rows are Gaussians in the order of the scene.
///
/// # Errors
/// As [`compress`].
///
/// # Panics
/// If the codebooks are of fewer Gaussians.
pub(crate) fn compress_tied(
    scene: RuntimeScene,
    settings: &CompressSettings,
    books: &Centers,
) -> Result<(GaussianScene, CompressReport), CompressError> {
    let scene = anchored(scene, settings);
    let Form::Sliced(sliced) = &scene.form else { return Err(CompressError::AlreadyPacked) };
    let order = morton_order(&sliced.gaussians);
    let codes = books.codes.iter().map(|codes| order.iter().map(|&index| codes[index as usize]).collect());
    let ordered = Centers { entries: books.entries.clone(), codes: codes.collect() };
    compress_by(scene, settings, |_, _, _| ordered)
}

/// Returns codebooks for the colors of a scene, rows in its order, and the weights that [`compress`] gives them.
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

/// Returns a scene whose temporal means are close to the time interval, if codebooks are trained for quantized geometry.
fn anchored(mut scene: RuntimeScene, settings: &CompressSettings) -> RuntimeScene {
    if let (Form::Sliced(sliced), Some(_), false) = (&mut scene.form, &settings.geometry, settings.codebooks.is_empty())
    {
        let TrainedWith { time_interval, marginal_cutoff, .. } = scene.trained_with;
        move_near(&mut sliced.gaussians, time_interval, marginal_cutoff);
    }
    scene
}

/// As [`compress`], for a scene that is [`anchored`]; `train` returns the codebooks for rows of coefficients, their weights and the numbers
/// of entries.
fn compress_by(
    scene: RuntimeScene,
    settings: &CompressSettings,
    train: impl FnOnce(Array2<f32>, &[f32], &[usize]) -> Centers,
) -> Result<(GaussianScene, CompressReport), CompressError> {
    let Form::Sliced(sliced) = &scene.form else { return Err(CompressError::AlreadyPacked) };
    let books = &settings.codebooks;
    if books.len() > MAX_STAGES || books.iter().any(|&entries| !(1..=1 << 16).contains(&entries)) {
        return Err(CompressError::Codebooks(books.clone()));
    }
    Packing { color_step: settings.color_step, ..Packing::default() }.check()?;
    let mut report = CompressReport { gaussians: scene.len(), memory_before: scene.size(), ..Default::default() };
    let Some(bits) = &settings.geometry else {
        if !books.is_empty() {
            return Err(CompressError::CodebooksAlone);
        }
        report.memory_after = report.memory_before;
        return Ok((scene.into(), report));
    };
    if books.is_empty() {
        let packed = scene.pack(&Packing { bits: *bits, color_step: settings.color_step })?;
        (report.memory_after, report.fillers) = (packed.size(), packed.len() - report.gaussians);
        return Ok((packed.into(), report));
    }
    let order = morton_order(&sliced.gaussians);
    let weight =
        |index: usize| settings.weights.as_ref().map_or(sliced.gaussians[index].opacity, |weights| weights[index]);
    let weight_at = |place: usize| if is_filler(&order, place) { 0.0 } else { weight(order[place] as usize) };
    let weights: Vec<f32> = (0..order.len()).map(weight_at).collect();
    let (coded, base) = code(&sliced.harmonics, &order, bits, |rest| train(rest, &weights, books));
    report.codebooks.clone_from(&coded.entries);
    let packed = pack_ordered(scene, bits, &order, PackedColors::Coded(coded), base)?;
    (report.memory_after, report.fillers) = (packed.size(), packed.len() - report.gaussians);
    Ok((packed.into(), report))
}

/// Returns the colors by the codebooks that `train` returns, in the given order, and the ends of the range of their first
/// coefficients.
fn code(
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

/// Returns all coefficients that are evaluated but the first, a row for each of these Gaussians.
fn rest_of(harmonics: &Harmonics, order: &[u32]) -> Array2<f32> {
    let used = harmonics.evaluated() * 3;
    let mut rest = Array2::zeros((order.len(), used - 3));
    for (mut row, &index) in rest.rows_mut().into_iter().zip(order) {
        row.iter_mut().zip(&harmonics.of(index as usize)[3..used]).for_each(|(to, from)| *to = *from);
    }
    rest
}
