//! The preparation of a frame: pipelines, sizes, resources and uniforms.
//!
//! In: instances and [`ViewParameters`], and the counters of earlier frames. Out: a [`ViewRenderer`] that can be recorded.

use super::motion::MotionResources;
use super::resources::{Resources, texture_bytes};
use super::view_renderer::ViewRenderer;
use crate::renderer::active::{most_at_once, most_drawn};
use crate::renderer::device::GpuError;
use crate::renderer::device::memory::{binding_limit, require_texture};
use crate::renderer::frame::Preparation;
use crate::renderer::frame::{Instance, ViewParameters};
use crate::renderer::frame::{Sizes, grown, max_pairs};
use crate::renderer::layout::{BLOCK, Counters, SplatRecord};
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Pixels;
use crate::renderer::timing::{PassTime, PassTimer, WHOLE_FRAME};
use crate::view::DebugView;

/// Buffers that are too large by more than this factor, for more than this number of frames, are replaced.
const OVERSIZE_FACTOR: u32 = 4;
const RELEASE_AFTER_IDLE_FRAMES: u32 = 120;

/// Checks that a view can draw so many Gaussians, in a design that draws at most so many splats.
fn check_slots(limits: &wgpu::Limits, most_slots: u32, slots: usize) -> Result<(), GpuError> {
    // The buffer of splats has the largest elements per slot.
    let splat = size_of::<SplatRecord>() as u64;
    let limit = binding_limit(limits).min(u64::from(most_slots) * splat);
    let needed = (slots as u64).next_multiple_of(u64::from(BLOCK)) * splat;
    if needed > limit { Err(GpuError::TooLarge { what: "the splats", needed, limit }) } else { Ok(()) }
}

/// Returns the sum of a number of each instance.
fn sum(instances: &[Instance<'_>], number: impl Fn(&Instance<'_>) -> usize) -> u32 {
    u32::try_from(instances.iter().map(number).sum::<usize>()).unwrap_or(u32::MAX)
}

impl ViewRenderer {
    /// Checks that a view can draw a capture that draws at most so many Gaussians at any time, in the design with the higher limit.
    ///
    /// # Errors
    /// When the buffer of its splats would be larger than the device can bind.
    pub fn check_room(device: &wgpu::Device, most_drawn: usize) -> Result<(), GpuError> {
        check_slots(&device.limits(), u32::MAX, most_drawn)
    }

