//! Creation of the resources of a view.
//!
//! In: sizes, the opaque depth and the environment map. Out: [`Resources`]: buffers, targets and bind groups.

use super::bins::{COLOR_BYTES, FastResources, SIDES, bin_grid};
use super::resources::{PassBuffers, Resources, pixel_group, texture_bytes, tile_steps};
use super::sizes::Sizes;
use super::view_renderer::ViewRenderer;
use crate::renderer::design::Design;
use crate::renderer::layout::{
    self, BIN_COUNTERS, BLOCK, DEPTH_STEPS, DIGIT_BITS, DIGITS, INSTANCE_STRIDE, INSTANCES_AT_ONCE, INSTANCES_BOUND,
    SortStep, VisibleSplat,
};
use crate::renderer::memory::Allocator;
use crate::renderer::pipelines::Renderer;
use crate::view::tiles;
use std::cell::Cell;
use wgpu::{BufferUsages, TextureFormat};

impl ViewRenderer {
    /// Creates the resources.
    pub(super) fn make(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        sizes: Sizes,
        opaque: wgpu::TextureView,
        environment: wgpu::Buffer,
    ) -> Resources {
        let Sizes { slots, pairs, parts, picture: size, .. } = sizes;
        let allocator = renderer.allocator(device);
        let bytes = Cell::new(0);
        let fast = self.design == Design::Fast;
        let storage = |label, count: u32, each: usize| {
            let size = u64::from(count) * each as u64;
            bytes.set(bytes.get() + size);
            allocator.buffer(label, size, BufferUsages::STORAGE)
        };
        let slot_blocks = slots.div_ceil(BLOCK);
        let stride = slot_blocks.max(pairs.div_ceil(BLOCK));
        let tiles = tiles(size);
        // A binding at the last instance has the same length as at the first.
        let instance_slots = u64::from(parts + INSTANCES_AT_ONCE - 1);
        let instances =
            allocator.buffer("gs4d instances", instance_slots * u64::from(INSTANCE_STRIDE), BufferUsages::UNIFORM);
        let splat_size = if fast { size_of::<layout::SplatShape>() } else { size_of::<layout::SplatRecord>() };
        let splats = storage("gs4d splats", slots, splat_size);
        // Buffers that only the reference design uses have a single element in the fast design.
        let sorting = |label, count: u32| storage(label, if fast { 1 } else { count }, 4);
        let depth_keys = sorting("gs4d depth keys", slots);
        let keys = [(); 2].map(|()| sorting("gs4d sort keys", slots));
        let order = [(); 2].map(|()| sorting("gs4d sort values", slots));
        let offsets = sorting("gs4d offsets", slots + slot_blocks);
        let pair_tiles = [(); 2].map(|()| sorting("gs4d pair tiles", pairs));
        // After an even number of steps the pairs are in the buffers that `bin` wrote.
        let sorted = tile_steps(size) as usize % 2;
        let pair_splats = [0, 1].map(|i| {
            if i == sorted { storage("gs4d pair splats", pairs, 4) } else { sorting("gs4d pair splats", pairs) }
        });
        let histogram = sorting("gs4d histogram", DIGITS * (stride + 1));
        let tile_ranges = storage("gs4d tile ranges", tiles.x * tiles.y, 8);
        let color = allocator.texture("gs4d color", size, self.pixels.precision.format());
        let depth = allocator.texture("gs4d depth", sizes.depths, TextureFormat::Rg32Float);
        let color_view = color.create_view(&wgpu::TextureViewDescriptor::default());
        let depth_view = depth.create_view(&wgpu::TextureViewDescriptor::default());
        self.write_steps(queue, stride);

        let layouts = &renderer.layouts;
        let frame = self.frame.as_entire_binding();
        let counters = self.counters.as_entire_binding();
        let step = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &self.steps,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<SortStep>() as u64),
        });
        let sort =
            |keys_in: &wgpu::Buffer, values_in: &wgpu::Buffer, keys_out: &wgpu::Buffer, values_out: &wgpu::Buffer| {
                let resources = [
                    step.clone(),
                    frame.clone(),
                    counters.clone(),
                    keys_in.as_entire_binding(),
                    values_in.as_entire_binding(),
                    keys_out.as_entire_binding(),
                    values_out.as_entire_binding(),
                    histogram.as_entire_binding(),
                ];
                allocator.bind_group("gs4d sort", &layouts.sort, &resources)
            };
        let instance = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &instances,
            offset: 0,
            size: std::num::NonZeroU64::new(u64::from(INSTANCES_BOUND)),
        });
        let fast = (self.design == Design::Fast).then(|| {
            let buffers = [&splats, &tile_ranges, &pair_splats[sorted]];
            self.make_fast(renderer, &allocator, sizes, instance.clone(), buffers)
        });
        Resources {
            sizes,
            bytes: bytes.get()
                + texture_bytes(&color)
                + texture_bytes(&depth)
                + fast.as_ref().map_or(0, |fast| fast.bytes),
            project: allocator.bind_group(
                "gs4d project",
                &layouts.project,
                &[instance, splats.as_entire_binding(), depth_keys.as_entire_binding()],
            ),
            sort_depth: [
                // The values of the first step are the slots themselves, so the buffer bound for the values is not read.
                sort(&depth_keys, &order[1], &keys[0], &order[0]),
                sort(&keys[0], &order[0], &keys[1], &order[1]),
                sort(&keys[1], &order[1], &keys[0], &order[0]),
            ],
            sort_tiles: [0, 1].map(|i| sort(&pair_tiles[i], &pair_splats[i], &pair_tiles[1 - i], &pair_splats[1 - i])),
            arguments: allocator.bind_group(
                "gs4d arguments",
                &layouts.arguments,
                &[self.arguments.as_entire_binding()],
            ),
            bin: allocator.bind_group(
                "gs4d bin",
                &layouts.bin,
                &[
                    frame.clone(),
                    counters.clone(),
                    splats.as_entire_binding(),
                    // Eight steps end in the second buffer.
                    order[1].as_entire_binding(),
                    offsets.as_entire_binding(),
                    pair_tiles[0].as_entire_binding(),
                    pair_splats[0].as_entire_binding(),
                ],
            ),
            ranges: allocator.bind_group(
                "gs4d ranges",
                &layouts.ranges,
                &[frame, counters, pair_tiles[sorted].as_entire_binding(), tile_ranges.as_entire_binding()],
            ),
            pixel: pixel_group(
                allocator,
                &layouts.pixel[self.pixels.index()],
                &self.frame,
                &environment,
                [&opaque, &color_view, &depth_view],
            ),
            blend: allocator.bind_group(
                "gs4d blend",
                &layouts.blend,
                &[&tile_ranges, &pair_splats[sorted], &splats, &self.counters, &order[1], &offsets]
                    .map(wgpu::Buffer::as_entire_binding),
            ),
            instances,
            buffers: PassBuffers {
                tile_ranges,
                pair_splats: pair_splats[sorted].clone(),
                splats,
                order: order[1].clone(),
                offsets,
                depth_keys,
            },
            color,
            color_view,
            depth,
            depth_view,
            opaque,
            pixels: self.pixels,
            environment,
            fast,
        }
    }

    /// Creates the bins of the fast design, with `sizes.entries` entries in all bins together.
    fn make_fast(
        &self,
        renderer: &Renderer,
        allocator: &Allocator<'_>,
        sizes: Sizes,
        instance: wgpu::BindingResource<'_>,
        [splats, tile_ranges, pair_splats]: [&wgpu::Buffer; 3],
    ) -> FastResources {
        // The largest number of bins of a picture of this size.
        let count = u64::from(bin_grid(sizes.picture, SIDES[0]).element_product());
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let counters = count + u64::from(BIN_COUNTERS + sizes.parts);
        let bins = [(); 2].map(|()| allocator.buffer("gs4d bins", 4 * counters, usage));
        let entries_size = 8 * u64::from(sizes.entries.max(1));
        let entries = allocator.buffer("gs4d bin entries", entries_size, BufferUsages::STORAGE);
        let slots = u64::from(sizes.slots);
        let visible = allocator.buffer("gs4d visible", size_of::<VisibleSplat>() as u64 * slots, BufferUsages::STORAGE);
        let splat_colors = allocator.buffer("gs4d splat colors", COLOR_BYTES * slots, BufferUsages::STORAGE);
        let bytes = 2 * bins[0].size() + entries_size + visible.size() + splat_colors.size();
        let layouts = &renderer.layouts;
        let buffers = [visible.clone(), splat_colors.clone()];
        let [splats, entries, visible] = [splats, &entries, &visible].map(wgpu::Buffer::as_entire_binding);
        let splat_colors = splat_colors.as_entire_binding();
        let [even, odd] = bins.each_ref().map(wgpu::Buffer::as_entire_binding);
        let (ranges, pairs) = (tile_ranges.as_entire_binding(), pair_splats.as_entire_binding());
        let both = [[&even, &odd], [&odd, &even]];
        let project_bin = both.map(|[now, _]| {
            let resources = [instance.clone(), splats.clone(), now.clone(), entries.clone(), visible.clone()];
            allocator.bind_group("gs4d project_bin", &layouts.project_bin, &resources)
        });
        let sort_bins = both.map(|[now, next]| {
            let frame = self.frame.as_entire_binding();
            let lists = [entries.clone(), ranges.clone(), pairs.clone()];
            let resources = [frame, now.clone(), next.clone()].into_iter().chain(lists).chain([visible.clone()]);
            allocator.bind_group("gs4d sort_bins", &layouts.sort_bins, &resources.collect::<Vec<_>>())
        });
        let colors = both.map(|[now, _]| {
            let resources = [instance.clone(), now.clone(), visible.clone(), splat_colors.clone()];
            allocator.bind_group("gs4d colors", &layouts.colors, &resources)
        });
        let blend_blocks = [ranges, pairs, splats, splat_colors, visible];
        let blend_blocks = allocator.bind_group("gs4d blend_blocks", &layouts.blend_blocks, &blend_blocks);
        let [visible, splat_colors] = buffers;
        FastResources { bytes, bins, visible, splat_colors, project_bin, sort_bins, colors, blend_blocks }
    }

    /// Writes the uniforms of the steps of both sorts: by all bits of the depth, then by the bits of the tile.
    fn write_steps(&self, queue: &wgpu::Queue, stride: u32) {
        let mut bytes = vec![0; (INSTANCE_STRIDE * 2 * DEPTH_STEPS) as usize];
        for index in 0..2 * DEPTH_STEPS {
            let source = match index {
                0 => layout::SORT_SLOTS,
                1..DEPTH_STEPS => layout::SORT_VISIBLE,
                _ => layout::SORT_PAIRS,
            };
            let step = SortStep { shift: (index % DEPTH_STEPS) * DIGIT_BITS, source, stride, padding: 0 };
            let at = (index * INSTANCE_STRIDE) as usize;
            bytes[at..at + size_of::<SortStep>()].copy_from_slice(bytemuck::bytes_of(&step));
        }
        queue.write_buffer(&self.steps, 0, &bytes);
    }
}
