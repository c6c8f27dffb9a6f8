//! The preparation of a frame: pipelines, sizes, resources and uniforms.
//!
//! In: instances and [`ViewParameters`], and the counters of earlier frames. Out: a [`ViewRenderer`] that can be recorded.

use super::motion::MotionResources;
use super::parameters::{Instance, ViewParameters};
use super::resources::{DesignBuffers, Resources};
use super::sizes::{Sizes, grown, max_pairs};
use super::view_renderer::ViewRenderer;
use crate::renderer::active::{drawn_count, most_at_once, most_drawn};
use crate::renderer::design::Design;
use crate::renderer::error::GpuError;
use crate::renderer::global_sort;
use crate::renderer::layout::{self, BLOCK, Counters};
use crate::renderer::memory::{binding_limit, require_texture};
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Pixels;
use crate::renderer::tile_bins::{self, BinVariant, Lists};
use crate::renderer::timing::{PassTime, PassTimer, WHOLE_FRAME};
use crate::view::DebugView;
use glam::UVec2;

/// Buffers that are too large by more than this factor, for more than this number of frames, are replaced.
const OVERSIZE_FACTOR: u32 = 4;
const RELEASE_AFTER_IDLE_FRAMES: u32 = 120;

/// Checks that a view with this design can draw so many Gaussians.
fn check_slots(limits: &wgpu::Limits, design: Design, slots: usize) -> Result<(), GpuError> {
    let splat = size_of::<layout::SplatRecord>() as u64;
    let limit = match design {
        Design::GlobalSort => binding_limit(limits),
        Design::Auto | Design::TileBins => binding_limit(limits).min(u64::from(tile_bins::MAX_SLOTS) * splat),
    };
    // The buffer of splats has the largest elements per slot.
    let needed = (slots as u64).next_multiple_of(u64::from(BLOCK)) * splat;
    if needed > limit { Err(GpuError::TooLarge { what: "the splats", needed, limit }) } else { Ok(()) }
}

impl ViewRenderer {
    /// Checks that a view can draw a capture that draws at most so many Gaussians at any time, in the design with the higher limit.
    ///
    /// # Errors
    /// When the buffer of its splats would be larger than the device can bind.
    pub fn check_room(device: &wgpu::Device, most_drawn: usize) -> Result<(), GpuError> {
        check_slots(&device.limits(), Design::GlobalSort, most_drawn)
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
        self.choose_design(device, renderer, at_most);
        let (precision, blending) = (parameters.precision, parameters.blending());
        let picture = instances.first().map_or(self.picture, |instance| instance.view.size);
        let sum = |count: fn(&Instance<'_>) -> usize| {
            u32::try_from(instances.iter().map(count).sum::<usize>()).unwrap_or(u32::MAX)
        };
        let gaussians = sum(|instance| most_at_once(instance.capture, instance.active));
        let limits = device.limits();
        require_texture(picture, &limits)?;
        check_slots(&limits, self.design, at_most)?;
        let slots = at_most as u32;
        // A first guess; the counters of later frames correct it.
        let guess = gaussians.saturating_mul(2).min(slots.saturating_mul(6)).max(1 << 16);
        let most = max_pairs(device);
        let pairs = self.pairs_wanted.max(guess).min(most);
        let side = tile_bins::bin_side(picture, gaussians);
        // An entry has twice as many bytes as a pair.
        let equal_rooms = tile_bins::equal_rooms(pairs).min(most / 2);
        let first_entries = |picture| tile_bins::first_guess(picture, side, slots);
        self.pixels = Pixels { multisampled: blending.is_multisampled(), precision };
        self.has_depths = parameters.depths;
        let joined = instances.chunk_by(Instance::joins);
        let drawn = joined.map(|joined| (joined[0].capture.storage, joined.len() > 1));
        let writes_depths = if self.design == Design::GlobalSort {
            if renderer.is_software {
                self.at_once = global_sort::at_once(at_most).ok_or(GpuError::TooManySplats { slots: at_most })?;
            }
            renderer.passes.global_sort.compile(device, drawn, self.pixels, self.at_once)?;
            true
        } else {
            let large_batches = tile_bins::large_batches(&limits, instances);
            let lists = Lists::suiting(&limits, self.bins.fullest);
            let few_bins = tile_bins::few_bins(picture, side, gaussians);
            let counted = self.bins.must_count(first_entries(picture), equal_rooms);
            let wanted = BinVariant { few_bins, counted, lists, blending, precision, large_batches };
            self.bins.variant = renderer.bin_variant(device, drawn, wanted)?;
            blending.writes_depths()
        };
        if std::mem::take(&mut self.recorded) {
            self.bins.odd = !self.bins.odd;
        }
        let made = self.resources.as_ref().map(|resources| resources.sizes).unwrap_or_default();
        let parts: usize = instances.iter().map(|instance| instance.capture.parts.len()).sum();
        (self.picture, self.bins.side) = (picture, side);
        let in_bins = self.bins.fullest.saturating_mul(self.bins.count(picture));
        self.short_of_room = self.statistics.pairs > most || in_bins.min(self.statistics.pairs) > most / 2;
        let entries = |picture| match self.design {
            Design::GlobalSort => 0,
            Design::Auto | Design::TileBins => {
                self.bins.entries(first_entries(picture), equal_rooms, pairs).min(most / 2)
            }
        };
        let needed = |picture| Sizes {
            slots: slots.next_multiple_of(BLOCK).max(BLOCK),
            pairs,
            entries: entries(picture),
            ordered: if self.bins.variant.counted { entries(picture) } else { 0 },
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
            Some(made) if made.sizes == sizes && made.pixels == self.pixels && made.shares_current(renderer) => {
                let allocator = renderer.allocator(device);
                made.bind_pixel(allocator, &renderer.layouts, &self.frame, opaque_view, environment_buffer);
            }
            _ => {
                self.bins.odd = false;
                // The old buffers are freed, and what they claim of the shared ones, before new ones are created.
                (self.motion, self.resources) = (None, None);
                self.resources = Some(Resources::new(
                    renderer,
                    device,
                    queue,
                    self.design,
                    sizes,
                    self.pixels,
                    &self.frame,
                    opaque_view,
                    environment_buffer,
                ));
            }
        }
        if let Some(DesignBuffers::TileBins(buffers)) = self.resources.as_ref().map(|made| &made.buffers) {
            self.bins.frame = buffers.next_frame();
        }
        let active =
            |i: &Instance<'_>| (0..i.capture.parts.len()).map(|at| drawn_count(i.capture, at, i.active)).sum::<u32>();
        self.slots = instances.iter().map(active).sum();
        self.prepare_motion(device, queue, renderer, instances, parameters)?;
        self.statistics.bytes = self.resources.as_ref().map_or(0, |made| made.bytes)
            + self.motion.as_ref().map_or(0, MotionResources::bytes);
        self.statistics.shared_bytes = self.resources.as_ref().map_or(0, Resources::shared_bytes);
        self.statistics.total = sum(|instance| instance.capture.len());
        self.statistics.active = self.slots;
        self.write_uniforms(queue, instances, parameters, environment.map(|(i, m)| (i.view, i.appearance, m.size)));
        Ok(())
    }

