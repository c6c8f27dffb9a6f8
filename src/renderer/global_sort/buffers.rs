//! The buffers of global sort, and the bind groups over them.
//!
//! In: the sizes of a view. Out: [`SortBuffers`], for pictures of any size up to [`Sizes::picture`].

use super::finished::PassBuffers;
use crate::renderer::device::memory::Allocator;
use crate::renderer::frame::{Preparation, Sizes};
use crate::renderer::layout::{
    self, BLOCK, Counters, DEPTH_STEPS, DIGIT_BITS, DIGITS, INSTANCE_STRIDE, SortStep, SplatRecord,
};
use crate::view::tiles;
use glam::UVec2;
use std::num::NonZeroU64;
use wgpu::{BindGroup, BindingResource, BufferUsages};

/// The storage buffers that grow with the view. Pairs of them are read and written in turn.
struct Storages {
    splats: wgpu::Buffer,
    depth_keys: wgpu::Buffer,
    keys: [wgpu::Buffer; 2],
    order: [wgpu::Buffer; 2],
    offsets: wgpu::Buffer,
    pair_tiles: [wgpu::Buffer; 2],
    pair_splats: [wgpu::Buffer; 2],
    histogram: wgpu::Buffer,
    tile_ranges: wgpu::Buffer,
    bytes: u64,
}

impl Storages {
    /// Creates the buffers, with histograms of so many blocks.
    fn new(allocator: Allocator<'_>, sizes: Sizes, blocks: u32) -> Self {
        let Sizes { slots, pairs, picture, .. } = sizes;
        let mut bytes = 0;
        let mut storage = |label, count: u32, each: usize| {
            let size = u64::from(count) * each as u64;
            bytes += size;
            allocator.buffer(label, size, BufferUsages::STORAGE)
        };
        Self {
            splats: storage("gs4d splats", slots, size_of::<SplatRecord>()),
            depth_keys: storage("gs4d depth keys", slots, 4),
            keys: [(); 2].map(|()| storage("gs4d sort keys", slots, 4)),
            order: [(); 2].map(|()| storage("gs4d sort values", slots, 4)),
            offsets: storage("gs4d offsets", slots + slots.div_ceil(BLOCK), 4),
            pair_tiles: [(); 2].map(|()| storage("gs4d pair tiles", pairs, 4)),
            pair_splats: [(); 2].map(|()| storage("gs4d pair splats", pairs, 4)),
            histogram: storage("gs4d histogram", DIGITS * (blocks + 1), 4),
            tile_ranges: storage("gs4d tile ranges", tiles(picture).element_product(), 8),
            bytes,
        }
    }

    /// Creates the bind groups of the steps of `sort`, by depth and by tile. `first` are the bindings before those of the keys.
    fn sort_groups(
        &self,
        allocator: Allocator<'_>,
        layout: &wgpu::BindGroupLayout,
        first: &[BindingResource<'_>],
    ) -> ([BindGroup; 3], [BindGroup; 2]) {
        let Self { depth_keys, keys, order, pair_tiles, pair_splats, histogram, .. } = self;
        let sort = |[keys_in, values_in, keys_out, values_out]: [&wgpu::Buffer; 4]| {
            let own = [keys_in, values_in, keys_out, values_out, histogram].map(wgpu::Buffer::as_entire_binding);
            allocator.bind_group("gs4d sort", layout, &[first, &own].concat())
        };
        let by_depth = [
            // The values of the first step are the slots themselves, so the buffer bound for the values is not read.
            sort([depth_keys, &order[1], &keys[0], &order[0]]),
            sort([&keys[0], &order[0], &keys[1], &order[1]]),
            sort([&keys[1], &order[1], &keys[0], &order[0]]),
        ];
        let by_tile = [0, 1].map(|i| sort([&pair_tiles[i], &pair_splats[i], &pair_tiles[1 - i], &pair_splats[1 - i]]));
        (by_depth, by_tile)
    }
}

/// Buffers and bind groups.
#[derive(Debug)]
pub(in crate::renderer) struct SortBuffers {
    /// Size of all storage buffers that grow with the view.
    pub(super) bytes: u64,
    /// One [`Counters`].
    pub counters: wgpu::Buffer,
    /// Buffers that later passes, such as `score`, can read.
    pub buffers: PassBuffers,
    /// Arguments of indirect dispatches.
    pub(super) arguments: wgpu::Buffer,
    pub(super) project: BindGroup,
    /// Bind groups of the steps: from the projected keys into the first pair of buffers, from the first into the second, and back.
    pub(super) sort_depth: [BindGroup; 3],
    pub(super) sort_tiles: [BindGroup; 2],
    pub(super) write_arguments: BindGroup,
    pub(super) bin: BindGroup,
    pub(super) ranges: BindGroup,
    pub(super) blend: BindGroup,
    pub(super) tile_steps: u32,
}

impl SortBuffers {
    /// Creates the buffers. The uniforms are those of the frame and of its instances.
    pub(super) fn new(
        preparation: &Preparation<'_>,
        sizes: Sizes,
        [frame, instance]: [BindingResource<'_>; 2],
    ) -> Self {
        let (allocator, layouts) = (preparation.allocator(), &preparation.renderer.layouts.global_sort);
        let blocks = sizes.slots.max(sizes.pairs).div_ceil(BLOCK);
        let made = Storages::new(allocator, sizes, blocks);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let counters = allocator.buffer("gs4d counters", size_of::<Counters>() as u64, usage);
        let arguments = allocator.buffer("gs4d arguments", 6 * 4, BufferUsages::STORAGE | BufferUsages::INDIRECT);
        let steps = steps(allocator, preparation.queue, blocks);
        let size = NonZeroU64::new(size_of::<SortStep>() as u64);
        let step = BindingResource::Buffer(wgpu::BufferBinding { buffer: &steps, offset: 0, size });
        let first = [step, frame.clone(), counters.as_entire_binding()];
        let (sort_depth, sort_tiles) = made.sort_groups(allocator, &layouts.sort, &first);

        let Storages { splats, depth_keys, offsets, pair_tiles, pair_splats, tile_ranges, bytes, .. } = made;
        // Eight steps end in the second buffer.
        let [_, order] = made.order;
        // After an even number of steps the pairs are in the buffers that `bin` wrote.
        let tile_steps = tile_steps(sizes.picture);
        let [sorted_tiles, sorted] = [&pair_tiles, &pair_splats].map(|buffers| &buffers[tile_steps as usize % 2]);
        let group = |label, layout, first: &[BindingResource<'_>], buffers: &[&wgpu::Buffer]| {
            let others: Vec<_> = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
            allocator.bind_group(label, layout, &[first, &others[..]].concat())
        };
        let binned = [&counters, &splats, &order, &offsets, &pair_tiles[0], &pair_splats[0]];
        let ranged = [&counters, sorted_tiles, &tile_ranges];
        let blended = [&tile_ranges, sorted, &splats, &counters, &order, &offsets];
        let frame = [frame];
        Self {
            bytes,
            project: group("gs4d project", &layouts.project, &[instance], &[&splats, &depth_keys]),
            sort_depth,
            sort_tiles,
            write_arguments: group("gs4d arguments", &layouts.arguments, &[], &[&arguments]),
            bin: group("gs4d bin", &layouts.bin, &frame, &binned),
            ranges: group("gs4d ranges", &layouts.ranges, &frame, &ranged),
            blend: group("gs4d blend", &layouts.blend, &[], &blended),
            tile_steps,
            buffers: PassBuffers { pair_splats: sorted.clone(), tile_ranges, splats, order, offsets, depth_keys },
            counters,
            arguments,
        }
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
