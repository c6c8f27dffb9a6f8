//! The bins of the fast renderer.
//!
//! In: the size of a picture and the number of splats in all bins to have room for. Out: [`FastResources`], the
//! counters and entries of bins of a few tiles, and the bind groups of the passes over them. Pictures of any size up to that share them.

use super::parameters::Instance;
use crate::renderer::shaders::FEW_BINS_LIMIT;
use crate::view::tiles;
use glam::UVec2;

/// Buffers and bind groups of the fast renderer.
#[derive(Debug)]
pub(super) struct FastResources {
    /// Counters of even and of odd frames.
    pub bins: [wgpu::Buffer; 2],
    /// One [`VisibleSplat`](crate::renderer::layout::VisibleSplat) for each slot.
    pub visible: wgpu::Buffer,
    /// Color of each slot.
    pub splat_colors: wgpu::Buffer,
    /// Size of all buffers.
    pub bytes: u64,
    /// Bind groups of even and of odd frames.
    pub project_bin: [wgpu::BindGroup; 2],
    pub sort_bins: [wgpu::BindGroup; 2],
    pub colors: [wgpu::BindGroup; 2],
    pub blend_blocks: wgpu::BindGroup,
}

/// Bytes of the color of a splat.
pub(super) const COLOR_BYTES: u64 = 16;

/// Bins of 2 x 2 tiles up to which they are better: a GPU is idle with fewer of 4 x 4. Those of so many Gaussians are too long to be sorted at
/// once, and are small up to as many as a workgroup of `project_bin` counts by itself.
const SMALL_BINS: u32 = 1024;
const CROWD: u32 = 1 << 14;
const SMALL_BINS_OF_CROWD: u32 = 2048;
/// Bins of 4 x 4 tiles from which on they occupy a GPU if they have few Gaussians each.
const FEW_LARGE_BINS: u32 = 128;
const FEW_GAUSSIANS: u32 = 300;

/// Tiles along each side of small and of large bins.
pub(super) const SIDES: [u32; 2] = [2, 4];

/// Returns the number of tiles along each side of a bin, 2 or 4, by the size of the picture and the number of all Gaussians.
pub(super) fn bin_side(picture: UVec2, gaussians: u32) -> u32 {
    let [small, large] = SIDES.map(|side| bin_grid(picture, side).element_product());
    let each = gaussians / large;
    let enough_large = large >= FEW_LARGE_BINS && each <= FEW_GAUSSIANS;
    let limit = if each > CROWD { SMALL_BINS_OF_CROWD } else { SMALL_BINS };
    if enough_large || small > limit { 4 } else { 2 }
}

/// Gaussians from which on more workgroups of `project_bin` at once make it faster; with fewer it is no faster.
const CROWDED: u32 = 1 << 20;

/// Returns whether `project_bin` counts few bins, so that a GPU has room for more of its workgroups.
pub(super) fn few_bins(picture: UVec2, side: u32, gaussians: u32) -> bool {
    gaussians >= CROWDED && bin_grid(picture, side).element_product() <= FEW_BINS_LIMIT
}

/// Returns the number of bins across and down a picture.
pub(super) fn bin_grid(picture: UVec2, side: u32) -> UVec2 {
    tiles(picture).map(|tiles| tiles.div_ceil(side))
}

/// The largest number of slots that the entries of bins have bits for.
pub(super) const MAX_SLOTS: u32 = 1 << 24;

/// Pictures of up to this number of tiles leave the GPU idle: there is room for large batches of `blend_blocks`.
const FEW_TILES: u32 = 1024;
/// Workgroup memory that they need, bytes.
const LARGE_BATCHES_MEMORY: u32 = 32 * 1024;

