//! The buffers of tile bins, and the bind groups over them.
//!
//! In: the sizes of a view. Out: [`BinBuffers`], for pictures of any size up to [`Sizes::picture`].

use super::bins::{SIDES, bin_grid};
use crate::renderer::layout::{BIN_COUNTERS, SplatShape, VisibleSplat};
use crate::renderer::layouts::Layouts;
use crate::renderer::memory::Allocator;
use crate::renderer::view::Sizes;
use crate::view::tiles;
use std::cell::Cell;
use wgpu::{BindingResource, BufferUsages};

/// Buffers and bind groups. Pairs of them belong to even and to odd frames.
#[derive(Debug)]
pub(in crate::renderer) struct BinBuffers {
    /// Size of all buffers.
    pub bytes: u64,
    /// Counters (see [`BIN_COUNTERS`]), of parts and of bins; the place of each bin.
    pub bins: [wgpu::Buffer; 2],
    pub blend_blocks: wgpu::BindGroup,
    /// One [`SplatShape`] for each slot.
    splats: wgpu::Buffer,
    /// One [`VisibleSplat`] for each slot.
    pub(super) visible: wgpu::Buffer,
    /// Color of each slot.
    splat_colors: wgpu::Buffer,
    pub(super) project_bin: [wgpu::BindGroup; 2],
    pub(super) fill_bins: [wgpu::BindGroup; 2],
    pub(super) sort_bins: [wgpu::BindGroup; 2],
    pub(super) colors: [wgpu::BindGroup; 2],
}

/// Bytes of the color of a splat.
const COLOR_BYTES: usize = 16;

impl BinBuffers {
    /// Creates the buffers, with `sizes.entries` entries in all bins together. `frame` and `instance` are the uniforms of the frame and of its
    /// instances.
    pub(in crate::renderer) fn new(
        allocator: Allocator<'_>,
        layouts: &Layouts,
        sizes: Sizes,
        frame: &wgpu::Buffer,
        instance: BindingResource<'_>,
    ) -> Self {
        let layouts = &layouts.tile_bins;
        let bytes = Cell::new(0);
        let storage = |label, count: u64, each: usize, usage: BufferUsages| {
            let size = count * each as u64;
            bytes.set(bytes.get() + size);
            allocator.buffer(label, size, BufferUsages::STORAGE | usage)
        };
        let none = BufferUsages::empty();
        let [slots, pairs, entries] = [sizes.slots, sizes.pairs, sizes.entries.max(1)].map(u64::from);
        let splats = storage("gs4d splats", slots, size_of::<SplatShape>(), none);
        let pair_splats = storage("gs4d pair splats", pairs, 4, none);
        let tile_ranges = storage("gs4d tile ranges", u64::from(tiles(sizes.picture).element_product()), 8, none);
        // The largest number of bins of a picture of this size.
        let count = bin_grid(sizes.picture, SIDES[0]).element_product();
        let counters = u64::from(2 * count + BIN_COUNTERS + sizes.parts);
        let bins = [(); 2].map(|()| storage("gs4d bins", counters, 4, BufferUsages::COPY_SRC));
        let entries = storage("gs4d bin entries", entries, 8, none);
        let ordered = storage("gs4d ordered entries", u64::from(sizes.ordered.max(1)), 8, none);
        let visible = storage("gs4d visible", slots, size_of::<VisibleSplat>(), none);
        let splat_colors = storage("gs4d splat colors", slots, COLOR_BYTES, none);

        let group = |label, layout, first: &BindingResource<'_>, buffers: &[&wgpu::Buffer]| {
            let others = buffers.iter().map(|buffer| buffer.as_entire_binding());
            let resources: Vec<_> = [first.clone()].into_iter().chain(others).collect();
            allocator.bind_group(label, layout, &resources)
        };
        let frame = frame.as_entire_binding();
        let both = [[&bins[0], &bins[1]], [&bins[1], &bins[0]]];
        let project_bin = both.map(|[now, _]| {
            group("gs4d project_bin", &layouts.project_bin, &instance, &[&splats, now, &entries, &visible])
        });
        let fill_bins = both
            .map(|[now, _]| group("gs4d fill_bins", &layouts.fill_bins, &frame, &[&splats, now, &entries, &visible]));
        let sort_bins = both.map(|[now, next]| {
            let buffers = [now, next, &entries, &tile_ranges, &pair_splats, &visible, &ordered];
            group("gs4d sort_bins", &layouts.sort_bins, &frame, &buffers)
        });
        let colors =
            both.map(|[now, _]| group("gs4d colors", &layouts.colors, &instance, &[now, &visible, &splat_colors]));
        let lists = [&pair_splats, &splats, &splat_colors, &visible];
        let ranges = tile_ranges.as_entire_binding();
        let blend_blocks = group("gs4d blend_blocks", &layouts.blend_blocks, &ranges, &lists);
        let bytes = bytes.get();
        Self { bytes, bins, blend_blocks, splats, visible, splat_colors, project_bin, fill_bins, sort_bins, colors }
    }

    /// Creates the bind groups of `motion`, given its `uniforms`.
    pub(in crate::renderer) fn motion(
        &self,
        allocator: Allocator<'_>,
        layouts: &Layouts,
        uniforms: &[BindingResource<'_>],
    ) -> [wgpu::BindGroup; 2] {
        self.bins.each_ref().map(|bins| {
            let own = [bins, &self.visible, &self.splats, &self.splat_colors].map(wgpu::Buffer::as_entire_binding);
            allocator.bind_group("gs4d motion", &layouts.tile_bins.motion, &[uniforms, &own].concat())
        })
    }
}