    /// Creates the resources of motions if the frame has motions and they do not exist; releases them if it has none.
    fn prepare_motion(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        instances: &[Instance<'_>],
        parameters: &ViewParameters<'_>,
    ) -> Result<(), GpuError> {
        let known = self.motion.take();
        if parameters.previous.is_some() {
            let storages = instances.iter().map(|instance| instance.capture.storage);
            renderer.passes.compile_motion(device, storages, self.design)?;
            let color = ViewParameters { depths: false, debug: DebugView::Color, ..*parameters };
            let mut variant = BinVariant { blending: color.blending(), ..self.bins.variant };
            if self.design == Design::TileBins {
                variant = renderer.bin_variant(device, std::iter::empty(), variant)?;
            }
            if let Some(made) = &self.resources {
                let allocator = renderer.allocator(device);
                let mut motion = known.unwrap_or_else(|| MotionResources::new(renderer, allocator, made, variant));
                motion.update(renderer, allocator, made, variant);
                self.motion = Some(motion);
            }
        }
        // Frames with motions have more timed passes. A frame timed as a whole has none.
        let stale = |timer: &PassTimer| !timer.passes().is_empty() && timer.passes() != self.timed_passes();
        if self.timing.as_ref().is_some_and(|(timer, _)| stale(timer)) {
            self.measure(device, queue, renderer, false);
            self.measure(device, queue, renderer, true);
        }
        Ok(())
    }

    /// Returns the sizes to allocate. Sizes grow from frame to frame, but buffers that have been far too large for some frames are reduced.
    /// `exact` are the sizes that the frame needs, with `guess` pairs; `grown` are the same sizes with a reserve for larger pictures.
    fn kept_sizes(&mut self, made: Sizes, exact: Sizes, grown: Sizes, guess: u32) -> Sizes {
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
            self.statistics.pairs = self.pair_count(&counters);
            if self.design == Design::TileBins {
                self.bins.fullest = counters.pairs_wanted;
                self.bins.visible = counters.visible;
            }
            self.make_room(&counters);
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
