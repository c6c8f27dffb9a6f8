//! One view on the GPU: its working buffers, its targets, and the frame.
//!
//! In: captures with a [`View`](crate::gaussian::View) each, a background, the depth of opaque surfaces. Out: a texture of colour
//! and transmittance and one of expected depth. [`ViewRenderer::prepare`] sizes and fills, [`ViewRenderer::record`] is the frame.

use super::capture::{Part, binding_limit};
use super::renderer::{Renderer, bind_group};
use super::timing::PassTimer;
use super::{GpuCapture, GpuError, layout};
use crate::frame::Background;
use crate::gaussian::View;
use glam::UVec2;
use layout::{BLOCK, Counters, DEPTH_STEPS, DIGIT_BITS, DIGITS, SortStep};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use wgpu::{BufferUsages, TextureFormat};

/// A capture in a view. The view includes the transform of the capture and the capture's own time.
#[derive(Debug, Clone, Copy)]
pub struct Instance<'a> {
    /// The capture.
    pub capture: &'a GpuCapture,
    /// Where it is seen from, and when.
    pub view: View,
    /// Whether its temporal filter is used, if it has one.
    pub filtered: bool,
}

impl Instance<'_> {
    fn segment(&self) -> Option<u32> {
        if self.filtered { self.capture.segment(self.view.time) } else { None }
    }
}

/// The depth of opaque surfaces that cut the splats, pixel by pixel.
#[derive(Debug, Clone, Copy)]
pub struct OpaqueDepth<'a> {
    /// A `Depth32Float` texture, reverse-z with an infinite far plane.
    pub texture: &'a wgpu::TextureView,
    /// Corner of the view in it, pixels.
    pub origin: UVec2,
    /// Near plane: `z = near / depth`.
    pub near: f32,
}

/// Working buffers, uniforms and targets of one view.
#[derive(Debug)]
pub struct ViewRenderer {
    /// Alignment of dynamic uniform offsets.
    alignment: u32,
    /// Slots of the frame prepared last.
    slots: u32,
    /// Pairs that an earlier frame wanted room for.
    pairs_wanted: u32,
    frame: wgpu::Buffer,
    steps: wgpu::Buffer,
    counters: wgpu::Buffer,
    arguments: wgpu::Buffer,
    no_depth: wgpu::TextureView,
    no_environment: wgpu::Buffer,
    readback: CounterReadback,
    /// What each part of the frame prepared last wants to be active; nothing without a filter.
    wanted: Vec<Option<Active>>,
    /// What the lists of active Gaussians hold.
    activated: Vec<Option<Active>>,
    /// Everything whose size depends on the view or the captures.
    resources: Option<Resources>,
}

/// What a list of active Gaussians was made for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Active {
    capture: u64,
    part: usize,
    segment: u32,
    first_slot: u32,
}

/// Sized resources and the bind groups over them.
#[derive(Debug)]
struct Resources {
    sizes: Sizes,
    instances: wgpu::Buffer,
    /// What `score` reads beside the frame.
    kept: Kept,
    color: wgpu::Texture,
    color_view: wgpu::TextureView,
    depth: wgpu::Texture,
    depth_view: wgpu::TextureView,
    /// What the bind groups were made for, apart from sizes.
    opaque: wgpu::TextureView,
    environment: wgpu::Buffer,
    /// Dispatches of `project` over the active, by part.
    project_arguments: wgpu::Buffer,
    project_arguments_group: wgpu::BindGroup,
    activate: wgpu::BindGroup,
    project: wgpu::BindGroup,
    /// From the projected keys into the first pair of buffers, from there into the second, and back.
    sort_depth: [wgpu::BindGroup; 3],
    sort_tiles: [wgpu::BindGroup; 2],
    arguments: wgpu::BindGroup,
    bin: wgpu::BindGroup,
    ranges: wgpu::BindGroup,
    blend: wgpu::BindGroup,
}

