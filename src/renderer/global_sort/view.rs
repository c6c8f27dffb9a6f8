//! The global sort of one view.
//!
//! In: frames that are prepared and recorded. Out: [`GlobalSort`]: the variants of its passes, its buffers.

use super::at_once::{AtOnce, at_once};
use super::buffers::SortBuffers;
use super::finished::PassBuffers;
use crate::renderer::device::GpuError;
use crate::renderer::frame::Blending;
use crate::renderer::frame::Design;
use crate::renderer::frame::Recording;
use crate::renderer::frame::{Preparation, Sizes, ViewDesign};
use crate::renderer::layout::Counters;
use crate::renderer::shaders::Pixels;
use wgpu::{BindGroup, BindingResource, ComputePass};

/// The global sort of a view.
#[derive(Debug, Default)]
pub(in crate::renderer) struct GlobalSort {
    /// Number of splats that `blend` blends at once, and the variant of the pixel passes.
    at_once: AtOnce,
    pixels: Pixels,
    pub buffers: Option<SortBuffers>,
}

impl ViewDesign for GlobalSort {
    fn design(&self) -> Design {
        Design::GlobalSort
    }

    fn timed_passes(&self) -> &'static [&'static str] {
        &["project", "sort (depth)", "bin", "sort (tile)", "ranges", "blend", "motion", "blend (motion)"]
    }

    fn another(&self) -> Box<dyn ViewDesign> {
        Box::<Self>::default()
    }

    fn choose(&mut self, frame: &Preparation<'_>, _sizes: &mut [Sizes; 2]) -> Result<(), GpuError> {
        let slots = frame.at_most;
        if frame.renderer.is_software {
            self.at_once = at_once(slots).ok_or(GpuError::TooManySplats { slots })?;
        }
        self.pixels = frame.pixels;
        frame.renderer.passes.global_sort.compile(frame.device, frame.drawn(), self.pixels, self.at_once)
    }

    fn create(&mut self, frame: &Preparation<'_>, sizes: Sizes, uniforms: [BindingResource<'_>; 2]) {
        self.buffers = None;
        self.buffers = Some(SortBuffers::new(frame, sizes, uniforms));
    }

    fn bytes(&self) -> [u64; 2] {
        [self.buffers.as_ref().map_or(0, |buffers| buffers.bytes), 0]
    }

    fn compile_motion(&mut self, frame: &Preparation<'_>, _blending: Blending) -> Result<(), GpuError> {
        frame.renderer.passes.sort_motion.compile(frame.device, frame.drawn())
    }

    fn motion_groups(&self, frame: &Preparation<'_>, uniforms: &[BindingResource<'_>; 2]) -> Option<[BindGroup; 2]> {
        let PassBuffers { depth_keys, splats, .. } = &self.buffers.as_ref()?.buffers;
        let own = [depth_keys, splats].map(wgpu::Buffer::as_entire_binding);
        let layout = &frame.renderer.layouts.global_sort.motion;
        let group = frame.allocator().bind_group("gs4d motion", layout, &[&uniforms[..], &own].concat());
        Some([group.clone(), group])
    }

    fn record(&mut self, frame: &Recording<'_>, pass: &mut ComputePass<'_>) -> Option<()> {
        self.buffers.as_ref()?.record(frame, pass, self.pixels, self.at_once)
    }

    fn record_motion(&self, frame: &Recording<'_>, groups: &[BindGroup; 2], pass: &mut ComputePass<'_>) -> Option<()> {
        let (passes, lists) = (&frame.renderer.passes, &self.buffers.as_ref()?.blend);
        let blend = passes.global_sort.blend(self.pixels, self.at_once)?;
        frame.dispatch_motion(pass, &passes.sort_motion, &groups[0], u32::MAX);
        // It writes the same depths again.
        frame.dispatch_tiles(pass, blend, lists, 1);
        frame.mark(pass);
        Some(())
    }

    fn counters(&self) -> Option<(&wgpu::Buffer, u64)> {
        self.buffers.as_ref().map(|buffers| (&buffers.counters, 0))
    }

    fn pair_count(&self, counters: &Counters) -> u32 {
        counters.pairs_wanted
    }
}
