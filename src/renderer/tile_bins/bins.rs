//! The sizes of bins, and the variants that depend on them.
//!
//! In: the size of a picture, the number of Gaussians. Out: the size of bins in tiles, their initial capacity, the variants of the passes.

use super::variant::FEW_BINS_LIMIT;
use crate::renderer::frame::Instance;
use crate::view::tiles;
use glam::UVec2;

/// Up to [`SMALL_BINS`] bins of 2 x 2 tiles, small bins are faster: bins of 4 x 4 tiles would be too few to occupy a GPU. With more than
/// [`CROWD`] Gaussians per large bin, large bins are too long to be sorted at once, and the limit is [`SMALL_BINS_OF_CROWD`], the number of
/// bins that a workgroup of `project_bin` counts in workgroup memory.
const SMALL_BINS: u32 = 1024;
const CROWD: u32 = 1 << 14;
const SMALL_BINS_OF_CROWD: u32 = 2048;
/// From [`FEW_LARGE_BINS`] bins of 4 x 4 tiles on, large bins occupy a GPU if they have at most [`FEW_GAUSSIANS`] Gaussians each.
const FEW_LARGE_BINS: u32 = 128;
const FEW_GAUSSIANS: u32 = 300;

/// Tiles along each side of small and of large bins.
pub(super) const SIDES: [u32; 2] = [2, 4];

/// Returns the number of tiles along each side of a bin, 2 or 4, for a picture size and a number of Gaussians.
pub(super) fn bin_side(picture: UVec2, gaussians: u32) -> u32 {
    let [small, large] = SIDES.map(|side| bin_grid(picture, side).element_product());
    let each = gaussians / large;
    let enough_large = large >= FEW_LARGE_BINS && each <= FEW_GAUSSIANS;
    let limit = if each > CROWD { SMALL_BINS_OF_CROWD } else { SMALL_BINS };
    if enough_large || small > limit { 4 } else { 2 }
}

/// Number of Gaussians from which on `project_bin` is faster if more of its workgroups run at the same time.
const CROWDED: u32 = 1 << 20;

/// Returns whether `project_bin` uses the variant with few counters of bins, so that more of its workgroups run at the same time.
pub(super) fn few_bins(picture: UVec2, side: u32, gaussians: u32) -> bool {
    gaussians >= CROWDED && bin_grid(picture, side).element_product() <= FEW_BINS_LIMIT
}

/// Returns the number of bins across and down a picture.
pub(super) fn bin_grid(picture: UVec2, side: u32) -> UVec2 {
    tiles(picture).map(|tiles| tiles.div_ceil(side))
}

/// The largest number of slots that fits into the bits of a bin entry.
pub(in crate::renderer) const MAX_SLOTS: u32 = 1 << 24;

/// Pictures of up to this number of tiles do not occupy the GPU, so that large batches of `blend_blocks` are faster.
const FEW_TILES: u32 = 1024;
/// Workgroup memory of large batches, bytes.
const LARGE_BATCHES_MEMORY: u32 = 32 * 1024;

