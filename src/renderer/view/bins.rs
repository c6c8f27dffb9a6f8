//! The bins of the fast renderer.
//!
//! In: the size of a picture and the number of pairs of splats and tiles to have room for. Out: [`FastResources`], the
//! counters and entries of bins of 4 x 4 tiles, and the bind groups of both passes over them.

use super::ViewRenderer;
use crate::renderer::layout::BIN_COUNTERS;
use crate::renderer::memory::Allocator;
use crate::renderer::pipelines::Renderer;
use crate::view::tiles;
use glam::UVec2;
use wgpu::BufferUsages;

/// Buffers and bind groups of the fast renderer.
#[derive(Debug)]
pub(super) struct FastResources {
    /// Counters of even and of odd frames.
    pub bins: wgpu::Buffer,
    /// Size of all buffers.
    pub bytes: u64,
    pub project_bin: wgpu::BindGroup,
    pub sort_blend: wgpu::BindGroup,
}

/// Tiles along each side of a bin.
const BIN_TILES: u32 = 4;

/// Returns the number of bins across and down a picture.
pub(super) fn bin_grid(picture: UVec2) -> UVec2 {
    (tiles(picture) + (BIN_TILES - 1)) / BIN_TILES
}

/// Returns the number of splats that each bin has room for.
pub(super) fn bin_capacity(picture: UVec2, pairs: u32) -> u32 {
    let grid = bin_grid(picture);
    (pairs / (grid.x * grid.y)).max(256)
}

impl ViewRenderer {
    /// Creates bins for a picture, with room for `pairs` splats in all of them.
    pub(super) fn make_fast(
        &self,
        renderer: &Renderer,
        allocator: &Allocator<'_>,
        picture: UVec2,
        pairs: u32,
        instance: wgpu::BindingResource<'_>,
        splats: &wgpu::Buffer,
    ) -> FastResources {
        let grid = bin_grid(picture);
        let count = u64::from(grid.x * grid.y);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let bins = allocator.buffer("gs4d bins", 2 * 4 * (count + u64::from(BIN_COUNTERS)), usage);
        let size = count * u64::from(bin_capacity(picture, pairs)) * 8;
        let entries = allocator.buffer("gs4d bin entries", size, BufferUsages::STORAGE);
        let (splats, entries) = (splats.as_entire_binding(), entries.as_entire_binding());
        let counters = bins.as_entire_binding();
        let resources = [instance, splats.clone(), counters.clone(), entries.clone()];
        let project_bin = allocator.bind_group("gs4d project_bin", &renderer.layouts.project_bin, &resources);
        let resources = [splats, counters, entries];
        let sort_blend = allocator.bind_group("gs4d sort_blend", &renderer.layouts.sort_blend, &resources);
        FastResources { bytes: bins.size() + size, bins, project_bin, sort_blend }
    }
}
