//! The buffers of tile bins, and the bind groups over them.
//!
//! In: the sizes of a view, the buffers that all views share. Out: [`BinBuffers`], for pictures of any size up to [`Sizes::picture`].

use super::bins::{SIDES, bin_grid};
use super::scratch::{Claim, ScratchBuffers};
use crate::renderer::frame::{Preparation, Sizes};
use crate::renderer::layout::BIN_COUNTERS;
use crate::view::tiles;
use std::cell::Cell;
use wgpu::{BindGroup, BindingResource, BufferUsages};

/// Buffers and bind groups. Pairs of them belong to even and to odd frames.
#[derive(Debug)]
pub(in crate::renderer) struct BinBuffers {
    pub(super) sizes: Sizes,
    /// Bytes of the view's own buffers.
    pub(super) bytes: u64,
    /// The buffers that all views share.
    pub claim: Claim,
    /// Counters (see [`BIN_COUNTERS`]), of parts and of bins; the place of each bin.
    pub bins: [wgpu::Buffer; 2],
    pub(super) find_surfaces: [BindGroup; 2],
    pub(super) project_bin: [BindGroup; 2],
    pub(super) fill_bins: [BindGroup; 2],
    pub(super) sort_bins: [BindGroup; 2],
    pub(super) colors: [BindGroup; 2],
    pub(super) blend_blocks: BindGroup,
}

impl BinBuffers {
    /// Creates the view's own buffers, and claims those that all views share, with `sizes.entries` entries in all bins together. The uniforms
    /// are those of the frame and of its instances.
    pub(super) fn new(
        preparation: &Preparation<'_>,
        sizes: Sizes,
        [frame, instance]: [BindingResource<'_>; 2],
    ) -> Self {
        let (allocator, layouts) = (preparation.allocator(), &preparation.renderer.layouts.tile_bins);
        let bytes = Cell::new(0);
        let storage = |label, count: u32, each: u64, usage: BufferUsages| {
            let size = u64::from(count) * each;
            bytes.set(bytes.get() + size);
            allocator.buffer(label, size, BufferUsages::STORAGE | usage)
        };
        let tiles = tiles(sizes.picture).element_product();
        let tile_ranges = storage("gs4d tile ranges", tiles, 8, BufferUsages::empty());
        let tile_surfaces = storage("gs4d tile surfaces", tiles, 4, BufferUsages::empty());
        // The largest number of bins of a picture of this size.
        let count = bin_grid(sizes.picture, SIDES[0]).element_product();
        let counters = 2 * count + BIN_COUNTERS + sizes.parts;
        let bins = [(); 2].map(|()| storage("gs4d bins", counters, 4, BufferUsages::COPY_SRC));
        let claim = preparation.renderer.scratch.claim(allocator, &sizes);
        let ScratchBuffers { splats, visible, splat_colors, pair_splats, entries, ordered, .. } = &*claim.buffers;

        let group = |label, layout, first: &BindingResource<'_>, buffers: &[&wgpu::Buffer]| {
            let others = buffers.iter().map(|buffer| buffer.as_entire_binding());
            let resources: Vec<_> = [first.clone()].into_iter().chain(others).collect();
            allocator.bind_group(label, layout, &resources)
        };
        let both = [[&bins[0], &bins[1]], [&bins[1], &bins[0]]];
        let surfaces = tile_surfaces.as_entire_binding();
        let find_surfaces = both.map(|[now, _]| group("gs4d find_surfaces", &layouts.find_surfaces, &surfaces, &[now]));
        let project_bin = both.map(|[now, _]| {
            group("gs4d project_bin", &layouts.project_bin, &instance, &[splats, now, entries, visible, &tile_surfaces])
        });
        let fill_bins =
            both.map(|[now, _]| group("gs4d fill_bins", &layouts.fill_bins, &frame, &[splats, now, entries, visible]));
        let sort_bins = both.map(|[now, next]| {
            let buffers = [now, next, entries, &tile_ranges, pair_splats, visible, ordered];
            group("gs4d sort_bins", &layouts.sort_bins, &frame, &buffers)
        });
        let colors =
            both.map(|[now, _]| group("gs4d colors", &layouts.colors, &instance, &[now, visible, splat_colors]));
        let lists = [pair_splats, splats, splat_colors, visible];
        let ranges = tile_ranges.as_entire_binding();
        let blend_blocks = group("gs4d blend_blocks", &layouts.blend_blocks, &ranges, &lists);
        let bytes = bytes.get();
        Self { sizes, bytes, claim, bins, find_surfaces, project_bin, fill_bins, sort_bins, colors, blend_blocks }
    }
}
