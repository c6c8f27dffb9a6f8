//! What a view asks of its design.
//!
//! In: frames that are prepared and recorded, counters of earlier frames. Out: [`ViewDesign`], which each design implements in its folder: its
//! state from frame to frame, its buffers, its passes.

use super::design::Design;
use super::parameters::Instance;
use super::recording::Recording;
use super::sizes::Sizes;
use crate::renderer::device::GpuError;
use crate::renderer::device::memory::Allocator;
use crate::renderer::frame::Blending;
use crate::renderer::layout::Counters;
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::{Pixels, Storage};
use std::any::Any;
use std::fmt::Debug;
use wgpu::{BindGroup, BindingResource, ComputePass};

/// A frame that is prepared.
#[derive(Debug, Clone, Copy)]
pub(in crate::renderer) struct Preparation<'a> {
    pub renderer: &'a Renderer,
    pub device: &'a wgpu::Device,
    pub queue: &'a wgpu::Queue,
    pub instances: &'a [Instance<'a>],
    /// What the last pass writes, and the variant of the pixel passes.
    pub blending: Blending,
    pub pixels: Pixels,
    /// The largest number of Gaussians that are drawn at any time, and the number by which the sizes of bins are chosen.
    pub at_most: usize,
    pub gaussians: u32,
    /// The largest number of pairs that the device allows.
    pub most_pairs: u32,
}

impl<'a> Preparation<'a> {
    /// Returns an allocator for resources of the view.
    pub(in crate::renderer) fn allocator(&self) -> Allocator<'a> {
        self.renderer.allocator(self.device)
    }

    /// Returns the storage of the captures of each dispatch, and whether the dispatch draws several instances.
    pub(in crate::renderer) fn drawn(&self) -> impl Iterator<Item = (Storage, bool)> + Clone {
        self.instances.chunk_by(Instance::joins).map(|joined| (joined[0].capture.storage, joined.len() > 1))
    }
}

/// A frame whose counters are read back, which takes some frames: the view may have other bins by then.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::renderer) struct CountedFrame {
    /// The largest number of splats at any time of its captures.
    pub at_most: usize,
    /// The number of its bins.
    pub bins: u32,
    /// The number of entries of all its bins together; 0 if they were counted before they were filled.
    pub entries: u32,
}

/// A design at work for one view: its state from frame to frame, its buffers, if there are any, and its passes.
pub(in crate::renderer) trait ViewDesign: Any + Debug + Send + Sync {
    /// Returns its name, which is not [`Design::Auto`].
    fn design(&self) -> Design;

    /// Returns the names of the timed passes of a frame, in order. The last two are the passes of motions.
    fn timed_passes(&self) -> &'static [&'static str];

    /// Returns the largest number of splats that it can draw.
    fn most_slots(&self) -> u32 {
        u32::MAX
    }

    /// Returns the same design for another view, with as much room.
    fn another(&self) -> Box<dyn ViewDesign>;

    /// Chooses and compiles the variants of the passes of a frame. `sizes` are those that every design needs, for this picture and for the
    /// largest one; the design adds those of its own buffers. Fails if it cannot draw the frame, or a shader does not compile.
    fn choose(&mut self, frame: &Preparation<'_>, sizes: &mut [Sizes; 2]) -> Result<(), GpuError>;

    /// Frees the buffers, and creates buffers of these sizes. `uniforms` are those of the frame and of its instances.
    fn create(&mut self, frame: &Preparation<'_>, sizes: Sizes, uniforms: [BindingResource<'_>; 2]);

    /// Returns whether the buffers that all views share, if it uses any, are those that suit all views.
    fn shares_current(&self, _renderer: &Renderer) -> bool {
        true
    }

    /// Returns the bytes of its own buffers, and of those that all views share.
    fn bytes(&self) -> [u64; 2];

    /// Begins a frame for which variants have been chosen and buffers are there.
    fn begin(&mut self) {}

    /// Returns the uniforms `per_thread` and `binning` of a part with so many Gaussians.
    fn of_part(&self, _part: u32, _count: u32) -> (u32, [u32; 4]) {
        (0, [0; 4])
    }

    /// Chooses and compiles the passes of motions, the last of which writes what `blending` says. Fails if a shader does not compile.
    fn compile_motion(&mut self, frame: &Preparation<'_>, blending: Blending) -> Result<(), GpuError>;

    /// Creates the bind groups of `motion` of even and of odd frames, given its uniforms.
    fn motion_groups(&self, frame: &Preparation<'_>, uniforms: &[BindingResource<'_>; 2]) -> Option<[BindGroup; 2]>;

    /// Clears what the passes of earlier frames have not cleared, before the compute pass of a frame of so many slots.
    fn clear(&self, _encoder: &mut wgpu::CommandEncoder, _slots: u32) {}

    /// Records the passes of a frame; `None` where a pass has not been compiled.
    fn record(&mut self, frame: &Recording<'_>, pass: &mut ComputePass<'_>) -> Option<()>;

    /// Records the passes of motions, given the bind groups of `motion` of even and of odd frames.
    fn record_motion(&self, frame: &Recording<'_>, groups: &[BindGroup; 2], pass: &mut ComputePass<'_>) -> Option<()>;

    /// Returns the buffer of the counters of a frame, and their offset in bytes.
    fn counters(&self) -> Option<(&wgpu::Buffer, u64)>;

    /// Returns the number of pairs of a frame with these counters, written or not.
    fn pair_count(&self, counters: &Counters) -> u32;

    /// Returns what the counters of the frame prepared last count, of captures with at most so many splats at any time.
    fn counted(&self, at_most: usize) -> CountedFrame {
        CountedFrame { at_most, ..CountedFrame::default() }
    }

    /// Processes the counters of an earlier frame.
    fn note(&mut self, _counters: &Counters, _frame: CountedFrame) {}

    /// Returns the number of entries that the bins of an earlier frame needed, with room for as many splats in each as the fullest had.
    fn entries_needed(&self) -> u32 {
        0
    }

    /// Returns whether a software driver draws a frame of so many slots, with these counters, completely.
    fn is_complete(&self, _slots: u32, _counters: &Counters) -> bool {
        true
    }
}
