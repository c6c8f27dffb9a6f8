//! The packed form: records, ranges and colors.
//!
//! In: the parts, from the encoder or a file. Out: a [`PackedScene`], its size in memory, and whether its parts fit
//! together.

use super::colors::CodedColors;
use super::lanes::{self, BLOCK, BLOCK_RANGES, RECORD_WORDS, SHARED_RANGES};
use super::runs::Runs;
use crate::gaussian::Harmonics;
use rayon::prelude::*;

/// Packed Gaussians and their color.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedScene {
    /// One record for each Gaussian: sixteen lanes, two to a word, the first in the lower half.
    pub records: Vec<[u32; RECORD_WORDS]>,
    /// Ranges of the lanes: [`SHARED_RANGES`] four-vectors for all Gaussians, then [`BLOCK_RANGES`] for each [`BLOCK`]
    /// of them.
    pub ranges: Vec<[f32; 4]>,
    /// Their color.
    pub colors: PackedColors,
    /// Numbers of Gaussians up to the ends of the layers but the last, ascending multiples of [`BLOCK`]: the Gaussians
    /// of a layer are less important than those before it, so that the first layers show the scene coarsely. At most
    /// 15. Empty: one layer. Of a scene with [runs](Self::runs) this holds within the stretches of each chunk file.
    pub layers: Vec<usize>,
    /// Which of them are in which chunk file, if their order is that of chunk files. Then `layers` are those of the runs.
    pub runs: Option<Runs>,
}

/// The color of packed Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub enum PackedColors {
    /// Every coefficient, in single precision.
    Whole(Harmonics),
    /// Coded by codebooks.
    Coded(CodedColors),
}

impl PackedScene {
    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Returns whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Returns the bytes in host memory.
    pub fn size(&self) -> usize {
        let colors = match &self.colors {
            PackedColors::Whole(harmonics) => size_of_val(harmonics.values.as_slice()),
            PackedColors::Coded(colors) => colors.size(),
        };
        size_of_val(self.records.as_slice()) + size_of_val(self.ranges.as_slice()) + colors
    }

    /// Returns the number of ranges (four-vectors) that `count` Gaussians need.
    pub fn range_count(count: usize) -> usize {
        SHARED_RANGES + BLOCK_RANGES * count.div_ceil(BLOCK)
    }

    /// Checks that the records, ranges and colors fit together and every code has an entry, so that no index is out of
    /// range, here or on a GPU.
    ///
    /// # Errors
    /// A description of the first part that does not fit.
    pub fn check(&self) -> Result<(), &'static str> {
        if self.ranges.len() != Self::range_count(self.len()) {
            return Err("the ranges do not fit the number of Gaussians");
        }
        if !are_layers(&self.layers, self.len()) {
            return Err("layers that are not ascending numbers of whole blocks, or too many");
        }
        if let Some(runs) = &self.runs {
            runs.check(self.len())?;
            if runs.layers() != self.layers {
                return Err("layers that are not those of the runs");
            }
        }
        if !self.ranges.as_flattened().iter().all(|value| value.is_finite()) {
            return Err("a range that is not finite");
        }
        if !self.records.par_iter().all(|&record| lanes::left_out(record) < 4) {
            return Err("a rotation that leaves out a component other than the four");
        }
        match &self.colors {
            PackedColors::Whole(harmonics) if harmonics.is_consistent(self.len()) => Ok(()),
            PackedColors::Whole(_) => Err("its colors are those of another number of Gaussians"),
            PackedColors::Coded(colors) => colors.check(self.len()),
        }
    }
}

/// Largest number of ends of layers.
const MAX_LAYER_ENDS: usize = 15;

/// Returns whether these are numbers of Gaussians, of `count`, at which layers but the last can end.
pub(crate) fn are_layers(layers: &[usize], count: usize) -> bool {
    let ascending = layers.is_sorted_by(|a, b| a < b) && layers.last().is_none_or(|&last| last < count);
    ascending && layers.len() <= MAX_LAYER_ENDS && layers.iter().all(|&end| end > 0 && end.is_multiple_of(BLOCK))
}
