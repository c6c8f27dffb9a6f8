//! The designs: sequences of passes that draw a view.
//!
//! In: nothing. Out: [`Design`], the names of the designs, and the timed passes of each design.

use super::timing::{MOTION_PASSES, TIMED_FAST_PASSES, TIMED_PASSES};

/// The sequence of passes that draws a view. All designs draw the same picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Design {
    /// [`Fast`](Self::Fast), but [`Reference`](Self::Reference) on software drivers, where it is faster, in browsers, where the fast design is
    /// untested, and for more than 2²⁴ splats, which bins cannot number.
    #[default]
    Auto,
    /// Bins of splats, each sorted by one workgroup. Software drivers draw with [`Reference`](Self::Reference) if they would end the loops over
    /// the splats of a bin early.
    Fast,
    /// Global sorts by depth and by tile, in the order of the original rasterizer.
    Reference,
}

impl Design {
    /// All designs, by name.
    pub const NAMES: [(&'static str, Self); 3] =
        [("auto", Self::Auto), ("fast", Self::Fast), ("reference", Self::Reference)];

    /// Returns the names of the passes that are timed, in frames with motions or without.
    pub(super) fn timed_passes(self, motions: bool) -> &'static [&'static str] {
        let all = match self {
            Self::Auto | Self::Fast => TIMED_FAST_PASSES,
            Self::Reference => TIMED_PASSES,
        };
        if motions { all } else { &all[..all.len() - MOTION_PASSES] }
    }
}
