//! Compression: from a scene ready to draw to the packed form.
//!
//! In: a [`RuntimeScene`] and [`CompressSettings`] (or a [`Quality`] that selects them). Out: a scene in the packed
//! form, its Gaussians in Morton order and without levels of detail, and a [`CompressReport`].
//!
//! 1. [`CompressSettings`] specify how much may be lost.
//! 2. `anchor` moves temporal means close to the time interval.
//! 3. `order` sorts the Gaussians, so that neighbors share a box.
//! 4. `codebook` trains the codebooks of color.
//! 5. `scene::packed` encodes the result as records.

mod anchor;
pub(crate) mod codebook;
pub(crate) mod order;
pub(crate) mod roundings;
mod settings;

pub(crate) use roundings::roundings;
pub use settings::{CompressSettings, Quality};

use super::prune::select_harmonics;
use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian};
use crate::scene::packed::MAX_STAGES;
use crate::scene::packed::encode::Bits;
use crate::scene::{
    CodedColors, FilterKind, Form, GaussianScene, PackedColors, PackedScene, RuntimeScene, SceneForm, TemporalFilter,
    TrainedWith,
};
use codebook::Centers;
use ndarray::Array2;
use order::morton_order;
use rayon::prelude::*;
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

/// Returns a scene whose temporal means are close to the time interval, if its geometry is quantized.
fn anchored(mut scene: RuntimeScene, settings: &CompressSettings) -> RuntimeScene {
    if let (Form::Sliced(sliced), Some(_)) = (&mut scene.form, &settings.geometry) {
        let TrainedWith { time_interval, marginal_cutoff, .. } = scene.trained_with;
        anchor::move_near(&mut sliced.gaussians, time_interval, marginal_cutoff);
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
    let step = settings.color_step;
    if step != 0.0 && !(step.is_normal() && step > 0.0) {
        return Err(CompressError::ColorStep(step));
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
    let (colors, base) = if books.is_empty() {
        let whole = rounded(select_harmonics(&sliced.harmonics, &order), step);
        (PackedColors::Whole(whole), [0.0; 2])
    } else {
        let weights = match &settings.weights {
            Some(weights) => order.iter().map(|&index| weights[index as usize]).collect(),
            None => order.iter().map(|&index| sliced.gaussians[index as usize].opacity).collect::<Vec<_>>(),
        };
        let (coded, base) = code(&sliced.harmonics, &order, bits, |rest| train(rest, &weights, books));
        report.codebooks.clone_from(&coded.entries);
        (PackedColors::Coded(coded), base)
    };
    let packed = encode(&sliced.gaussians, &order, bits, colors, base, scene.trained_with.time_span());
    packed.check().map_err(CompressError::Range)?;
    check_each(&packed, &order)?;
    let filter = scene.filter.map(|filter| match filter.kind {
        // Lifespans are rounded too: the filter must be exact for the Gaussians that are drawn.
        FilterKind::Support => {
            let gaussians = (0..packed.len()).map(|index| packed.gaussian(index));
            TemporalFilter::support(
                gaussians,
                scene.trained_with.time_interval,
                scene.trained_with.marginal_cutoff,
                filter.segments,
            )
        }
        FilterKind::KeyFrame | FilterKind::Interval | FilterKind::Window => filter.select(&order),
    });
    report.memory_after = packed.size();
    let scene = GaussianScene {
        form: SceneForm::Ready(Form::Packed(packed)),
        filter,
        environment: scene.environment,
        trained_with: scene.trained_with,
        playback: scene.playback,
        levels: Vec::new(),
    };
    Ok((scene, report))
}

/// Packs Gaussians in the given order.
fn encode(
    gaussians: &[Gaussian],
    order: &[u32],
    bits: &Bits,
    colors: PackedColors,
    base: [f32; 2],
    reach: f32,
) -> PackedScene {
    let ordered: Vec<Gaussian> = order.iter().map(|&index| gaussians[index as usize]).collect();
    PackedScene::encode(&ordered, bits, colors, base, reach)
}

/// Checks that every Gaussian can still be drawn; `order` has their indices before they were packed.
fn check_each(packed: &PackedScene, order: &[u32]) -> Result<(), CompressError> {
    let reason = |place: usize| packed.gaussian(place).check().err();
    let extreme = |place| Some(CompressError::Extreme { index: order[place], reason: reason(place)? });
    (0..order.len()).into_par_iter().find_map_first(extreme).map_or(Ok(()), Err)
}

/// Rounds coefficients to multiples of `step`, if it is positive. Those whose multiple single precision cannot hold stay as they are.
fn rounded(mut harmonics: Harmonics, step: f32) -> Harmonics {
    let multiple = |value: f32| (value / step).round() * step;
    if step > 0.0 {
        let coarse = harmonics.values.iter_mut().filter(|value| multiple(**value).is_finite());
        coarse.for_each(|value| *value = multiple(*value));
    }
    harmonics
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
