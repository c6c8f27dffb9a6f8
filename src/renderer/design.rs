//! The designs: sequences of passes that draw a view.
//!
//! In: nothing. Out: [`Design`], the names of the designs, and the timed passes of each design.

use super::{global_sort, tile_bins};

/// The sequence of passes that draws a view. All designs draw the same picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Design {
    /// [`TileBins`](Self::TileBins), but [`GlobalSort`](Self::GlobalSort) on software drivers outside of browsers, where it is faster,
    /// and for more than 2²⁴ splats, which bins cannot number.
    #[default]
    Auto,
    /// Bins of splats, each sorted by one workgroup. Software drivers draw with [`GlobalSort`](Self::GlobalSort) if they would end the loops over
    /// the splats of a bin early.
    TileBins,
    /// Global sorts by depth and by tile, in the order of the original rasterizer.
    GlobalSort,
}

impl Design {
    /// All designs, by name.
    pub const NAMES: [(&'static str, Self); 3] =
        [("auto", Self::Auto), ("bins", Self::TileBins), ("sort", Self::GlobalSort)];

    /// Returns the names of the passes that are timed, in frames with motions or without.
    pub(super) fn timed_passes(self, motions: bool) -> &'static [&'static str] {
        let all = match self {
            Self::Auto | Self::TileBins => tile_bins::TIMED_PASSES,
            Self::GlobalSort => global_sort::TIMED_PASSES,
        };
        if motions { all } else { &all[..all.len() - MOTION_PASSES] }
    }
}

/// Number of passes that only a frame with motions has.
const MOTION_PASSES: usize = 2;
