//! Compression: from a scene ready to draw to the packed form.
//!
//! In: a [`RuntimeScene`] and [`CompressSettings`] (or a [`Quality`] that chooses them). Out: a scene in the packed form, its
//! Gaussians in Morton order, and a [`CompressReport`]. The original is not touched.

pub mod codebook;
pub mod order;

use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian};
use crate::scene::packed::MAX_STAGES;
use crate::scene::packed::encode::{Bits, quantize};
use crate::scene::{CodedColors, FilterKind, Form, GaussianScene, PackedScene, RuntimeScene, TemporalFilter};
use codebook::Codebooks;
use ndarray::Array2;
use order::morton_order;
use serde::{Deserialize, Serialize};

/// How much may be lost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quality {
    /// The smallest that still looks right.
    Small,
    /// At most 24 bytes per Gaussian and 1 MB of codebooks; 48 dB and more to the original's pictures.
    #[default]
    Balanced,
    /// Colour rounded but not coded, geometry with more bits: about 60 dB.
    VisuallyLossless,
    /// The runtime form in single precision.
    Lossless,
}

impl Quality {
    /// All of them, by name.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("small", Self::Small),
        ("balanced", Self::Balanced),
        ("visually-lossless", Self::VisuallyLossless),
        ("lossless", Self::Lossless),
    ];
}

/// Every knob of compression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompressSettings {
    /// Bits of geometry; nothing keeps single precision (and the order of the Gaussians).
    pub geometry: Option<Bits>,
    /// Entries of each codebook of colour, up to four; none keeps every coefficient.
    pub codebooks: Vec<usize>,
    /// Whole coefficients are rounded to multiples of this, so that they compress; 0 keeps them as they are.
    pub color_step: f32,
    /// How much each Gaussian's colour counts, in the order of the scene; by opacity unless given.
    #[serde(skip)]
    pub weights: Option<Vec<f32>>,
}

impl From<Quality> for CompressSettings {
    fn from(quality: Quality) -> Self {
        let (geometry, codebooks) = match quality {
            Quality::Small => (
                Some(Bits {
                    mean: 10,
                    mean_t: 10,
                    velocity: 7,
                    sigma_t: 7,
                    scale: 7,
                    rotation: 7,
                    opacity: 7,
                    base: 7,
                    escape: 0.02,
                }),
                vec![1024; 3],
            ),
            Quality::Balanced => (
                Some(Bits {
                    mean: 11,
                    mean_t: 11,
                    velocity: 8,
                    sigma_t: 8,
                    scale: 8,
                    rotation: 8,
                    opacity: 7,
                    base: 8,
                    escape: 0.02,
                }),
                vec![2048, 2048, 2048, 1024],
            ),
            Quality::VisuallyLossless => (
                Some(Bits {
                    mean: 14,
                    mean_t: 14,
                    velocity: 12,
                    sigma_t: 10,
                    scale: 11,
                    rotation: 11,
                    opacity: 10,
                    base: 10,
                    escape: 0.03,
                }),
                Vec::new(),
            ),
            Quality::Lossless => (None, Vec::new()),
        };
        let color_step = if quality == Quality::VisuallyLossless { 1.0 / 256.0 } else { 0.0 };
        Self { geometry, codebooks, color_step, weights: None }
    }
}

/// What compression did.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CompressReport {
    /// Gaussians.
    pub gaussians: usize,
    /// Bytes of Gaussians and colours in memory, before and after.
    pub memory_before: usize,
    /// The same, packed: what the GPU holds.
    pub memory_after: usize,
    /// Entries of each codebook.
    pub codebooks: Vec<u32>,
}

