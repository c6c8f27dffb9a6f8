//! The resources of a view whose sizes depend on the view or the captures, and the bind groups over them.
//!
//! In: sizes, the opaque depth and the environment map. Out: [`Resources`], created again only when the sizes change; for another depth or
//! map only the bind group of the pixels is.

use super::bins::FastResources;
use super::sizes::Sizes;
use super::{Design, ViewRenderer};
use crate::renderer::layout::{
    self, BLOCK, DEPTH_STEPS, DIGIT_BITS, DIGITS, INSTANCE_STRIDE, INSTANCES_AT_ONCE, INSTANCES_BOUND, SortStep,
};
use crate::renderer::memory::Allocator;
use crate::renderer::pipelines::{Layouts, Renderer};
use crate::renderer::shaders::Pixels;
use crate::view::tiles;
use glam::UVec2;
use std::cell::Cell;
use wgpu::{BufferUsages, TextureFormat};

/// Sized resources and the bind groups over them.
#[derive(Debug)]
pub(super) struct Resources {
    pub sizes: Sizes,
    /// Bytes of storage buffers and targets.
    pub bytes: u64,
    pub instances: wgpu::Buffer,
    /// Buffers that later passes, such as `score`, can read.
    pub buffers: PassBuffers,
    pub color: wgpu::Texture,
    pub color_view: wgpu::TextureView,
    pub depth: wgpu::Texture,
    pub depth_view: wgpu::TextureView,
    /// What the bind group of the pixels was created for: opaque depth, environment map. The targets are of these pixels.
    pub opaque: wgpu::TextureView,
    pub environment: wgpu::Buffer,
    pub pixels: Pixels,
    pub project: wgpu::BindGroup,
    /// Bind groups from the projected keys into the first pair of buffers, from there into the second, and back.
    pub sort_depth: [wgpu::BindGroup; 3],
    pub sort_tiles: [wgpu::BindGroup; 2],
    pub arguments: wgpu::BindGroup,
    pub bin: wgpu::BindGroup,
    pub ranges: wgpu::BindGroup,
    pub pixel: wgpu::BindGroup,
    pub blend: wgpu::BindGroup,
    /// Buffers and bind groups of the fast renderer.
    pub fast: Option<FastResources>,
}

/// Storage buffers of a frame that a later pass can read.
#[derive(Debug)]
pub struct PassBuffers {
    /// First and last + 1 pair of each tile, two words each.
    pub tile_ranges: wgpu::Buffer,
    /// Splat of each pair, ordered by tile, then depth.
    pub pair_splats: wgpu::Buffer,
    /// One [`layout::SplatRecord`] for each slot.
    pub splats: wgpu::Buffer,
    /// Slots of the visible splats, by depth.
    pub order: wgpu::Buffer,
    /// First pair of each visible splat, in that order.
    pub offsets: wgpu::Buffer,
    /// Depth key of each slot; [`layout::INVISIBLE`] for one without a splat.
    pub depth_keys: wgpu::Buffer,
}

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
        // What is bound at the last one is as long as at the first.
        let instance_slots = u64::from(parts + INSTANCES_AT_ONCE - 1);
        let instances =
            allocator.buffer("gs4d instances", instance_slots * u64::from(INSTANCE_STRIDE), BufferUsages::UNIFORM);
        let splat_size = if fast { size_of::<layout::SplatShape>() } else { size_of::<layout::SplatRecord>() };
        let splats = storage("gs4d splats", slots, splat_size);
        // What only the reference design uses has no room with the fast one.
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
                // The values of the first step are the indices, so the buffer bound for them is not read.
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

    /// Writes the steps of both sorts: by all bits of the depth, then by the bits of the tile.
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

impl Resources {
    /// Binds an opaque depth and an environment map, unless they are bound. While a window is dragged, the depth is another in each frame.
    pub(super) fn bind_pixel(
        &mut self,
        allocator: Allocator<'_>,
        layouts: &Layouts,
        frame: &wgpu::Buffer,
        opaque: wgpu::TextureView,
        environment: wgpu::Buffer,
    ) {
        if self.opaque == opaque && self.environment == environment {
            return;
        }
        let views = [&opaque, &self.color_view, &self.depth_view];
        self.pixel = pixel_group(allocator, &layouts.pixel[self.pixels.index()], frame, &environment, views);
        (self.opaque, self.environment) = (opaque, environment);
    }
}

/// Creates the bind group of the pixels: opaque depth, color, depth.
pub(super) fn pixel_group(
    allocator: Allocator<'_>,
    layout: &wgpu::BindGroupLayout,
    frame: &wgpu::Buffer,
    environment: &wgpu::Buffer,
    views: [&wgpu::TextureView; 3],
) -> wgpu::BindGroup {
    let [opaque, color, depth] = views.map(wgpu::BindingResource::TextureView);
    let resources = [frame.as_entire_binding(), environment.as_entire_binding(), opaque, color, depth];
    allocator.bind_group("gs4d pixel", layout, &resources)
}

/// Returns the bytes of a texture without mip levels.
pub(super) fn texture_bytes(texture: &wgpu::Texture) -> u64 {
    let texel = texture.format().block_copy_size(None).unwrap_or(0);
    u64::from(texture.width()) * u64::from(texture.height()) * u64::from(texel)
}

/// Returns the number of steps that sort by tile.
pub(super) fn tile_steps(size: UVec2) -> u32 {
    let tiles = tiles(size);
    (u32::BITS - (tiles.x * tiles.y - 1).leading_zeros()).div_ceil(DIGIT_BITS)
}