    /// Sizes the buffers for the instances and for the pairs that earlier frames counted, and writes the uniforms. Call
    /// it before the queue is submitted. In the steady state it creates no resources.
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
        // The maximum over time, so that another segment of a filter does not change the buffers.
        let at_most: usize = instances.iter().map(|instance| most_drawn(instance.capture, instance.active)).sum();
        self.at_most = at_most;
        self.choose_design(device, renderer, at_most);
        let blending = parameters.blending();
        let frame = Preparation {
            renderer,
            device,
            queue,
            instances,
            blending,
            pixels: Pixels { multisampled: blending.is_multisampled(), precision: parameters.precision },
            at_most,
            gaussians: sum(instances, |instance| most_at_once(instance.capture, instance.active)),
            most_pairs: max_pairs(device),
        };
        let sizes = self.choose_sizes(&frame)?;
        self.has_depths = parameters.depths;
        let environment = instances.iter().find_map(|i| i.capture.environment.as_ref());
        let opaque = parameters.opaque.filter(|opaque| opaque.samples > 0);
        let opaque_view = opaque.map_or(&self.no_depth, |depth| depth.texture).clone();
        let environment_buffer = environment.map_or(&self.no_environment, |map| &map.buffer).clone();
        self.fit(&frame, sizes, opaque_view, environment_buffer);
        self.design.begin();
        let active = |i: &Instance<'_>| (0..i.capture.parts.len()).map(|at| i.drawn(at)).sum::<u32>();
        self.slots = instances.iter().map(active).sum();
        self.prepare_motion(&frame, parameters)?;
        self.count_bytes();
        self.statistics.total = sum(instances, |instance| instance.capture.len());
        self.statistics.active = self.slots;
        self.write_instances(&frame, parameters);
        self.write_frame(&frame, parameters);
        Ok(())
    }

    /// Chooses the variants of the passes, and returns the sizes to allocate.
    fn choose_sizes(&mut self, frame: &Preparation<'_>) -> Result<Sizes, GpuError> {
        let (limits, slots, most) = (frame.device.limits(), frame.at_most as u32, frame.most_pairs);
        let picture = frame.instances.first().map_or(self.picture, |instance| instance.view.size);
        require_texture(picture, &limits)?;
        check_slots(&limits, self.design.most_slots(), frame.at_most)?;
        // A first guess; the counters of later frames correct it.
        let guess = frame.gaussians.saturating_mul(2).min(slots.saturating_mul(6)).max(1 << 16);
        let parts = sum(frame.instances, |instance| instance.capture.parts.len());
        let made = self.resources.as_ref().map(|made| made.sizes).unwrap_or_default();
        let mut sizes = [picture, grown(made.picture, picture, limits.max_texture_dimension_2d)].map(|picture| Sizes {
            slots: slots.next_multiple_of(BLOCK).max(BLOCK),
            pairs: self.pairs_wanted.max(guess).min(most),
            entries: 0,
            ordered: 0,
            parts: parts.max(1),
            picture,
            depths: picture,
        });
        self.design.choose(frame, &mut sizes)?;
        self.picture = picture;
        let pairs = self.statistics.pairs;
        self.short_of_room = pairs > most || self.design.entries_needed().min(pairs) > most / 2;
        Ok(self.kept_sizes(made, sizes, guess))
    }

    /// Creates the resources of a frame, unless they exist, and binds its opaque depth and its environment map.
    fn fit(&mut self, frame: &Preparation<'_>, sizes: Sizes, opaque: wgpu::TextureView, environment: wgpu::Buffer) {
        let is_fit = |made: &&mut Resources| {
            made.sizes == sizes && made.pixels == frame.pixels && self.design.shares_current(frame.renderer)
        };
        if let Some(made) = self.resources.as_mut().filter(is_fit) {
            made.bind_pixel(frame, &self.frame, opaque, environment);
            return;
        }
        // The old resources are freed before new ones are created.
        (self.motion, self.resources) = (None, None);
        self.resources = Some(Resources::new(frame, &mut *self.design, sizes, &self.frame, opaque, environment));
    }

    /// Counts the bytes of buffers and targets.
    fn count_bytes(&mut self) {
        let [own, shared] = self.design.bytes();
        let targets = self.resources.iter().flat_map(|made| [&made.color, &made.depth]);
        let targets = targets.chain(self.motion.iter().map(|motion| &motion.texture));
        self.statistics.bytes = own + targets.map(texture_bytes).sum::<u64>();
        self.statistics.shared_bytes = shared;
    }

    /// Creates the resources of motions if the frame has motions and they do not exist; releases them if it has none.
    fn prepare_motion(&mut self, frame: &Preparation<'_>, parameters: &ViewParameters<'_>) -> Result<(), GpuError> {
        let known = self.motion.take();
        if let (Some(_), Some(made)) = (parameters.previous, &self.resources) {
            let color = ViewParameters { depths: false, debug: DebugView::Color, ..*parameters };
            self.design.compile_motion(frame, color.blending())?;
            self.motion = known.or_else(|| MotionResources::new(frame, made, &*self.design));
            if let Some(motion) = &mut self.motion {
                motion.update(frame, made);
            }
        }
        // Designs have other passes, and frames with motions have more. A frame timed as a whole has none.
        let stale = |timer: &PassTimer| !timer.passes().is_empty() && timer.passes() != self.timed_passes();
        if self.timing.as_ref().is_some_and(|(timer, _)| stale(timer)) {
            self.begin_timing(frame.renderer.allocator(frame.device), frame.queue);
        }
        Ok(())
    }

    /// Returns the sizes to allocate. Sizes grow from frame to frame, but buffers that have been far too large for some frames are reduced.
    /// `exact` are the sizes that the frame needs, with `guess` pairs; `grown` are the same sizes with a reserve for larger pictures.
    fn kept_sizes(&mut self, made: Sizes, [exact, grown]: [Sizes; 2], guess: u32) -> Sizes {
        let counted = self.statistics.pairs.saturating_add(self.statistics.pairs / 2).max(1 << 16);
        let oversized = made.slots / OVERSIZE_FACTOR > exact.slots
            || made.pairs / OVERSIZE_FACTOR > guess.max(counted)
            || made.entries / OVERSIZE_FACTOR > exact.entries
            || made.ordered / OVERSIZE_FACTOR > exact.ordered
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
            ordered: made.ordered.max(grown.ordered),
            parts: made.parts.max(grown.parts),
            picture: grown.picture,
            depths: grown.depths,
        }
    }

    /// Processes the counters and timestamps of earlier frames that have arrived.
    fn poll(&mut self) {
        // Counters from before a release may be those of another design or of other captures.
        let current = self.copied_from == self.generation;
        if let Some(counters) = self.readback.poll().filter(|_| current) {
            let counters: Counters = bytemuck::pod_read_unaligned(&counters);
            self.statistics.visible = counters.visible;
            self.statistics.pairs = self.design.pair_count(&counters);
            self.make_room_for(&counters, self.copied);
        }
        if let Some((timer, readback)) = &mut self.timing
            && let Some(timestamps) = readback.poll()
        {
            let names = if timer.passes().is_empty() { WHOLE_FRAME } else { timer.passes() };
            let named = names.iter().zip(timer.intervals(&timestamps));
            self.statistics.passes = named.map(|(&name, milliseconds)| PassTime { name, milliseconds }).collect();
        }
    }
}