/// Why a scene is not compressed.
#[derive(Debug, thiserror::Error)]
pub enum CompressError {
    /// It is already.
    #[error("the scene is packed already: compress the checkpoint or the lossless package it was made from")]
    AlreadyPacked,
    /// Codebooks cannot go without quantised geometry.
    #[error("codebooks need quantised geometry: choose a quality other than lossless, or no codebooks")]
    CodebooksAlone,
    /// Too many codebooks, or of no entries, or too many.
    #[error("at most {MAX_STAGES} codebooks of 1 to 65536 entries each, not {0:?}")]
    Codebooks(Vec<usize>),
    /// A Gaussian cannot be drawn.
    #[error(transparent)]
    Invalid(#[from] InvalidGaussian),
}

/// Compresses a scene. `done` is told each time a codebook is finished.
///
/// # Errors
/// When the scene is packed already or the settings do not fit together.
pub fn compress(
    scene: RuntimeScene,
    settings: &CompressSettings,
) -> Result<(GaussianScene, CompressReport), CompressError> {
    compress_with(scene, settings, || {})
}

/// As [`compress`]; `done` is called after each codebook.
///
/// # Errors
/// As [`compress`].
pub fn compress_with(
    scene: RuntimeScene,
    settings: &CompressSettings,
    done: impl FnMut(),
) -> Result<(GaussianScene, CompressReport), CompressError> {
    if scene.packed.is_some() {
        return Err(CompressError::AlreadyPacked);
    }
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
    let order = morton_order(&scene.gaussians);
    let gaussians: Vec<Gaussian> = order.iter().map(|&index| scene.gaussians[index as usize]).collect();
    let coded = (!books.is_empty()).then(|| {
        let weights = match &settings.weights {
            Some(weights) => order.iter().map(|&index| weights[index as usize]).collect(),
            None => gaussians.iter().map(|gaussian| gaussian.opacity).collect::<Vec<_>>(),
        };
        code(&scene.harmonics, &order, &weights, books, bits.base, done)
    });
    let (colors, base) = coded.map_or((None, [0.0; 2]), |(colors, base)| (Some(colors), base));
    let (records, ranges) = quantize(&gaussians, bits, base, scene.trained_with.time_span());
    report.codebooks = colors.as_ref().map(|colors| colors.entries.clone()).unwrap_or_default();
    let harmonics = match &colors {
        Some(_) => Harmonics { coefficients: 1, ..Harmonics::default() },
        None => rounded(super::prune::select_harmonics(&scene.harmonics, &order), settings.color_step),
    };
    let packed = PackedScene { records, ranges, colors };
    let filter = scene.filter.map(|filter| match filter.kind {
        // Lifespans are rounded too: what the filter promises must hold for those that are drawn.
        FilterKind::Support => {
            let gaussians = (0..packed.len()).map(|index| packed.gaussian(index));
            TemporalFilter::support(gaussians, scene.trained_with.time_interval, filter.segments)
        }
        FilterKind::KeyFrame | FilterKind::Interval => filter.select(&order),
    });
    report.memory_after = packed.size() + size_of_val(harmonics.values.as_slice());
    let scene = GaussianScene {
        form: Form::Packed(packed),
        harmonics,
        filter,
        environment: scene.environment,
        trained_with: scene.trained_with,
        playback: scene.playback,
    };
    Ok((scene, report))
}

/// Coefficients as multiples of a step, if it is one.
fn rounded(mut harmonics: Harmonics, step: f32) -> Harmonics {
    if step > 0.0 {
        harmonics.values.iter_mut().for_each(|value| *value = (*value / step).round() * step);
    }
    harmonics
}

/// Codes of all colours in the order given, and the ends of their first coefficients.
fn code(
    harmonics: &Harmonics,
    order: &[u32],
    weights: &[f32],
    entries: &[usize],
    base_bits: u32,
    done: impl FnMut(),
) -> (CodedColors, [f32; 2]) {
    let mut colors = CodedColors { degree: harmonics.degree, degree_t: harmonics.degree_t, ..Default::default() };
    let coefficients = colors.coefficients();
    let of = |index: u32| &harmonics.of(index as usize)[..coefficients * 3];
    let ends = order
        .iter()
        .flat_map(|&index| &of(index)[..3])
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    let (low, size) = if ends.0 > ends.1 { (0.0, 0.0) } else { (ends.0, ends.1 - ends.0) };
    // A base of fewer bits takes so many of the 1024 values, the first and last among them.
    let levels = ((1u32 << base_bits.clamp(1, 10)) - 1) as f32;
    let place = |value: f32| {
        let level = if size > 0.0 { ((value - low) / size * levels).round() } else { 0.0 };
        (level * (1023.0 / levels)).round() as u32
    };
    let columns = coefficients * 3 - 3;
    let books = if columns == 0 {
        Codebooks::default()
    } else {
        let mut rest = Array2::zeros((order.len(), columns));
        for (mut row, &index) in rest.rows_mut().into_iter().zip(order) {
            row.iter_mut().zip(&of(index)[3..]).for_each(|(to, from)| *to = *from);
        }
        Codebooks::train(rest, weights, entries, done)
    };
    let code = |stage: usize, row: usize| books.codes.get(stage).map_or(0, |codes| u32::from(codes[row]));
    colors.records = order
        .iter()
        .enumerate()
        .map(|(row, &index)| {
            let base = of(index)[..3].iter().zip([0, 10, 20]).fold(0, |word, (v, shift)| word | place(*v) << shift);
            [base, code(0, row) | code(1, row) << 16, code(2, row) | code(3, row) << 16]
        })
        .collect();
    let words = colors.words_per_entry();
    for (book, scales) in books.entries.iter().zip(&books.scales) {
        colors.entries.push(book.nrows() as u32);
        // The first coefficient stays 0 here, and the end is padded to whole words.
        let padded = |of: &mut dyn Iterator<Item = f32>| {
            let mut row = vec![0.0; words * 4];
            row[3..].iter_mut().zip(of).for_each(|(to, from)| *to = from);
            row
        };
        for entry in book.rows() {
            let row = padded(&mut entry.iter().map(|&byte| f32::from(byte)));
            let word = |four: &[f32]| u32::from_le_bytes(std::array::from_fn(|i| four[i] as i8 as u8));
            colors.codebooks.extend(row.chunks_exact(4).map(word));
        }
        let row = padded(&mut scales.iter().copied());
        colors.scales.extend(row.chunks_exact(4).map(|four| [four[0], four[1], four[2], four[3]]));
    }
    (colors, [low, low + size * (1023.0 / 1022.0)])
}
