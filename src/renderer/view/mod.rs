//! One view on the GPU: its working buffers, its targets, and the frame.
//!
//! In: captures with a [`View`](crate::view::View) each, a background, the depth of opaque surfaces. Out: a texture of
//! color and transmittance and one of expected and median depth. [`ViewRenderer::prepare`] sizes and fills the buffers,
//! [`ViewRenderer::record`] records the frame.

mod bins;
mod design;
mod fast;
mod motion;
mod parameters;
mod readback;
mod record;
mod resources;
mod sizes;

use super::active::{drawn_count, most_drawn};
use super::memory::binding_limit;
use super::pipelines::Renderer;
use super::shaders::{FastVariant, Lists, Pixels};
use super::timing::{PassTime, PassTimer};
use super::{GpuError, ViewStatistics, layout};
use crate::view::{Appearance, Background, View, tiles};
use bins::BinRoom;
pub use design::Design;
use glam::UVec2;
use layout::{BLOCK, Counters, DEPTH_STEPS, INSTANCE_STRIDE};
use motion::MotionResources;
pub use parameters::{Instance, OpaqueDepth, ViewParameters};
use readback::Readback;
pub use resources::PassBuffers;
use resources::Resources;
use sizes::{Sizes, grown};
use wgpu::{BufferUsages, TextureFormat};

/// Working buffers, uniforms and targets of one view.
#[derive(Debug)]
pub struct ViewRenderer {
    /// Number of slots of the frame prepared last, the size of its picture, and the tiles along each side of its bins.
    slots: u32,
    picture: UVec2,
    bin_side: u32,
    /// Never [`Design::Auto`].
    design: Design,
    /// Whether the counters of odd frames are used, and whether the frame prepared last has been recorded.
    odd: bool,
    /// Number of frames that have been recorded.
    frames: u32,
    recorded: bool,
    /// The kind of its pixels, and how the fast design draws it, in the frame prepared last.
    pixels: Pixels,
    variant: FastVariant,
    /// Number of splats of the fullest bin of an earlier frame.
    fullest_bin: u32,
    /// Number of bins that the frame recorded last has cleared for the next.
    cleared_bins: u32,
    has_depths: bool,
    /// Number of pairs for which an earlier frame wanted room, and whether that is more than the device has.
    pairs_wanted: u32,
    short_of_room: bool,
    /// The room that the bins of the fast design should have.
    bin_room: BinRoom,
    /// Number of successive frames for which the buffers have been far too large.
    oversized_frames: u32,
    /// Bytes of the instance uniforms of a frame, kept for their memory.
    instance_uniforms: Vec<u8>,
    frame: wgpu::Buffer,
    steps: wgpu::Buffer,
    counters: wgpu::Buffer,
    arguments: wgpu::Buffer,
    no_depth: wgpu::TextureView,
    no_environment: wgpu::Buffer,
    readback: Readback,
    statistics: ViewStatistics,
    /// Timestamps, if they are measured and the device has them.
    timing: Option<(PassTimer, Readback)>,
    /// Everything whose size depends on the view or the captures.
    resources: Option<Resources>,
    /// What motions need besides, in frames with motions.
    motion: Option<MotionResources>,
}

/// Buffers that are more than this factor too large, for more than this number of frames, are replaced.
const OVERSIZE_FACTOR: u32 = 4;
const RELEASE_AFTER_IDLE_FRAMES: u32 = 120;

/// Resources of a finished frame on the GPU, for further passes of clients: scoring, a backward pass.
#[derive(Debug, Clone, Copy)]
pub struct FinishedFrame<'a> {
    /// Uniform buffer: one [`layout::FrameUniforms`].
    pub frame: &'a wgpu::Buffer,
    /// Uniform buffer: begins with one [`layout::InstanceUniforms`], of the first part of the first instance.
    pub instances: &'a wgpu::Buffer,
    /// Storage buffer: one [`layout::Counters`].
    pub counters: &'a wgpu::Buffer,
    /// Buffers that the passes have written. After a frame with motions, colors of splats are their motions.
    pub buffers: &'a PassBuffers,
    /// Color over the background and transmittance, `Rgba32Float`. May be larger than the picture, like the depth.
    pub color: &'a wgpu::TextureView,
    /// Expected and median depth, `Rg32Float`.
    pub depth: &'a wgpu::TextureView,
    /// Number of splats for which the buffers have room.
    pub slots: u32,
    /// Number of pairs for which the buffers have room.
    pub pairs: u32,
}

