//! The designs: sequences of passes that draw a view.
//!
//! In: nothing. Out: [`Design`], the names of the designs.

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
}