/// Buffers of a frame that a later pass can read.
#[derive(Debug)]
pub(super) struct Kept {
    pub tile_ranges: wgpu::Buffer,
    /// Ordered by tile, then depth.
    pub pair_splats: wgpu::Buffer,
    pub splats: wgpu::Buffer,
    /// Visible splats by depth.
    pub order: wgpu::Buffer,
    pub offsets: wgpu::Buffer,
    pub depth_keys: wgpu::Buffer,
}

/// What a finished frame leaves behind.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finished<'a> {
    pub frame: &'a wgpu::Buffer,
    pub counters: &'a wgpu::Buffer,
    pub kept: &'a Kept,
    pub color: &'a wgpu::TextureView,
    /// Room there is for splats and pairs.
    pub slots: u32,
    pub pairs: u32,
}

/// What [`Resources`] have room for.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Sizes {
    slots: u32,
    pairs: u32,
    /// Instance uniforms.
    parts: u32,
    /// Of the picture, pixels.
    picture: UVec2,
}

/// The counters of an earlier frame, on their way to the host without anybody waiting.
#[derive(Debug)]
struct CounterReadback {
    buffer: wgpu::Buffer,
    state: ReadbackState,
}

#[derive(Debug)]
enum ReadbackState {
    /// Free to be copied into.
    Idle,
    /// A recorded frame copies into it.
    Recorded,
    /// Being mapped; the flag tells when.
    Mapping(Arc<AtomicBool>),
}

impl ViewRenderer {
    /// A view without size; [`prepare`](Self::prepare) gives it one.
    pub fn new(device: &wgpu::Device) -> Self {
        let alignment = device.limits().min_uniform_buffer_offset_alignment.max(size_of::<layout::Instance>() as u32);
        let alignment = alignment.next_power_of_two();
        let counters = size_of::<Counters>() as u64;
        let depth = texture(device, "gs4d no depth", UVec2::ONE, TextureFormat::Depth32Float);
        Self {
            alignment,
            slots: 0,
            pairs_wanted: 0,
            frame: buffer(device, "gs4d frame", size_of::<layout::Frame>() as u64, BufferUsages::UNIFORM),
            steps: buffer(device, "gs4d steps", u64::from(alignment * 2 * DEPTH_STEPS), BufferUsages::UNIFORM),
            counters: buffer(device, "gs4d counters", counters, BufferUsages::STORAGE | BufferUsages::COPY_SRC),
            arguments: buffer(device, "gs4d arguments", 6 * 4, BufferUsages::STORAGE | BufferUsages::INDIRECT),
            no_depth: depth.create_view(&wgpu::TextureViewDescriptor::default()),
            no_environment: buffer(device, "gs4d no environment", 16, BufferUsages::STORAGE),
            readback: CounterReadback {
                buffer: buffer(device, "gs4d counter readback", counters, BufferUsages::MAP_READ),
                state: ReadbackState::Idle,
            },
            wanted: Vec::new(),
            activated: Vec::new(),
            resources: None,
        }
    }