impl ViewRenderer {
    /// Creates a view without size; [`prepare`](Self::prepare) sets it.
    pub fn new(device: &wgpu::Device, renderer: &Renderer) -> Self {
        let allocator = renderer.allocator(device);
        let counters = size_of::<Counters>() as u64;
        let depth = allocator.texture("gs4d no depth", UVec2::ONE, TextureFormat::Depth32Float);
        Self {
            slots: 0,
            picture: UVec2::ONE,
            bin_side: 1,
            design: renderer.resolve(Design::Auto),
            odd: false,
            frames: 0,
            recorded: false,
            pairs_wanted: 0,
            short_of_room: false,
            bin_room: BinRoom::default(),
            oversized_frames: 0,
            instance_uniforms: Vec::new(),
            frame: allocator.buffer("gs4d frame", size_of::<layout::FrameUniforms>() as u64, BufferUsages::UNIFORM),
            steps: allocator.buffer("gs4d steps", u64::from(INSTANCE_STRIDE * 2 * DEPTH_STEPS), BufferUsages::UNIFORM),
            counters: allocator.buffer("gs4d counters", counters, BufferUsages::STORAGE | BufferUsages::COPY_SRC),
            arguments: allocator.buffer("gs4d arguments", 6 * 4, BufferUsages::STORAGE | BufferUsages::INDIRECT),
            no_depth: depth.create_view(&wgpu::TextureViewDescriptor::default()),
            no_environment: allocator.buffer("gs4d no environment", 16, BufferUsages::STORAGE),
            readback: Readback::new(allocator, "gs4d counter readback", counters),
            statistics: ViewStatistics::default(),
            timing: None,
            pixels: Pixels::default(),
            variant: FastVariant::default(),
            fullest_bin: 0,
            cleared_bins: 0,
            has_depths: true,
            resources: None,
            motion: None,
        }
    }