/// Returns whether `blend_blocks` uses large batches.
pub(super) fn large_batches(limits: &wgpu::Limits, instances: &[Instance<'_>]) -> bool {
    let few = instances.first().is_some_and(|instance| tiles(instance.view.size).element_product() <= FEW_TILES);
    few && limits.max_compute_workgroup_storage_size >= LARGE_BATCHES_MEMORY
}

/// Initial capacity of a bin in splats: all Gaussians divided by [`FIRST_DIVISOR`], but at least [`FIRST_CAPACITY`], at most [`FIRST_OF_TILE`]
/// for each tile, and never more than all Gaussians or less than [`LEAST_CAPACITY`]. Few bins of few captures exceed it.
const FIRST_CAPACITY: u32 = 4096;
const FIRST_DIVISOR: u32 = 16;
const FIRST_OF_TILE: u32 = 1024;
const LEAST_CAPACITY: u32 = 256;

/// Returns the initial capacity in splats of all bins together, before any splats have been counted.
pub(super) fn first_guess(picture: UVec2, side: u32, slots: u32) -> u32 {
    let bins = bin_grid(picture, side).element_product();
    let capacity = (slots / FIRST_DIVISOR).clamp(FIRST_CAPACITY, FIRST_OF_TILE * side * side);
    bins.saturating_mul(slots.min(capacity).max(LEAST_CAPACITY))
}

/// Entries of all bins together, up to which each bin has room for as many splats as the fullest: [`EQUAL_ROOMS`], or
/// [`EQUAL_ROOMS_OF_PAIR`] for each pair. Beyond it, bins are counted before they are filled, which takes two more dispatches; see also
/// [`counts_first`].
const EQUAL_ROOMS: u32 = 1 << 23;
const EQUAL_ROOMS_OF_PAIR: u32 = 4;

/// Splats, the most at any time, from which on bins are counted before they are filled: in the first frames of a view, before the counts of a
/// like frame are known, and in any frame. If a bin has no room, its tiles search all splats of the picture: with so many it takes seconds.
const COUNTED_UNLESS_KNOWN: u32 = 1 << 18;
const ALWAYS_COUNTED: u32 = 1 << 21;

/// Returns whether the bins of a frame of captures with at most so many splats are counted before they are filled. `is_known` is whether the
/// counts of a like frame are known.
pub(super) fn counts_first(splats: usize, is_known: bool) -> bool {
    splats >= if is_known { ALWAYS_COUNTED } else { COUNTED_UNLESS_KNOWN } as usize
}

/// Returns the largest number of entries of all bins together with room for the same number of splats, in a view of so many pairs.
pub(super) fn equal_rooms(pairs: u32) -> u32 {
    pairs.saturating_mul(EQUAL_ROOMS_OF_PAIR).max(EQUAL_ROOMS)
}

/// Number of Gaussians of a part from which on each thread of `project_bin` processes two, and four Gaussians. If many Gaussians are absent,
/// workgroups of more Gaussians are better utilized, but small parts need as many workgroups as possible.
const MANY_GAUSSIANS: u32 = 1 << 18;
const VERY_MANY_GAUSSIANS: u32 = 1 << 20;

/// Returns the number of Gaussians per thread of `project_bin`.
pub(super) fn per_thread(count: u32) -> u32 {
    match count {
        0..MANY_GAUSSIANS => 1,
        MANY_GAUSSIANS..VERY_MANY_GAUSSIANS => 2,
        VERY_MANY_GAUSSIANS.. => 4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_small_if_large_bins_are_few_or_crowded() {
        for (size, gaussians, side) in [
            (400, 45_000, 2),
            (800, 45_000, 4),
            (800, 600_000, 2),
            (1024, 3_000_000, 2),
            (1200, 90_000, 4),
            (1200, 10_000_000, 2),
        ] {
            assert_eq!(bin_side(UVec2::splat(size), gaussians), side, "{gaussians} Gaussians, {size} pixels");
        }
    }

    #[test]
    fn crowds_are_counted_first_until_their_bins_are_known() {
        let crowds = [100_000, 400_000, 3_000_000].map(|splats| [false, true].map(|known| counts_first(splats, known)));
        assert_eq!(crowds, [[false, false], [true, false], [true, true]]);
    }

    #[test]
    fn many_gaussians_in_few_bins_are_counted_by_small_workgroups() {
        for (size, gaussians, few) in
            [(400, 45_000, false), (1352, 3_000_000, true), (1352, 600_000, false), (4096, 3_000_000, false)]
        {
            let picture = UVec2::new(size, size * 3 / 4);
            let side = bin_side(picture, gaussians);
            assert_eq!(few_bins(picture, side, gaussians), few, "{gaussians} Gaussians, {size} pixels");
        }
    }
}
