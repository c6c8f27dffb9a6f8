//! Another order of the Gaussians of a packed scene.
//!
//! In: a packed scene, an order. Out: the same Gaussians in that order. Means and velocities are rounded once more, within
//! the boxes of their new blocks, as finely as [`Bits::default`] says; every other value keeps its bits.

use super::colors::CodedColors;
use super::encode::Bits;
use super::lanes::{self, DISPLACEMENT, MEAN, SHARED_RANGES};
use super::order::{Order, is_filler};
use super::scene::{PackedColors, PackedScene};
use crate::gaussian::Gaussian;

impl PackedScene {
    /// Returns the Gaussians in an order of their indices; a filler has opacity 0. `reach` is as for
    /// [`encode`](Self::encode).
    ///
    /// # Panics
    /// If an index is out of range.
    pub(crate) fn reordered(&self, order: &Order, reach: f32) -> Self {
        let Order { indices, layers, runs } = order;
        let gaussians: Vec<Gaussian> = indices.iter().map(|&index| self.gaussian(index as usize)).collect();
        // Velocities are stored as displacements within σ_t, which keeps its bits.
        let bits = Bits { sigma_t: 15, ..Bits::default() };
        let fresh = Self::encode(&gaussians, &bits, PackedColors::Coded(CodedColors::default()), [0.0; 2], reach);
        let record = |(place, &index): (usize, &u32)| {
            let (mut own, rounded) = (lanes::unpack(self.records[index as usize]), lanes::unpack(fresh.records[place]));
            for first in [MEAN, DISPLACEMENT] {
                own[first..first + 3].copy_from_slice(&rounded[first..first + 3]);
            }
            let record = lanes::pack(own);
            if is_filler(indices, place) { lanes::hidden(record) } else { record }
        };
        let colors = match &self.colors {
            PackedColors::Whole(harmonics) => PackedColors::Whole(harmonics.select(indices)),
            PackedColors::Coded(colors) => PackedColors::Coded(colors.select(indices)),
        };
        Self {
            records: indices.iter().enumerate().map(record).collect(),
            ranges: [&self.ranges[..SHARED_RANGES], &fresh.ranges[SHARED_RANGES..]].concat(),
            colors,
            layers: layers.clone(),
            runs: runs.clone(),
        }
    }
}