    /// Sizes the buffers for the instances and for the pairs that earlier frames counted, and writes the uniforms. Call
    /// it before the queue is submitted. In the steady state it creates nothing.
    ///
    /// All instances must have views of the same size and lens.
    ///
    /// # Errors
    /// When the picture or a buffer would be larger than the device allows.
    pub fn prepare(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        instances: &[Instance<'_>],
        parameters: &ViewParameters<'_>,
    ) -> Result<(), GpuError> {
        self.poll();
        let (precision, blending) = (parameters.precision, parameters.blending());
        let picture = instances.first().map_or(self.picture, |instance| instance.view.size);
        let total: usize = instances.iter().map(|instance| instance.capture.len()).sum();
        let total = u32::try_from(total).unwrap_or(u32::MAX);
        self.pixels = Pixels { multisampled: blending.is_multisampled(), precision };
        self.has_depths = parameters.depths;
        let joined = instances.chunk_by(Instance::joins);
        let drawn = joined.map(|joined| (joined[0].capture.storage, joined.len() > 1));
        let writes_depths = if self.design == Design::Reference {
            renderer.compile_reference(device, drawn, self.pixels)?;
            true
        } else {
            let large_batches = bins::large_batches(&device.limits(), instances);
            let lists = Lists::suiting(&device.limits(), self.fullest_bin);
            let few_bins = bins::few_bins(picture, bins::bin_side(picture, total), total);
            self.variant = FastVariant { few_bins, lists, blending, precision, large_batches };
            renderer.compile_fast(device, drawn, self.variant)?;
            blending.writes_depths()
        };
        if std::mem::take(&mut self.recorded) {
            self.odd = !self.odd;
            self.frames = self.frames.wrapping_add(1);
        }
        let made = self.resources.as_ref().map(|resources| resources.sizes).unwrap_or_default();
        let limits = device.limits();
        if picture.min_element() == 0 || picture.max_element() > limits.max_texture_dimension_2d {
            return Err(GpuError::Size { width: picture.x, height: picture.y, limit: limits.max_texture_dimension_2d });
        }
        // As many as there will be at any time: another segment of a filter changes no buffer.
        let slots: usize = instances.iter().map(|instance| most_drawn(instance.capture, instance.active)).sum();
        let parts: usize = instances.iter().map(|instance| instance.capture.parts.len()).sum();
        let splat = size_of::<layout::SplatRecord>() as u64;
        let limit = match self.design {
            Design::Reference => binding_limit(&limits),
            Design::Auto | Design::Fast => binding_limit(&limits).min(u64::from(bins::MAX_SLOTS) * splat),
        };
        // The largest buffer per slot holds splats.
        let needed = (slots as u64).next_multiple_of(u64::from(BLOCK)) * splat;
        if needed > limit {
            return Err(GpuError::TooLarge { what: "the splats", needed, limit });
        }
        let slots = slots as u32;
        // A first guess; the counters of later frames correct it.
        let guess = total.saturating_mul(2).min(slots.saturating_mul(6)).max(1 << 16);
        let most = max_pairs(device);
        let pairs = self.pairs_wanted.max(guess).min(most);
        (self.picture, self.bin_side) = (picture, bins::bin_side(picture, total));
        let in_bins = self.fullest_bin.saturating_mul(self.bin_count());
        self.short_of_room = self.statistics.pairs > most || in_bins > most / 2;
        let entries = |picture| match self.design {
            Design::Reference => 0,
            // Twice as many bytes as for pairs.
            Design::Auto | Design::Fast => {
                self.bin_room.wanted().max(bins::first_guess(picture, self.bin_side, slots)).min(most / 2)
            }
        };
        let needed = |picture| Sizes {
            slots: slots.next_multiple_of(BLOCK).max(BLOCK),
            pairs,
            entries: entries(picture),
            parts: (parts as u32).max(1),
            picture,
            depths: if writes_depths { picture } else { UVec2::ONE },
        };
        let [exact, grown] = [picture, grown(made.picture, picture, limits.max_texture_dimension_2d)].map(needed);
        let sizes = self.kept_sizes(made, exact, grown, guess);
        let environment = instances.iter().find_map(|i| Some((i, i.capture.environment.as_ref()?)));
        let opaque = parameters.opaque.filter(|opaque| opaque.samples > 0);
        let opaque_view = opaque.map_or(&self.no_depth, |depth| depth.texture).clone();
        let environment_buffer = environment.map_or(&self.no_environment, |(_, map)| &map.buffer).clone();
        match &mut self.resources {
            Some(made) if made.sizes == sizes && made.pixels == self.pixels => {
                let allocator = renderer.allocator(device);
                made.bind_pixel(allocator, &renderer.layouts, &self.frame, opaque_view, environment_buffer);
            }
            _ => {
                self.odd = false;
                self.motion = None;
                self.resources = Some(self.make(device, queue, renderer, sizes, opaque_view, environment_buffer));
            }
        }
        let active =
            |i: &Instance<'_>| (0..i.capture.parts.len()).map(|at| drawn_count(i.capture, at, i.active)).sum::<u32>();
        self.slots = instances.iter().map(active).sum();
        self.prepare_motion(device, queue, renderer, instances, parameters)?;
        self.statistics.bytes = self.resources.as_ref().map_or(0, |made| made.bytes)
            + self.motion.as_ref().map_or(0, MotionResources::bytes);
        self.statistics.total = total;
        self.statistics.active = self.slots;
        self.write_uniforms(queue, instances, parameters, environment.map(|(i, m)| (i.view, i.appearance, m.size)));
        Ok(())
    }

    /// Returns the color `C` (premultiplied, in the blend space) and transmittance, as precise as
    /// [asked for](ViewParameters::precision). The picture begins at the first texel; the texture may be larger, since pictures of several
    /// sizes share it. `None` before the first [`prepare`](Self::prepare).
    pub fn color(&self) -> Option<&wgpu::TextureView> {
        self.resources.as_ref().map(|made| &made.color_view)
    }

    /// Returns the camera-space depth: `Rg32Float`. Red is the expected depth `Σ z α T`, not divided by `1 − T`; green
    /// the median depth, that of the splat at which T falls to one half or below, 0 if it never does. The texture is as large as
    /// that of the [color](Self::color). `None` before the first [`prepare`](Self::prepare), and if the last was without
    /// [`depths`](ViewParameters::depths).
    pub fn depth(&self) -> Option<&wgpu::TextureView> {
        self.resources.as_ref().filter(|_| self.has_depths).map(|made| &made.depth_view)
    }

    /// Returns the motion since the frame before, blended as colors are: red and green are `Σ m α T`, not divided by `1 − T`, with `m` in
    /// pixels to the right and down; alpha is T. Format and size are those of the [color](Self::color). `None` if the last
    /// [`prepare`](Self::prepare) was without [`previous`](ViewParameters::previous) views.
    pub fn motion(&self) -> Option<&wgpu::TextureView> {
        self.motion.as_ref().map(|motion| &motion.view)
    }

    /// Sets whether GPU time is measured from the next frame on, pass by pass. Results arrive in
    /// [`statistics`](Self::statistics) some frames later; there are none if the device has no timestamps inside
    /// passes.
    pub fn measure(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, renderer: &Renderer, on: bool) {
        if !on {
            self.timing = None;
            self.statistics.passes.clear();
        } else if self.timing.is_none() {
            let allocator = renderer.allocator(device);
            self.timing = PassTimer::new(allocator, queue, self.timed_passes()).map(|timer| {
                let size = timer.resolved().size();
                (timer, Readback::new(allocator, "gs4d timestamp readback", size))
            });
        }
    }

    /// Chooses how the view is drawn from the next [`prepare`](Self::prepare) on. Default: [`Design::Auto`]. GPU time is no longer
    /// [measured](Self::measure) after a change.
    pub fn set_design(&mut self, renderer: &Renderer, design: Design) {
        let design = renderer.resolve(design);
        if self.design != design {
            self.design = design;
            self.timing = None;
            self.release();
        }
    }

    /// Returns how the view is drawn: never [`Design::Auto`].
    pub fn design(&self) -> Design {
        self.design
    }

    /// Returns the work of the view.
    pub fn statistics(&self) -> &ViewStatistics {
        &self.statistics
    }

    /// Returns the textures behind [`color`](Self::color) and [`depth`](Self::depth).
    pub(crate) fn textures(&self) -> Option<(&wgpu::Texture, Option<&wgpu::Texture>)> {
        self.resources.as_ref().map(|made| (&made.color, self.has_depths.then_some(&made.depth)))
    }

    /// Returns the texture behind [`motion`](Self::motion), and the size of the picture in it.
    pub(crate) fn motion_texture(&self) -> Option<(&wgpu::Texture, UVec2)> {
        self.motion.as_ref().map(|motion| (&motion.texture, self.picture))
    }

    /// Returns the resources of the frame recorded last; `None` before the first [`prepare`](Self::prepare).
    pub fn finished(&self) -> Option<FinishedFrame<'_>> {
        self.resources.as_ref().map(|made| FinishedFrame {
            frame: &self.frame,
            instances: &made.instances,
            counters: &self.counters,
            buffers: &made.buffers,
            color: &made.color_view,
            depth: &made.depth_view,
            slots: made.sizes.slots,
            pairs: made.sizes.pairs,
        })
    }

