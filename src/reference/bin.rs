//! `bin` and `ranges`: splat–tile pairs, and the range of each tile in them; CPU reference of
//! `shaders/global_sort/bin.wgsl` and `shaders/global_sort/ranges.wgsl`.
//!
//! In: splats and their order by depth. Out: [`Pair`]s in that order; and, from sorted pairs, one range for each tile.

use super::Splat;
use crate::gaussian::overlap::tile_index;
use glam::UVec2;
use std::ops::Range;

/// One overlap of a splat with a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pair {
    /// Tile, row by row.
    pub tile: u32,
    /// Index of the splat.
    pub splat: u32,
}

/// Returns the pairs of every visible splat, in the order given; the tiles of a splat row by row. `grid` is the number
/// of tiles across and down.
///
/// # Panics
/// If `order` contains an index beyond `splats`.
pub fn bin(splats: &[Splat], order: &[u32], grid: UVec2) -> Vec<Pair> {
    let mut pairs = Vec::with_capacity(order.iter().map(|&i| splats[i as usize].tiles.count() as usize).sum());
    for &splat in order {
        let tiles = splats[splat as usize].tiles.tiles();
        pairs.extend(tiles.map(|tile| Pair { tile: tile_index(tile, grid), splat }));
    }
    pairs
}

/// Returns the range of every tile of a grid in pairs sorted by tile.
pub fn ranges(pairs: &[Pair], grid: UVec2) -> Vec<Range<usize>> {
    let first = |tile: u32| pairs.partition_point(|pair| pair.tile < tile);
    (0..grid.element_product()).map(|tile| first(tile)..first(tile + 1)).collect()
}