    /// Sizes buffers for what is to be drawn, growing them also by what earlier frames counted, and writes the uniforms. Call it
    /// before the queue is submitted. In the steady state it creates nothing.
    ///
    /// All instances must have views of the same size. Behind an environment map nothing shows where `opaque` is given.
    ///
    /// # Errors
    /// When the picture or a buffer would be larger than the device allows.
    pub fn prepare(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        instances: &[Instance<'_>],
        background: Background,
        opaque: Option<OpaqueDepth<'_>>,
    ) -> Result<(), GpuError> {
        if let Some(counters) = self.readback.poll() {
            self.make_room(counters.pairs_wanted);
        }
        let made = self.resources.as_ref().map(|resources| resources.sizes).unwrap_or_default();
        let picture = instances.first().map_or(made.picture.max(UVec2::ONE), |instance| instance.view.size);
        let limits = device.limits();
        if picture.min_element() == 0 || picture.max_element() > limits.max_texture_dimension_2d {
            return Err(GpuError::Size { width: picture.x, height: picture.y, limit: limits.max_texture_dimension_2d });
        }
        let slots: usize = instances.iter().map(|instance| instance.capture.len()).sum();
        let parts: usize = instances.iter().map(|instance| instance.capture.parts.len()).sum();
        let limit = binding_limit(&limits);
        // The largest buffer per slot holds splats.
        let needed = (slots as u64).next_multiple_of(u64::from(BLOCK)) * size_of::<layout::Splat>() as u64;
        if needed > limit {
            return Err(GpuError::TooLarge { what: "the splats", needed, limit });
        }
        let slots = slots as u32;
        // Two pairs for each Gaussian are a first guess; counters correct it.
        let pairs = self.pairs_wanted.max(slots.saturating_mul(2)).max(1 << 16).min(max_pairs(device));
        let sizes = Sizes {
            slots: made.slots.max(slots.next_multiple_of(BLOCK)).max(BLOCK),
            pairs: made.pairs.max(pairs),
            parts: made.parts.max(parts as u32).max(1),
            picture,
        };
        let environment = instances.iter().find_map(|i| Some((i, i.capture.environment.as_ref()?)));
        let opaque_view = opaque.map_or(&self.no_depth, |depth| depth.texture).clone();
        let environment_buffer = environment.map_or(&self.no_environment, |(_, map)| &map.buffer).clone();
        let stale = self.resources.as_ref().is_none_or(|made| {
            made.sizes != sizes || made.opaque != opaque_view || made.environment != environment_buffer
        });
        if stale {
            self.resources = Some(self.make(device, queue, renderer, sizes, opaque_view, environment_buffer));
            self.activated.clear();
        }
        self.slots = slots;
        self.want_active(instances);
        self.write_uniforms(queue, instances, background, opaque.as_ref(), environment.map(|(i, m)| (i.view, m.size)));
        Ok(())
    }

    /// Records the frame: one compute pass, in the order of the table in [`crate::gpu`].
    pub fn record(&mut self, renderer: &Renderer, encoder: &mut wgpu::CommandEncoder, instances: &[Instance<'_>]) {
        self.record_timed(renderer, encoder, instances, None);
    }

    /// Colour `C` (premultiplied, in the blend space) and transmittance: `Rgba32Float`. Before the first
    /// [`prepare`](Self::prepare) there is none.
    pub fn color(&self) -> Option<&wgpu::TextureView> {
        self.resources.as_ref().map(|made| &made.color_view)
    }

    /// Expected depth, not divided by `1 − T`: `R32Float`, camera units.
    pub fn depth(&self) -> Option<&wgpu::TextureView> {
        self.resources.as_ref().map(|made| &made.depth_view)
    }

    /// The textures behind [`color`](Self::color) and [`depth`](Self::depth).
    pub(super) fn textures(&self) -> Option<(&wgpu::Texture, &wgpu::Texture)> {
        self.resources.as_ref().map(|made| (&made.color, &made.depth))
    }

    /// What the frame recorded last leaves behind.
    pub(super) fn finished(&self) -> Option<Finished<'_>> {
        self.resources.as_ref().map(|made| Finished {
            frame: &self.frame,
            counters: &self.counters,
            kept: &made.kept,
            color: &made.color_view,
            slots: made.sizes.slots,
            pairs: made.sizes.pairs,
        })
    }

    /// The counters of the frame recorded last, on the GPU.
    pub(super) fn counters(&self) -> &wgpu::Buffer {
        &self.counters
    }

    /// Lets the next [`prepare`](Self::prepare) make room for that many pairs and a quarter more, if there is not yet and the
    /// device allows it.
    pub(super) fn make_room(&mut self, pairs: u32) {
        if pairs > self.pair_capacity() {
            self.pairs_wanted = pairs.saturating_add(pairs / 4);
        }
    }

    /// Pairs there is room for.
    pub(super) fn pair_capacity(&self) -> u32 {
        self.resources.as_ref().map_or(0, |made| made.sizes.pairs)
    }

    pub(super) fn record_timed(
        &mut self,
        renderer: &Renderer,
        encoder: &mut wgpu::CommandEncoder,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        let Some(made) = &self.resources else { return };
        self.activated.resize(self.wanted.len(), None);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("gs4d"),
                timestamp_writes: timer.and_then(PassTimer::frame_writes),
            });
            let mark = |pass: &mut wgpu::ComputePass<'_>| {
                if let Some(timer) = timer {
                    timer.mark(pass);
                }
            };

            // activate, where the segment is another than before
            let parts = || instances.iter().flat_map(|instance| &instance.capture.parts).enumerate();
            for (index, part) in parts() {
                if self.wanted[index] == self.activated[index] {
                    continue;
                }
                self.activated[index] = self.wanted[index];
                let (Some(_), Some(filter)) = (self.wanted[index], &part.filter) else { continue };
                let blocks = part.count.div_ceil(BLOCK);
                pass.set_bind_group(0, &made.activate, &[index as u32 * self.alignment]);
                pass.set_bind_group(1, filter, &[]);
                pass.set_pipeline(&renderer.activate_count);
                pass.dispatch_workgroups(blocks, 1, 1);
                pass.set_pipeline(&renderer.activate_scan);
                pass.set_bind_group(2, &made.project_arguments_group, &[]);
                pass.dispatch_workgroups(1, 1, 1);
                pass.set_pipeline(&renderer.activate_write);
                pass.dispatch_workgroups(blocks, 1, 1);
            }
            mark(&mut pass);

            // project
            let stored = instances.iter().flat_map(|i| i.capture.parts.iter().map(|_| i.capture.storage));
            for ((index, part), storage) in parts().zip(stored) {
                pass.set_pipeline(renderer.project(storage));
                pass.set_bind_group(0, &made.project, &[index as u32 * self.alignment]);
                pass.set_bind_group(1, &part.bind_group, &[]);
                match self.wanted[index] {
                    Some(_) => pass.dispatch_workgroups_indirect(&made.project_arguments, index as u64 * 12),
                    None => pass.dispatch_workgroups(part.count.div_ceil(256), 1, 1),
                }
            }
            mark(&mut pass);

            // sort by depth: the first step drops the invisible and counts the rest, the others are sized by that count.
            for step in 0..DEPTH_STEPS {
                let group = &made.sort_depth[if step == 0 { 0 } else { 2 - (step as usize % 2) }];
                let blocks = (step == 0).then(|| self.slots.div_ceil(BLOCK));
                self.sort_step(renderer, &mut pass, group, step, blocks, 0, Some(&made.arguments));
            }
            mark(&mut pass);

            // bin
            pass.set_bind_group(0, &made.bin, &[]);
            pass.set_pipeline(&renderer.bin_count);
            pass.dispatch_workgroups_indirect(&self.arguments, 0);
            pass.set_pipeline(&renderer.bin_scan);
            pass.set_bind_group(1, &made.arguments, &[]);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_pipeline(&renderer.bin_offset);
            pass.dispatch_workgroups_indirect(&self.arguments, 0);
            pass.set_pipeline(&renderer.bin_emit);
            pass.dispatch_workgroups_indirect(&self.arguments, 12);
            mark(&mut pass);

            // sort by tile
            for step in 0..tile_steps(made.sizes.picture) {
                let group = &made.sort_tiles[step as usize % 2];
                self.sort_step(renderer, &mut pass, group, DEPTH_STEPS + step, None, 12, None);
            }
            mark(&mut pass);

            // ranges
            let tiles = tiles(made.sizes.picture);
            pass.set_pipeline(&renderer.ranges);
            pass.set_bind_group(0, &made.ranges, &[]);
            pass.dispatch_workgroups((tiles.x * tiles.y).div_ceil(256), 1, 1);
            mark(&mut pass);

            // blend
            pass.set_pipeline(&renderer.blend);
            pass.set_bind_group(0, &made.blend, &[]);
            pass.dispatch_workgroups(tiles.x, tiles.y, 1);
            mark(&mut pass);
        }
        if matches!(self.readback.state, ReadbackState::Idle) {
            encoder.copy_buffer_to_buffer(&self.counters, 0, &self.readback.buffer, 0, size_of::<Counters>() as u64);
            self.readback.state = ReadbackState::Recorded;
        }
    }

    /// One step of `sort`. `blocks` where the host knows them; otherwise the GPU does, at `offset` of the arguments.
    fn sort_step(
        &self,
        renderer: &Renderer,
        pass: &mut wgpu::ComputePass<'_>,
        group: &wgpu::BindGroup,
        step: u32,
        blocks: Option<u32>,
        offset: u64,
        arguments: Option<&wgpu::BindGroup>,
    ) {
        let dispatch = |pass: &mut wgpu::ComputePass<'_>| match blocks {
            Some(blocks) => pass.dispatch_workgroups(blocks, 1, 1),
            None => pass.dispatch_workgroups_indirect(&self.arguments, offset),
        };
        pass.set_bind_group(0, group, &[step * self.alignment]);
        pass.set_pipeline(&renderer.sort_count);
        dispatch(pass);
        pass.set_pipeline(&renderer.sort_scan);
        pass.dispatch_workgroups(DIGITS, 1, 1);
        if let (0, Some(arguments)) = (step, arguments) {
            pass.set_pipeline(&renderer.sort_visible);
            pass.set_bind_group(1, arguments, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        pass.set_pipeline(&renderer.sort_scatter);
        dispatch(pass);
    }

    /// Notes what each part of the frame wants to be active.
    fn want_active(&mut self, instances: &[Instance<'_>]) {
        self.wanted.clear();
        let mut first_slot = 0;
        for instance in instances {
            let segment = instance.segment();
            for (part, Part { count, .. }) in instance.capture.parts.iter().enumerate() {
                let capture = instance.capture.id;
                self.wanted.push(segment.map(|segment| Active { capture, part, segment, first_slot }));
                first_slot += count;
            }
        }
    }

    fn make(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        sizes: Sizes,
        opaque: wgpu::TextureView,
        environment: wgpu::Buffer,
    ) -> Resources {
        let Sizes { slots, pairs, parts, picture: size } = sizes;
        let storage = |label, count: u32, each: usize| {
            buffer(device, label, u64::from(count) * each as u64, BufferUsages::STORAGE)
        };
        let slot_blocks = slots.div_ceil(BLOCK);
        let stride = slot_blocks.max(pairs.div_ceil(BLOCK));
        let tiles = tiles(size);
        let instances =
            buffer(device, "gs4d instances", u64::from(parts) * u64::from(self.alignment), BufferUsages::UNIFORM);
        let active_list = storage("gs4d active list", slots, 4);
        let active_counts = storage("gs4d active counts", parts, 4);
        let active_blocks = storage("gs4d active blocks", slot_blocks, 4);
        let project_arguments = buffer(
            device,
            "gs4d project arguments",
            u64::from(parts) * 12,
            BufferUsages::STORAGE | BufferUsages::INDIRECT,
        );
        let splats = storage("gs4d splats", slots, size_of::<layout::Splat>());
        let depth_keys = storage("gs4d depth keys", slots, 4);
        let keys = [(); 2].map(|()| storage("gs4d sort keys", slots, 4));
        let order = [(); 2].map(|()| storage("gs4d sort values", slots, 4));
        let offsets = storage("gs4d offsets", slots + slot_blocks, 4);
        let pair_tiles = [(); 2].map(|()| storage("gs4d pair tiles", pairs, 4));
        let pair_splats = [(); 2].map(|()| storage("gs4d pair splats", pairs, 4));
        let histogram = storage("gs4d histogram", DIGITS * (stride + 1), 4);
        let tile_ranges = storage("gs4d tile ranges", tiles.x * tiles.y, 8);
        let color = texture(device, "gs4d color", size, TextureFormat::Rgba32Float);
        let depth = texture(device, "gs4d depth", size, TextureFormat::R32Float);
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
                bind_group(device, "gs4d sort", &layouts.sort, &resources)
            };
        let instance = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &instances,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<layout::Instance>() as u64),
        });
        // After an even number of steps the pairs are back where they were made.
        let sorted = tile_steps(size) as usize % 2;
        Resources {
            sizes,
            project_arguments_group: bind_group(
                device,
                "gs4d project arguments",
                &layouts.arguments,
                &[project_arguments.as_entire_binding()],
            ),
            project_arguments,
            activate: bind_group(
                device,
                "gs4d activate",
                &layouts.activate,
                &[
                    instance.clone(),
                    active_list.as_entire_binding(),
                    active_counts.as_entire_binding(),
                    active_blocks.as_entire_binding(),
                    depth_keys.as_entire_binding(),
                ],
            ),
            project: bind_group(
                device,
                "gs4d project",
                &layouts.project,
                &[
                    instance,
                    splats.as_entire_binding(),
                    depth_keys.as_entire_binding(),
                    active_list.as_entire_binding(),
                    active_counts.as_entire_binding(),
                ],
            ),
            sort_depth: [
                // The values of the first step are the indices: what is bound for them is not read.
                sort(&depth_keys, &order[1], &keys[0], &order[0]),
                sort(&keys[0], &order[0], &keys[1], &order[1]),
                sort(&keys[1], &order[1], &keys[0], &order[0]),
            ],
            sort_tiles: [0, 1].map(|i| sort(&pair_tiles[i], &pair_splats[i], &pair_tiles[1 - i], &pair_splats[1 - i])),
            arguments: bind_group(device, "gs4d arguments", &layouts.arguments, &[self.arguments.as_entire_binding()]),
            bin: bind_group(
                device,
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
            ranges: bind_group(
                device,
                "gs4d ranges",
                &layouts.ranges,
                &[frame.clone(), counters, pair_tiles[sorted].as_entire_binding(), tile_ranges.as_entire_binding()],
            ),
            blend: bind_group(
                device,
                "gs4d blend",
                &layouts.blend,
                &[
                    frame,
                    tile_ranges.as_entire_binding(),
                    pair_splats[sorted].as_entire_binding(),
                    splats.as_entire_binding(),
                    environment.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&opaque),
                    wgpu::BindingResource::TextureView(&color_view),
                    wgpu::BindingResource::TextureView(&depth_view),
                ],
            ),
            instances,
            kept: Kept {
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
            environment,
        }
    }

    /// The steps of both sorts: by all bits of the depth, then by the bits of the tile.
    fn write_steps(&self, queue: &wgpu::Queue, stride: u32) {
        let mut bytes = vec![0; (self.alignment * 2 * DEPTH_STEPS) as usize];
        for index in 0..2 * DEPTH_STEPS {
            let source = match index {
                0 => layout::SORT_SLOTS,
                1..DEPTH_STEPS => layout::SORT_VISIBLE,
                _ => layout::SORT_PAIRS,
            };
            let step = SortStep { shift: (index % DEPTH_STEPS) * DIGIT_BITS, source, stride, padding: 0 };
            let at = (index * self.alignment) as usize;
            bytes[at..at + size_of::<SortStep>()].copy_from_slice(bytemuck::bytes_of(&step));
        }
        queue.write_buffer(&self.steps, 0, &bytes);
    }

    fn write_uniforms(
        &self,
        queue: &wgpu::Queue,
        instances: &[Instance<'_>],
        background: Background,
        opaque: Option<&OpaqueDepth<'_>>,
        environment: Option<(View, [u32; 2])>,
    ) {
        let Some(made) = &self.resources else { return };
        let mut slot = 0;
        let mut index = 0;
        for instance in instances {
            let view = layout::Instance::of_view(&instance.view);
            for (part_index, part) in instance.capture.parts.iter().enumerate() {
                let segment = instance.segment();
                let uniform =
                    layout::Instance { part: index, ..instance.capture.instance(part_index, slot, segment, &view) };
                let at = u64::from(index * self.alignment);
                queue.write_buffer(&made.instances, at, bytemuck::bytes_of(&uniform));
                slot += part.count;
                index += 1;
            }
        }
        let (mode, color) = match (background, environment) {
            (Background::Color(color), _) => (layout::BACKGROUND_COLOR, color),
            (Background::Environment, Some(_)) => (layout::BACKGROUND_ENVIRONMENT, [0.0; 3]),
            _ => (layout::BACKGROUND_NONE, [0.0; 3]),
        };
        let (view, environment_size) = environment.unwrap_or_else(|| {
            let view = View::new(made.sizes.picture, 0.0, glam::Mat4::IDENTITY, glam::Vec4::ONE, glam::Vec2::ONE);
            (instances.first().map_or(view, |instance| instance.view), [0; 2])
        });
        let to_world = view.world_to_camera.inverse();
        let column = |axis: usize| to_world.col(axis).truncate().extend(view.camera_position[axis]).to_array();
        let frame = layout::Frame {
            size: made.sizes.picture.to_array(),
            tiles: tiles(made.sizes.picture).to_array(),
            slots: self.slots,
            pair_capacity: made.sizes.pairs,
            background_mode: mode,
            opaque_near: opaque.map_or(0.0, |depth| depth.near),
            // With opaque depth there is a compositor: it must not see anything behind the map.
            background: [color[0], color[1], color[2], if opaque.is_some() { 0.0 } else { 1.0 }],
            projection: view.projection.to_array(),
            world_x: column(0),
            world_y: column(1),
            world_z: column(2),
            environment_size,
            opaque_origin: opaque.map_or([0; 2], |depth| depth.origin.to_array()),
        };
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
    }
}

