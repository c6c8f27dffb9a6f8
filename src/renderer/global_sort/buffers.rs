//! The buffers of global sort, and the bind groups over them.
//!
//! In: the sizes of a view. Out: [`SortBuffers`], for pictures of any size up to [`Sizes::picture`].

use super::finished::PassBuffers;
use crate::renderer::layout::{
    self, BLOCK, Counters, DEPTH_STEPS, DIGIT_BITS, DIGITS, INSTANCE_STRIDE, SortStep, SplatRecord,
};
use crate::renderer::layouts::Layouts;
use crate::renderer::memory::Allocator;
use crate::renderer::view::Sizes;
use crate::view::tiles;
use glam::UVec2;
use std::cell::Cell;
use std::num::NonZeroU64;
use wgpu::{BindingResource, BufferUsages};

/// Buffers and bind groups.
#[derive(Debug)]
pub(in crate::renderer) struct SortBuffers {
    /// Size of all storage buffers that grow with the view.
    pub bytes: u64,
    /// One [`Counters`].
    pub counters: wgpu::Buffer,
    /// Buffers that later passes, such as `score`, can read.
    pub buffers: PassBuffers,
    pub blend: wgpu::BindGroup,
    /// Arguments of indirect dispatches.
    pub(super) arguments: wgpu::Buffer,
    pub(super) project: wgpu::BindGroup,
    /// Bind groups of the steps: from the projected keys into the first pair of buffers, from the first into the second, and back.
    pub(super) sort_depth: [wgpu::BindGroup; 3],
    pub(super) sort_tiles: [wgpu::BindGroup; 2],
    pub(super) write_arguments: wgpu::BindGroup,
    pub(super) bin: wgpu::BindGroup,
    pub(super) ranges: wgpu::BindGroup,
    pub(super) tile_steps: u32,
}

impl SortBuffers {
    /// Creates the buffers. `frame` and `instance` are the uniforms of the frame and of its instances.
    pub(in crate::renderer) fn new(
        allocator: Allocator<'_>,
        queue: &wgpu::Queue,
        layouts: &Layouts,
        sizes: Sizes,
        frame: &wgpu::Buffer,
        instance: BindingResource<'_>,
    ) -> Self {
        let Sizes { slots, pairs, picture, .. } = sizes;
        let layouts = &layouts.global_sort;
        let bytes = Cell::new(0);
        let storage = |label, count: u32, each: usize| {
            let size = u64::from(count) * each as u64;
            bytes.set(bytes.get() + size);
            allocator.buffer(label, size, BufferUsages::STORAGE)
        };
        let slot_blocks = slots.div_ceil(BLOCK);
        let stride = slot_blocks.max(pairs.div_ceil(BLOCK));
        let tiles = tiles(picture);
        let splats = storage("gs4d splats", slots, size_of::<SplatRecord>());
        let depth_keys = storage("gs4d depth keys", slots, 4);
        let keys = [(); 2].map(|()| storage("gs4d sort keys", slots, 4));
        let order = [(); 2].map(|()| storage("gs4d sort values", slots, 4));
        let offsets = storage("gs4d offsets", slots + slot_blocks, 4);
        let pair_tiles = [(); 2].map(|()| storage("gs4d pair tiles", pairs, 4));
        let pair_splats = [(); 2].map(|()| storage("gs4d pair splats", pairs, 4));
        let histogram = storage("gs4d histogram", DIGITS * (stride + 1), 4);
        let tile_ranges = storage("gs4d tile ranges", tiles.x * tiles.y, 8);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let counters = allocator.buffer("gs4d counters", size_of::<Counters>() as u64, usage);
        let arguments = allocator.buffer("gs4d arguments", 6 * 4, BufferUsages::STORAGE | BufferUsages::INDIRECT);
        let steps = steps(allocator, queue, stride);

        let uniform = frame.as_entire_binding();
        let counted = counters.as_entire_binding();
        let step = BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &steps,
            offset: 0,
            size: NonZeroU64::new(size_of::<SortStep>() as u64),
        });
        let sort = |buffers: [&wgpu::Buffer; 4]| {
            let [keys_in, values_in, keys_out, values_out] = buffers.map(wgpu::Buffer::as_entire_binding);
            let histogram = histogram.as_entire_binding();
            let resources =
                [step.clone(), uniform.clone(), counted.clone(), keys_in, values_in, keys_out, values_out, histogram];
            allocator.bind_group("gs4d sort", &layouts.sort, &resources)
        };
        // After an even number of steps the pairs are in the buffers that `bin` wrote.
        let tile_steps = tile_steps(picture);
        let sorted = tile_steps as usize % 2;
        let group = |label, layout, buffers: &[&wgpu::Buffer]| {
            let resources: Vec<_> = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
            allocator.bind_group(label, layout, &resources)
        };
        let projected = [instance, splats.as_entire_binding(), depth_keys.as_entire_binding()];
        let project = allocator.bind_group("gs4d project", &layouts.project, &projected);
        let sort_depth = [
            // The values of the first step are the slots themselves, so the buffer bound for the values is not read.
            sort([&depth_keys, &order[1], &keys[0], &order[0]]),
            sort([&keys[0], &order[0], &keys[1], &order[1]]),
            sort([&keys[1], &order[1], &keys[0], &order[0]]),
        ];
        let sort_tiles =
            [0, 1].map(|i| sort([&pair_tiles[i], &pair_splats[i], &pair_tiles[1 - i], &pair_splats[1 - i]]));
        // Eight steps end in the second buffer.
        let [_, order] = order;
        let binned = [frame, &counters, &splats, &order, &offsets, &pair_tiles[0], &pair_splats[0]];
        let bin = group("gs4d bin", &layouts.bin, &binned);
        let ranges = group("gs4d ranges", &layouts.ranges, &[frame, &counters, &pair_tiles[sorted], &tile_ranges]);
        let pair_splats = pair_splats[sorted].clone();
        let blended = [&tile_ranges, &pair_splats, &splats, &counters, &order, &offsets];
        Self {
            bytes: bytes.get(),
            blend: group("gs4d blend", &layouts.blend, &blended),
            write_arguments: group("gs4d arguments", &layouts.arguments, &[&arguments]),
            project,
            sort_depth,
            sort_tiles,
            bin,
            ranges,
            tile_steps,
            counters,
            arguments,
            buffers: PassBuffers { tile_ranges, pair_splats, splats, order, offsets, depth_keys },
        }
    }

    /// Creates the bind group of `motion`, given its `uniforms`.
    pub(in crate::renderer) fn motion(
        &self,
        allocator: Allocator<'_>,
        layouts: &Layouts,
        uniforms: &[BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let own = [&self.buffers.depth_keys, &self.buffers.splats].map(wgpu::Buffer::as_entire_binding);
        allocator.bind_group("gs4d motion", &layouts.global_sort.motion, &[uniforms, &own].concat())
    }
}

/// Creates the uniforms of the steps of both sorts: by all bits of the depth, then by the bits of the tile.
fn steps(allocator: Allocator<'_>, queue: &wgpu::Queue, stride: u32) -> wgpu::Buffer {
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
    let steps = allocator.buffer("gs4d steps", bytes.len() as u64, BufferUsages::UNIFORM);
    queue.write_buffer(&steps, 0, &bytes);
    steps
}

/// Returns the number of steps of the sort by tile.
fn tile_steps(size: UVec2) -> u32 {
    let tiles = tiles(size);
    (u32::BITS - (tiles.x * tiles.y - 1).leading_zeros()).div_ceil(DIGIT_BITS)
}