/// Returns whether `blend_blocks` takes large batches.
pub(super) fn large_batches(limits: &wgpu::Limits, instances: &[Instance<'_>]) -> bool {
    let few = instances.first().is_some_and(|instance| tiles(instance.view.size).element_product() <= FEW_TILES);
    few && limits.max_compute_workgroup_storage_size >= LARGE_BATCHES_MEMORY
}

/// Splats of a bin for which there is room at first: this many, or a share of all Gaussians, but no more than this many for each tile. Few
/// bins of few captures have more.
const FIRST_CAPACITY: u32 = 4096;
const FIRST_SHARE: u32 = 16;
const FIRST_OF_TILE: u32 = 1024;

/// Returns the number of splats for which all bins together have room before any has been counted.
pub(super) fn first_guess(picture: UVec2, side: u32, slots: u32) -> u32 {
    let bins = bin_grid(picture, side).element_product();
    let share = (slots / FIRST_SHARE).clamp(FIRST_CAPACITY, FIRST_OF_TILE * side * side);
    bins.saturating_mul(slots.min(share).max(256))
}

/// The room that bins should have: how many splats all of them together must hold if each holds as many as the fullest.
#[derive(Debug, Default)]
pub(super) struct BinRoom {
    wanted: u32,
    /// The most that a frame has needed since this was reset, and the number of frames.
    peak: u32,
    frames: u32,
}

/// Frames over which the most that one needs is found.
const FRAMES_OF_PEAK: u32 = 1200;
/// Room is given back if so many times less would have been enough.
const MUCH: u32 = 4;

impl BinRoom {
    /// Returns that of bins which should have room for that many splats.
    pub fn of(wanted: u32) -> Self {
        Self { wanted, ..Self::default() }
    }

    /// Returns the number of splats that there should be room for.
    pub fn wanted(&self) -> u32 {
        self.wanted
    }

    /// Notes what a frame has needed, with room for `capacity`. A frame that lacks room is slow, so it grows early, and is only given
    /// back after many frames that did not need it.
    pub fn note(&mut self, needed: u32, capacity: u32) {
        let with_reserve = |needed: u32| needed.saturating_add(needed / 2);
        if needed > capacity / 4 * 3 {
            self.wanted = self.wanted.max(with_reserve(needed));
        }
        self.peak = self.peak.max(needed);
        self.frames += 1;
        if self.frames == FRAMES_OF_PEAK {
            if self.wanted / MUCH > with_reserve(self.peak) {
                self.wanted = with_reserve(self.peak);
            }
            (self.peak, self.frames) = (0, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_small_where_large_ones_would_be_few_or_crowded() {
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
    fn many_gaussians_in_few_bins_are_counted_by_small_workgroups() {
        for (size, gaussians, few) in
            [(400, 45_000, false), (1352, 3_000_000, true), (1352, 600_000, false), (4096, 3_000_000, false)]
        {
            let picture = UVec2::new(size, size * 3 / 4);
            let side = bin_side(picture, gaussians);
            assert_eq!(few_bins(picture, side, gaussians), few, "{gaussians} Gaussians, {size} pixels");
        }
    }

    #[test]
    fn room_grows_before_it_is_lacking() {
        let mut room = BinRoom::default();
        room.note(700, 1000);
        assert_eq!(room.wanted(), 0, "there is enough");
        room.note(800, 1000);
        assert_eq!(room.wanted(), 1200, "half as much again");
    }

    #[test]
    fn views_that_take_turns_keep_the_room_of_the_fullest() {
        let mut room = BinRoom::default();
        for frame in 0..10 * FRAMES_OF_PEAK {
            room.note(if frame % 60 == 0 { 9000 } else { 10 }, room.wanted().max(1000));
        }
        assert_eq!(room.wanted(), 13_500, "a frame every second needs it");
    }

    #[test]
    fn room_that_nothing_needs_is_given_back() {
        let mut room = BinRoom::default();
        room.note(9000, 1000);
        for _ in 0..2 * FRAMES_OF_PEAK {
            room.note(100, room.wanted());
        }
        assert_eq!(room.wanted(), 150, "as much as is needed, and a reserve");
    }
}