    /// Makes the next [`prepare`](Self::prepare) allocate room for frames with these counters and half as much more, where there is
    /// hardly enough and the device allows it.
    pub(crate) fn make_room(&mut self, counters: &Counters) {
        // Counts of a frame before the buffers were released say nothing of the next.
        let Some(made) = self.resources.as_ref().map(|made| made.sizes) else { return };
        // The buffers grow early, since counts arrive some frames late.
        let pairs = self.pair_count(counters);
        if pairs > made.pairs / 4 * 3 {
            self.pairs_wanted = pairs.saturating_add(pairs / 2);
        }
        if self.design == Design::Fast {
            self.bin_room.note(counters.pairs_wanted.saturating_mul(self.bin_count()), made.entries);
        }
    }

    /// Makes the next [`prepare`](Self::prepare) allocate as much room as another view has, or will have with its next.
    pub(crate) fn make_room_of(&mut self, other: &Self) {
        let made = other.resources.as_ref().map(|made| made.sizes).unwrap_or_default();
        self.pairs_wanted = other.pairs_wanted.max(made.pairs);
        self.bin_room = BinRoom::of(other.bin_room.wanted().max(made.entries));
    }

    /// Returns the number of pairs for which there is room.
    pub(crate) fn pair_capacity(&self) -> u32 {
        self.resources.as_ref().map_or(0, |made| made.sizes.pairs)
    }

