//! One view on the GPU: its working buffers, its targets, and the frame.
//!
//! In: captures with a [`View`](crate::gaussian::View) each, a background, the depth of opaque surfaces. Out: a texture of colour
//! and transmittance and one of expected depth. [`ViewRenderer::prepare`] sizes and fills, [`ViewRenderer::record`] is the frame.

mod record;
mod resources;

use super::capture::{Part, binding_limit};
use super::renderer::Renderer;
use super::{GpuCapture, GpuError, layout};
use crate::frame::Background;
use crate::gaussian::View;
use glam::UVec2;
use layout::{BLOCK, Counters, DEPTH_STEPS};
use resources::{Kept, Resources, Sizes, buffer, texture};
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

/// What a finished frame leaves behind.
#[derive(Debug, Clone, Copy)]
pub(in crate::gpu) struct Finished<'a> {
    pub frame: &'a wgpu::Buffer,
    pub counters: &'a wgpu::Buffer,
    pub kept: &'a Kept,
    pub color: &'a wgpu::TextureView,
    /// Room there is for splats and pairs.
    pub slots: u32,
    pub pairs: u32,
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
    pub(in crate::gpu) fn textures(&self) -> Option<(&wgpu::Texture, &wgpu::Texture)> {
        self.resources.as_ref().map(|made| (&made.color, &made.depth))
    }

    /// What the frame recorded last leaves behind.
    pub(in crate::gpu) fn finished(&self) -> Option<Finished<'_>> {
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
    pub(in crate::gpu) fn counters(&self) -> &wgpu::Buffer {
        &self.counters
    }

    /// Lets the next [`prepare`](Self::prepare) make room for that many pairs and a quarter more, if there is not yet and the
    /// device allows it.
    pub(in crate::gpu) fn make_room(&mut self, pairs: u32) {
        if pairs > self.pair_capacity() {
            self.pairs_wanted = pairs.saturating_add(pairs / 4);
        }
    }

    /// Pairs there is room for.
    pub(in crate::gpu) fn pair_capacity(&self) -> u32 {
        self.resources.as_ref().map_or(0, |made| made.sizes.pairs)
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
pub(in crate::gpu) fn max_pairs(device: &wgpu::Device) -> u32 {
    u32::try_from(binding_limit(&device.limits()) / 4).unwrap_or(u32::MAX)
}

/// Tiles across and down.
fn tiles(size: UVec2) -> UVec2 {
    (size + (layout::TILE_SIZE - 1)) / layout::TILE_SIZE
}