impl CounterReadback {
    /// Moves on by one state; the counters when they have arrived.
    fn poll(&mut self) -> Option<Counters> {
        match &self.state {
            ReadbackState::Idle => None,
            ReadbackState::Recorded => {
                let ready = Arc::new(AtomicBool::new(false));
                let flag = ready.clone();
                self.buffer
                    .slice(..)
                    .map_async(wgpu::MapMode::Read, move |result| flag.store(result.is_ok(), Ordering::Release));
                self.state = ReadbackState::Mapping(ready);
                None
            }
            ReadbackState::Mapping(ready) if ready.load(Ordering::Acquire) => {
                let counters = bytemuck::pod_read_unaligned(&self.buffer.slice(..).get_mapped_range());
                self.buffer.unmap();
                self.state = ReadbackState::Idle;
                Some(counters)
            }
            ReadbackState::Mapping(_) => None,
        }
    }
}

/// Pairs that fit one binding.
pub(super) fn max_pairs(device: &wgpu::Device) -> u32 {
    u32::try_from(binding_limit(&device.limits()) / 4).unwrap_or(u32::MAX)
}

/// Tiles across and down.
fn tiles(size: UVec2) -> UVec2 {
    (size + (layout::TILE_SIZE - 1)) / layout::TILE_SIZE
}

/// Steps that order by tile.
fn tile_steps(size: UVec2) -> u32 {
    let tiles = tiles(size);
    (u32::BITS - (tiles.x * tiles.y - 1).leading_zeros()).div_ceil(DIGIT_BITS)
}

fn buffer(device: &wgpu::Device, label: &str, size: u64, usage: BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: usage | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn texture(device: &wgpu::Device, label: &str, size: UVec2, format: TextureFormat) -> wgpu::Texture {
    let usage = if format == TextureFormat::Depth32Float {
        wgpu::TextureUsages::TEXTURE_BINDING
    } else {
        wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC
    };
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}