    /// Returns the number of pairs of a frame with these counters, whether there was room for all of them or not.
    pub(crate) fn pair_count(&self, counters: &Counters) -> u32 {
        match self.design {
            Design::Auto | Design::Fast => counters.pairs,
            Design::Reference => counters.pairs_wanted,
        }
    }

    /// Returns whether the newest frame whose counters have arrived had more pairs, or splats in its bins, than this device has room for.
    /// Such frames lack nothing, but they are slow, and stay so: a frame that only lacks the room that it is going to get is not meant.
    pub fn is_short_of_room(&self) -> bool {
        self.short_of_room
    }

    /// Frees the working buffers and targets; the next [`prepare`](Self::prepare) creates them again.
    pub fn release(&mut self) {
        self.resources = None;
        self.motion = None;
        self.pairs_wanted = 0;
        self.short_of_room = false;
        self.bin_room = BinRoom::default();
        self.fullest_bin = 0;
        self.statistics = ViewStatistics::default();
    }

    /// Returns the sizes to allocate. Sizes grow from frame to frame, but buffers that have been far too large for a
    /// while are reduced. `exact` is what the frame needs, with `guess` pairs, `grown` the same with room for pictures to come.
    fn kept_sizes(&mut self, made: Sizes, exact: Sizes, grown: Sizes, guess: u32) -> Sizes {
        let counted = self.statistics.pairs.saturating_add(self.statistics.pairs / 2).max(1 << 16);
        let oversized = made.slots / OVERSIZE_FACTOR > exact.slots
            || made.pairs / OVERSIZE_FACTOR > guess.max(counted)
            || made.entries / OVERSIZE_FACTOR > exact.entries
            || made.picture.element_product() / OVERSIZE_FACTOR > exact.picture.element_product();
        self.oversized_frames = if oversized { self.oversized_frames + 1 } else { 0 };
        if self.oversized_frames > RELEASE_AFTER_IDLE_FRAMES {
            self.oversized_frames = 0;
            self.pairs_wanted = counted;
            return Sizes { pairs: guess.max(counted), ..exact };
        }
        Sizes {
            slots: made.slots.max(grown.slots),
            pairs: made.pairs.max(grown.pairs),
            entries: made.entries.max(grown.entries),
            parts: made.parts.max(grown.parts),
            picture: grown.picture,
            depths: grown.depths,
        }
    }

    /// Processes the counters and timestamps of earlier frames that have arrived.
    fn poll(&mut self) {
        if let Some(counters) = self.readback.poll() {
            let counters: Counters = bytemuck::pod_read_unaligned(&counters);
            self.statistics.visible = counters.visible;
            self.statistics.pairs = self.pair_count(&counters);
            if self.design == Design::Fast {
                self.fullest_bin = counters.pairs_wanted;
            }
            self.make_room(&counters);
        }
        if let Some((timer, readback)) = &mut self.timing
            && let Some(timestamps) = readback.poll()
        {
            let named = timer.passes().iter().zip(timer.intervals(&timestamps));
            self.statistics.passes = named.map(|(&name, milliseconds)| PassTime { name, milliseconds }).collect();
        }
    }

