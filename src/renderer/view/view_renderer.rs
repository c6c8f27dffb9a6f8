//! The state of one view on the GPU: its working buffers, its targets and its statistics.
//!
//! In: a device and a [`Renderer`]. Out: [`ViewRenderer`] with its settings and results. `prepare` and `record` fill and record the frame.

use super::motion::MotionResources;
use super::readback::Readback;
use super::resources::Resources;
use crate::renderer::device::memory::Allocator;
use crate::renderer::frame::{CountedFrame, Design, ViewDesign};
use crate::renderer::global_sort::{FinishedFrame, GlobalSort};
use crate::renderer::layout::{self, Counters};
use crate::renderer::pipelines::Renderer;
use crate::renderer::statistics::ViewStatistics;
use crate::renderer::tile_bins::TileBins;
use crate::renderer::timing::{Measured, PassTimer};
use glam::UVec2;
use std::any::Any;
use wgpu::{BufferUsages, TextureFormat};

/// The last timed passes of a design: only frames with motions have them.
const MOTION_PASSES: usize = 2;

/// Returns a design at work for a view, without buffers.
fn begun(design: Design) -> Box<dyn ViewDesign> {
    match design {
        Design::GlobalSort => Box::<GlobalSort>::default(),
        Design::Auto | Design::TileBins => Box::<TileBins>::default(),
    }
}

