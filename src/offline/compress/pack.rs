//! From a scene to its packed form.
//!
//! In: a scene ready to draw, [`CompressSettings`], codebooks if they have been trained before. Out: the packed scene,
//! and a [`CompressReport`].
//!
//! The Gaussians are sorted in Morton order, perhaps in layers or in the order of chunk files, and encoded as records (`scene::packed`); their colors
//! are rounded, or coded by codebooks.

use super::codebook::Centers;
use super::coded_colors::coded_colors;
use super::{CompressError, CompressSettings, PackedOrder};
use crate::gaussian::Gaussian;
use crate::offline::segments::{Cut, LEAST_PACKED, lives, parts};
use crate::scene::packed::MAX_STAGES;
use crate::scene::packed::anchor::move_near;
use crate::scene::packed::order::{Order, is_filler};
use crate::scene::packed::pack::{encode_ordered, pack_ordered};
use crate::scene::{
    ChunkTable, CodedColors, FilterKind, Form, GaussianScene, PackedColors, Packing, RuntimeScene, SceneForm, Sliced,
    TemporalFilter,
};
use ndarray::Array2;
use serde::Serialize;

/// Figures of a compression. Default: zeros.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CompressReport {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Number of invisible Gaussians that were added to fill blocks: a Gaussian far from the others is in a block of
    /// its own, so that the others keep their precision.
    pub fillers: usize,
    /// Bytes of Gaussians and colors in memory before compression.
    pub memory_before: usize,
    /// Bytes of Gaussians and colors in memory after compression, which is what the GPU holds.
    pub memory_after: usize,
    /// Entries of each codebook.
    pub codebooks: Vec<u32>,
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
    let order = order_of(&scene, settings)?.indices;
    let codes = books.codes.iter().map(|codes| order.iter().map(|&index| codes[index as usize]).collect());
    let ordered = Centers { entries: books.entries.clone(), codes: codes.collect() };
    compress_by(scene, settings, |_, _, _| ordered)
}

/// Moves temporal means close to the time interval if there are codebooks and quantized geometry.
fn anchored(mut scene: RuntimeScene, settings: &CompressSettings) -> RuntimeScene {
    if let (Form::Sliced(sliced), Some(_), false) = (&mut scene.form, &settings.geometry, settings.codebooks.is_empty())
    {
        move_near(sliced, &scene.trained_with);
    }
    scene
}

/// Returns the order of the Gaussians of a scene, whose temporal means are those that will be packed.
fn order_of(scene: &RuntimeScene, settings: &CompressSettings) -> Result<Order, CompressError> {
    let Form::Sliced(Sliced { gaussians, .. }) = &scene.form else { return Err(CompressError::AlreadyPacked) };
    let (PackedOrder::Chunks(cut), Some(bits)) = (&settings.order, &settings.geometry) else {
        return Ok(Order::of(gaussians, settings.order == PackedOrder::Progressive));
    };
    // Lifespans are rounded, in any order in the same way: no Gaussian may be drawn outside the stretches of its file.
    let (every, no_colors) =
        ((0..gaussians.len() as u32).collect::<Vec<u32>>(), PackedColors::Coded(CodedColors::default()));
    let packed = encode_ordered(gaussians, &every, bits, no_colors, [0.0; 2], scene.trained_with.time_span());
    let rounded: Vec<Gaussian> = (0..packed.len()).map(|index| packed.gaussian(index)).collect();
    chunk_order(gaussians, &rounded, scene.filter.as_ref(), scene, cut)
}

/// Returns the order of chunk files, given the Gaussians and their filter, and the Gaussians as they are when they are
/// packed. `scene` has the clock.
pub(super) fn chunk_order(
    gaussians: &[Gaussian],
    rounded: &[Gaussian],
    filter: Option<&TemporalFilter>,
    scene: &RuntimeScene,
    cut: &Cut,
) -> Result<Order, CompressError> {
    let stretches = cut.stretches(scene.playback.duration_seconds);
    let stretches = stretches.ok_or(CompressError::ManyStretches { seconds: cut.seconds })?;
    // A support filter follows from the lifespans.
    let filter = filter.filter(|filter| filter.kind != FilterKind::Support);
    let lives = lives(rounded, filter, &scene.trained_with, stretches);
    let parts = parts(gaussians, &lives, stretches, &cut.layers, LEAST_PACKED);
    match parts.len() > ChunkTable::MOST_FILES {
        true => Err(CompressError::ManyChunks { found: parts.len() }),
        false => Ok(Order::of_parts(gaussians, stretches, parts)),
    }
}

/// As [`compress`], for a scene that is [`anchored`]. `train` returns codebooks, given rows of coefficients, their
/// weights and the numbers of entries.
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
        let packing = Packing { bits: *bits, color_step: settings.color_step, ..Packing::default() };
        let packed = scene.pack_in(&packing, |scene| order_of(scene, settings))?;
        (report.memory_after, report.fillers) = (packed.size(), packed.len() - report.gaussians);
        return Ok((packed.into(), report));
    }
    let order = order_of(&scene, settings)?;
    let places = &order.indices;
    let weight =
        |index: usize| settings.weights.as_ref().map_or(sliced.gaussians[index].opacity, |weights| weights[index]);
    let weight_at = |place: usize| if is_filler(places, place) { 0.0 } else { weight(places[place] as usize) };
    let weights: Vec<f32> = (0..places.len()).map(weight_at).collect();
    let (coded, base) = coded_colors(&sliced.harmonics, places, bits, |rest| train(rest, &weights, books));
    report.codebooks.clone_from(&coded.codebooks.entries);
    let packed = pack_ordered(scene, bits, &order, PackedColors::Coded(coded), base)?;
    (report.memory_after, report.fillers) = (packed.size(), packed.len() - report.gaussians);
    Ok((packed.into(), report))
}