    fn write_uniforms(
        &mut self,
        queue: &wgpu::Queue,
        instances: &[Instance<'_>],
        parameters: &ViewParameters<'_>,
        environment: Option<(View, Appearance, [u32; 2])>,
    ) {
        let mut uniforms = std::mem::take(&mut self.instance_uniforms);
        uniforms.clear();
        let Some(made) = &self.resources else { return };
        let mut slot = 0;
        let mut index = 0;
        for instance in instances {
            let ViewParameters { blend_space, debug, .. } = *parameters;
            let view = layout::InstanceUniforms::new(&instance.view, &instance.appearance, blend_space, debug);
            let capture = instance.capture.instance(&view);
            let mut first_listed = 0;
            for (part_index, part) in instance.capture.parts.iter().enumerate() {
                let count = drawn_count(instance.capture, part_index, instance.active);
                let listed = u32::from(instance.active.is_some());
                let binning = self.binning(&made.sizes, index);
                let per_thread = fast::per_thread(count);
                let uniform = layout::InstanceUniforms {
                    first_slot: slot,
                    count,
                    listed,
                    first_listed,
                    per_thread,
                    binning,
                    ..capture
                };
                uniforms.extend_from_slice(bytemuck::bytes_of(&uniform));
                uniforms.resize(uniforms.len().next_multiple_of(INSTANCE_STRIDE as usize), 0);
                slot += count;
                first_listed += part.count;
                index += 1;
            }
        }
        queue.write_buffer(&made.instances, 0, &uniforms);
        let (mode, color) = match (parameters.background, environment) {
            (Background::Color(color), _) => (layout::BACKGROUND_COLOR, color),
            (Background::Environment, Some((view, ..))) if !view.orthographic => {
                (layout::BACKGROUND_ENVIRONMENT, [0.0; 3])
            }
            _ => (layout::BACKGROUND_NONE, [0.0; 3]),
        };
        let (view, appearance, environment_size) = environment.unwrap_or_else(|| {
            let view = View::new(self.picture, 0.0, glam::Mat4::IDENTITY, glam::Vec4::ONE, glam::Vec2::ONE);
            (instances.first().map_or(view, |instance| instance.view), Appearance::default(), [0; 2])
        });
        let color = if mode == layout::BACKGROUND_ENVIRONMENT { appearance.light.to_array() } else { color };
        let to_world = view.world_to_camera.inverse();
        let column = |axis: usize| to_world.col(axis).truncate().extend(view.camera_position[axis]).to_array();
        let opaque = parameters.opaque.as_ref();
        let frame = layout::FrameUniforms {
            size: self.picture.to_array(),
            tiles: tiles(self.picture).to_array(),
            slots: self.slots,
            pair_capacity: made.sizes.pairs,
            background_mode: mode,
            opaque_samples: opaque.map_or(0, |depth| depth.samples),
            // With opaque depth a compositor follows: the map must hide what is behind it.
            background: [color[0], color[1], color[2], if opaque.is_some() { 0.0 } else { 1.0 }],
            projection: view.projection.to_array(),
            world_x: column(0),
            world_y: column(1),
            world_z: column(2),
            environment_size,
            opaque_origin: opaque.map_or([0; 2], |depth| depth.origin.to_array()),
            opaque_distance: opaque.map_or([0.0; 4], |depth| depth.distance),
            environment_lighting: layout::lighting_mode(&appearance, parameters.blend_space),
            debug: layout::debug_mode(parameters.debug),
            // Two capture units.
            debug_depth: 2.0 * view.world_to_camera.row(2).truncate().length(),
            environment_opacity: appearance.opacity.clamp(0.0, 1.0),
            binning: self.binning(&made.sizes, 0),
        };
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        if let Some(motion) = &self.motion {
            motion.write(queue, &frame, instances, parameters.previous.unwrap_or_default());
        }
        self.instance_uniforms = uniforms;
    }
}

/// Returns the number of pairs that fit one binding and one dispatch.
pub(crate) fn max_pairs(device: &wgpu::Device) -> u32 {
    let limits = device.limits();
    let bound = u32::try_from(binding_limit(&limits) / 4).unwrap_or(u32::MAX);
    // One workgroup processes a block of them.
    bound.min(limits.max_compute_workgroups_per_dimension.saturating_mul(BLOCK))
}