/// Working buffers, uniforms and targets of one view.
#[derive(Debug)]
pub struct ViewRenderer {
    /// Number of slots of the frame prepared last, and the size of its picture.
    pub(super) slots: u32,
    pub(super) picture: UVec2,
    /// The design as set, and the design of the frame prepared last.
    pub(super) wanted: Design,
    pub(in crate::renderer) design: Box<dyn ViewDesign>,
    /// Whether the client checks each frame with [`must_draw_again`](Self::must_draw_again), and whether a frame had to be drawn again.
    pub(in crate::renderer) draws_again: bool,
    pub(super) crowded: bool,
    /// Number of releases of the buffers.
    pub(super) generation: u32,
    /// The largest number of splats at any time, of the frame prepared last.
    pub(super) at_most: usize,
    /// The frame whose counters are read back, and the number of releases before it.
    pub(super) copied: CountedFrame,
    pub(super) copied_from: u32,
    /// Whether the frame prepared last has depths, and whether colors of splats are computed.
    pub(super) has_depths: bool,
    pub(super) has_colors: bool,
    /// Number of pairs that earlier frames need, and whether a frame exceeded the limits of the device.
    pub(super) pairs_wanted: u32,
    pub(super) short_of_room: bool,
    /// Number of successive frames for which the buffers have been far too large.
    pub(super) oversized_frames: u32,
    /// Bytes of the instance uniforms of a frame, kept to reuse the allocation.
    pub(super) instance_uniforms: Vec<u8>,
    pub(super) frame: wgpu::Buffer,
    pub(super) no_depth: wgpu::TextureView,
    pub(super) no_environment: wgpu::Buffer,
    pub(super) readback: Readback,
    pub(super) statistics: ViewStatistics,
    /// How GPU time is measured.
    measured: Measured,
    /// Timestamps, if GPU time is measured and the device supports timestamps.
    pub(super) timing: Option<(PassTimer, Readback)>,
    /// Resources whose sizes depend on the view or the captures.
    pub(super) resources: Option<Resources>,
    /// Resources of motions, in frames with motions.
    pub(super) motion: Option<MotionResources>,
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
            wanted: Design::Auto,
            design: begun(renderer.resolve(Design::Auto)),
            draws_again: false,
            crowded: false,
            generation: 0,
            at_most: 0,
            copied: CountedFrame::default(),
            copied_from: 0,
            pairs_wanted: 0,
            short_of_room: false,
            oversized_frames: 0,
            instance_uniforms: Vec::new(),
            frame: allocator.buffer("gs4d frame", size_of::<layout::FrameUniforms>() as u64, BufferUsages::UNIFORM),
            no_depth: depth.create_view(&wgpu::TextureViewDescriptor::default()),
            no_environment: allocator.buffer("gs4d no environment", 16, BufferUsages::STORAGE),
            readback: Readback::new(allocator, "gs4d counter readback", counters),
            statistics: ViewStatistics::default(),
            measured: Measured::Nothing,
            timing: None,
            has_depths: true,
            has_colors: true,
            resources: None,
            motion: None,
        }
    }

    /// Returns the color `C` (premultiplied, in the blend space) and transmittance, in the precision of
    /// [`ViewParameters`](crate::renderer::ViewParameters::precision). The picture begins at the first texel; the texture may be larger, since
    /// it is reused for pictures of several sizes. `None` before the first [`prepare`](Self::prepare).
    pub fn color(&self) -> Option<&wgpu::TextureView> {
        self.resources.as_ref().map(|made| &made.color_view)
    }

    /// Returns the camera-space depth: `Rg32Float`. Red is the expected depth `Σ z α T`, not divided by `1 − T`; green
    /// the median depth, the depth of the splat at which T falls to one half or below, 0 if it never does. The texture has the size of
    /// the texture of [color](Self::color). `None` before the first [`prepare`](Self::prepare), and if the last call was without
    /// [`depths`](crate::renderer::ViewParameters::depths).
    pub fn depth(&self) -> Option<&wgpu::TextureView> {
        self.resources.as_ref().filter(|_| self.has_depths).map(|made| &made.depth_view)
    }

    /// Returns the motion since the previous frame, blended like colors: red and green are `Σ m α T`, not divided by `1 − T`, with `m` in
    /// pixels to the right and down; alpha is T. Format and size are the same as for [color](Self::color). `None` if the last
    /// [`prepare`](Self::prepare) was without [`previous`](crate::renderer::ViewParameters::previous) views.
    pub fn motion(&self) -> Option<&wgpu::TextureView> {
        self.motion.as_ref().map(|motion| &motion.view)
    }

    /// Sets how GPU time is measured from the next frame on. Results arrive in [`statistics`](Self::statistics) some frames later; there are
    /// none if the device has no timestamps.
    pub fn measure(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, renderer: &Renderer, measured: Measured) {
        if self.measured != measured {
            self.measured = measured;
            self.begin_timing(renderer.allocator(device), queue);
        }
    }

    /// Creates the timestamps of the frames from the next one on, or releases them.
    pub(super) fn begin_timing(&mut self, allocator: Allocator<'_>, queue: &wgpu::Queue) {
        self.statistics.passes.clear();
        let frame = || PassTimer::new(allocator, queue, &[]);
        let timer = match self.measured {
            Measured::Nothing => None,
            Measured::Frame => frame(),
            Measured::Passes => PassTimer::new(allocator, queue, self.timed_passes()).or_else(frame),
        };
        self.timing = timer.map(|timer| {
            let size = timer.resolved().size();
            (timer, Readback::new(allocator, "gs4d timestamp readback", size))
        });
    }

    /// Makes tile bins leave out the colors of splats, for clients that read depths alone. Transmittance and depths do not change;
    /// colors are undefined. The global sort computes colors together with the splats, and still does.
    pub fn without_colors(self) -> Self {
        Self { has_colors: false, ..self }
    }

    /// Returns the design with which the view is drawn: never [`Design::Auto`]. Frames that tile bins cannot draw are drawn with
    /// [`Design::GlobalSort`]: if the design is [`Design::Auto`], frames of more than 2²⁴ splats; on software drivers, frames of too many splats
    /// in a bin.
    pub fn design(&self) -> Design {
        self.design.design()
    }

    /// Returns counts and times of the view.
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

    /// Returns the resources of the frame recorded last; `None` before the first [`prepare`](Self::prepare), and in [`Design::TileBins`], which
    /// has other buffers.
    pub fn finished(&self) -> Option<FinishedFrame<'_>> {
        let made = self.resources.as_ref()?;
        let design: &dyn Any = &*self.design;
        let sort = design.downcast_ref::<GlobalSort>()?.buffers.as_ref()?;
        Some(FinishedFrame {
            frame: &self.frame,
            instances: &made.instances,
            counters: &sort.counters,
            buffers: &sort.buffers,
            color: &made.color_view,
            depth: &made.depth_view,
            slots: made.sizes.slots,
            pairs: made.sizes.pairs,
        })
    }

    /// Makes the next [`prepare`](Self::prepare) increase the capacities of pairs and bins to 1.5 times these counters if they exceed three
    /// quarters of the capacities, within the limits of the device. `frame` is what they count.
    pub(super) fn make_room_for(&mut self, counters: &Counters, frame: CountedFrame) {
        // Counts from before the release of the buffers are ignored.
        let Some(made) = &self.resources else { return };
        // The buffers grow before they are full, since counts arrive some frames late.
        let pairs = self.design.pair_count(counters);
        if pairs > made.sizes.pairs / 4 * 3 {
            self.pairs_wanted = pairs.saturating_add(pairs / 2);
        }
        self.design.note(counters, frame);
    }

    /// Makes room as [`make_room_for`](Self::make_room_for), after the frame prepared last.
    pub(crate) fn make_room(&mut self, counters: &Counters) {
        self.make_room_for(counters, self.design.counted(self.at_most));
    }

    /// Makes the first [`prepare`](Self::prepare) allocate the capacities of another view, or the larger capacities that the other view's next
    /// `prepare` allocates.
    pub(crate) fn make_room_of(&mut self, other: &Self) {
        self.pairs_wanted = other.pairs_wanted.max(other.pair_capacity());
        self.design = other.design.another();
    }

    /// Returns the capacity in pairs.
    pub(crate) fn pair_capacity(&self) -> u32 {
        self.resources.as_ref().map_or(0, |made| made.sizes.pairs)
    }

    /// Returns whether the newest frame whose counters have arrived had more pairs, or splats in its bins, than the limits of this device
    /// allow. Such frames are complete, but permanently slow. Frames that only exceed the current capacity, which grows, do not count.
    pub fn is_short_of_room(&self) -> bool {
        self.short_of_room
    }

    /// Frees the working buffers and targets; the next [`prepare`](Self::prepare) creates them again.
    pub fn release(&mut self) {
        self.crowded = false;
        self.begin_design(self.design());
    }

    /// Draws with a design from the next frame on: frees the working buffers and targets. Counters of earlier frames are ignored when they
    /// arrive.
    pub(super) fn begin_design(&mut self, design: Design) {
        self.design = begun(design);
        self.generation = self.generation.wrapping_add(1);
        self.resources = None;
        self.motion = None;
        self.pairs_wanted = 0;
        self.short_of_room = false;
        self.statistics = ViewStatistics::default();
    }

    /// Returns the names of the passes that are timed.
    pub(in crate::renderer) fn timed_passes(&self) -> &'static [&'static str] {
        let all = self.design.timed_passes();
        if self.motion.is_some() { all } else { &all[..all.len() - MOTION_PASSES] }
    }
}
