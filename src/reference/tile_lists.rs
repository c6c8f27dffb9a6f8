//! The passes between `project` and the last pass: the splats of each tile, front to back.
//!
//! In: splats and their view. Out: [`TileLists`].

use super::bin::{Pair, bin, ranges};
use super::project::Splat;
use super::sort::sort;
use crate::view::View;
use std::ops::Range;

/// The splats of every tile of a view, front to back.
#[derive(Debug)]
pub struct TileLists {
    /// All pairs, ordered by tile, then depth, then index.
    pub pairs: Vec<Pair>,
    /// The range of each tile in `pairs`.
    pub ranges: Vec<Range<usize>>,
    /// Number of splats that cover at least one tile.
    pub visible: u32,
}

/// Runs the passes between `project` and the last pass: `sort` by depth, `bin`, `sort` by tile, `ranges`.
pub fn tile_lists(splats: &[Splat], view: &View) -> TileLists {
    let mut order: Vec<u32> = (0..splats.len() as u32).filter(|&i| splats[i as usize].is_visible()).collect();
    // Positive floats have the same order as their bits. Depths are taken from the near plane of an orthographic
    // camera, which may be behind it.
    let nearest = if view.orthographic { view.near } else { 0.0 };
    sort(&mut order, |&i| (splats[i as usize].depth - nearest).to_bits());
    let mut pairs = bin(splats, &order, view.tiles());
    sort(&mut pairs, |pair| pair.tile);
    let ranges = ranges(&pairs, view.tiles());
    TileLists { pairs, ranges, visible: order.len() as u32 }
}
