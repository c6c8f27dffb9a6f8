//! The tile bins of one view.
//!
//! In: frames that are prepared and recorded, counters of earlier frames. Out: [`TileBins`]: the state of the bins, the variants of the passes,
//! the buffers.

use super::bins::{MAX_SLOTS, bin_side, counts_first, equal_rooms, few_bins, first_guess, large_batches, per_thread};
use super::buffers::BinBuffers;
use super::loops;
use super::scratch::ScratchBuffers;
use super::state::BinState;
use super::variant::{BinVariant, Lists};
use crate::renderer::device::GpuError;
use crate::renderer::frame::{Blending, CountedFrame, Design, Preparation, Recording, Sizes, ViewDesign};
use crate::renderer::layout::{BIN_COUNTERS, Counters};
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Storage;
use glam::UVec2;
use std::iter;
use wgpu::{BindGroup, BindingResource, ComputePass};

/// The largest number of workgroups of `motion`, which loop over the visible splats: enough to occupy any GPU.
const MOST_GROUPS: u32 = 4096;

/// The tile bins of a view.
#[derive(Debug, Default)]
pub(in crate::renderer) struct TileBins {
    pub state: BinState,
    pub buffers: Option<BinBuffers>,
}

impl ViewDesign for TileBins {
    fn design(&self) -> Design {
        Design::TileBins
    }

    fn timed_passes(&self) -> &'static [&'static str] {
        &["project_bin", "sort_bins", "colors", "blend_blocks", "motion", "blend_blocks (motion)"]
    }

    fn most_slots(&self) -> u32 {
        MAX_SLOTS
    }

    fn another(&self) -> Box<dyn ViewDesign> {
        let entries = self.buffers.as_ref().map_or(0, |buffers| buffers.sizes.entries);
        Box::new(Self { state: self.state.another(entries), buffers: None })
    }

    fn choose(&mut self, frame: &Preparation<'_>, sizes: &mut [Sizes; 2]) -> Result<(), GpuError> {
        let Preparation { renderer, device, instances, gaussians, blending, .. } = *frame;
        let [Sizes { picture, pairs, .. }, _] = *sizes;
        let (limits, side) = (device.limits(), bin_side(picture, gaussians));
        // An entry has twice as many bytes as a pair.
        let most = frame.most_pairs / 2;
        let equal_rooms = equal_rooms(pairs).min(most);
        let guess = |picture| first_guess(picture, side, frame.at_most as u32);
        let wanted = BinVariant {
            few_bins: few_bins(picture, side, gaussians),
            counted: counts_first(frame.at_most, self.state.is_known(frame.at_most))
                || self.state.must_count(guess(picture), equal_rooms),
            lists: Lists::suiting(&limits, self.state.fullest),
            blending,
            precision: frame.pixels.precision,
            large_batches: large_batches(&limits, instances),
        };
        let variant = renderer.bin_variant(device, frame.drawn(), wanted)?;
        (self.state.variant, self.state.side, self.state.picture) = (variant, side, picture);
        for sizes in sizes {
            sizes.entries = self.state.entries(guess(sizes.picture), equal_rooms, pairs).min(most);
            sizes.ordered = if variant.counted { sizes.entries } else { 0 };
            sizes.depths = if blending.writes_depths() { sizes.picture } else { UVec2::ONE };
        }
        Ok(())
    }

    fn create(&mut self, frame: &Preparation<'_>, sizes: Sizes, uniforms: [BindingResource<'_>; 2]) {
        self.buffers = None;
        self.buffers = Some(BinBuffers::new(frame, sizes, uniforms));
        (self.state.odd, self.state.recorded) = (false, false);
    }

    fn shares_current(&self, renderer: &Renderer) -> bool {
        self.buffers.as_ref().is_some_and(|buffers| renderer.scratch.is_current(&buffers.claim))
    }

    fn bytes(&self) -> [u64; 2] {
        self.buffers.as_ref().map_or([0; 2], |buffers| [buffers.bytes, buffers.claim.buffers.bytes])
    }

    fn begin(&mut self) {
        let odd = self.state.odd != std::mem::take(&mut self.state.recorded);
        let frame = self.buffers.as_ref().map_or(0, |buffers| buffers.claim.buffers.next_frame());
        (self.state.odd, self.state.frame) = (odd, frame);
    }

    fn of_part(&self, part: u32, count: u32) -> (u32, [u32; 4]) {
        let binning = self.buffers.as_ref().map_or([0; 4], |buffers| self.state.uniform(&buffers.sizes, part));
        (per_thread(count), binning)
    }

    fn compile_motion(&mut self, frame: &Preparation<'_>, blending: Blending) -> Result<(), GpuError> {
        frame.renderer.passes.bin_motion.compile(frame.device, frame.drawn())?;
        let wanted = BinVariant { blending, ..self.state.variant };
        self.state.motion = frame.renderer.bin_variant(frame.device, iter::empty(), wanted)?;
        Ok(())
    }

    fn motion_groups(&self, frame: &Preparation<'_>, uniforms: &[BindingResource<'_>; 2]) -> Option<[BindGroup; 2]> {
        let BinBuffers { bins, claim, .. } = self.buffers.as_ref()?;
        let ScratchBuffers { splats, visible, splat_colors, .. } = &*claim.buffers;
        Some(bins.each_ref().map(|bins| {
            let own = [bins, visible, splats, splat_colors].map(wgpu::Buffer::as_entire_binding);
            let layout = &frame.renderer.layouts.tile_bins.motion;
            frame.allocator().bind_group("gs4d motion", layout, &[&uniforms[..], &own].concat())
        }))
    }

    fn clear(&self, encoder: &mut wgpu::CommandEncoder, slots: u32) {
        let Some(BinBuffers { bins, claim, .. }) = &self.buffers else { return };
        if self.state.cleared != self.state.count() {
            // The previous frame has cleared only its own number of bins.
            bins.iter().for_each(|bins| encoder.clear_buffer(bins, 0, None));
        }
        if slots == 0 {
            // No workgroup of `project_bin` runs, which clears the last two counters for the next frame.
            let first = u64::from(BIN_COUNTERS - 2) * 4;
            encoder.clear_buffer(&bins[self.state.parity()], first, Some(8));
        }
        if claim.buffers.begins_round(self.state.frame) {
            encoder.clear_buffer(&claim.buffers.visible, 0, None);
        }
    }

    fn record(&mut self, frame: &Recording<'_>, pass: &mut ComputePass<'_>) -> Option<()> {
        (self.state.cleared, self.state.recorded) = (self.state.count(), true);
        self.buffers.as_ref()?.record(frame, pass, &self.state)
    }

    fn record_motion(&self, frame: &Recording<'_>, groups: &[BindGroup; 2], pass: &mut ComputePass<'_>) -> Option<()> {
        let (passes, lists) = (&frame.renderer.passes, &self.buffers.as_ref()?.blend_blocks);
        let blend_blocks = passes.tile_bins.blend_blocks(self.state.motion)?;
        frame.dispatch_motion(pass, &passes.bin_motion, &groups[self.state.parity()], MOST_GROUPS);
        frame.dispatch_tiles(pass, blend_blocks, lists, 1);
        frame.mark(pass);
        Some(())
    }

    fn counters(&self) -> Option<(&wgpu::Buffer, u64)> {
        let first = u64::from(BIN_COUNTERS) * 4 - size_of::<Counters>() as u64;
        // `sort_bins` writes them into the buffer of the next frame's counters.
        self.buffers.as_ref().map(|buffers| (&buffers.bins[1 - self.state.parity()], first))
    }

    fn pair_count(&self, counters: &Counters) -> u32 {
        counters.pairs
    }

    fn counted(&self, at_most: usize) -> CountedFrame {
        let counted = |buffers: &BinBuffers| self.state.counted(&buffers.sizes, at_most);
        self.buffers.as_ref().map(counted).unwrap_or_default()
    }

    fn note(&mut self, counters: &Counters, frame: CountedFrame) {
        self.state.note(counters, frame);
    }

    fn entries_needed(&self) -> u32 {
        self.state.needed
    }

    fn is_complete(&self, slots: u32, counters: &Counters) -> bool {
        let Some(buffers) = &self.buffers else { return true };
        let searches = self.state.lacks_room(&buffers.sizes, counters);
        loops::is_complete(slots, counters.pairs_wanted, searches, self.state.variant.lists)
    }
}

impl Renderer {
    /// Returns a variant of the passes of tile bins that is compiled: `wanted`, or while that is compiled in the background, another one
    /// that draws the same picture. If there is none, `wanted` is compiled here.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub(in crate::renderer) fn bin_variant(
        &self,
        device: &wgpu::Device,
        drawn: impl Iterator<Item = (Storage, bool)> + Clone,
        wanted: BinVariant,
    ) -> Result<BinVariant, GpuError> {
        let is_compiled = |variant: &BinVariant| self.passes.tile_bins.has(drawn.clone(), *variant);
        if is_compiled(&wanted) {
            return Ok(wanted);
        }
        if let Some(compiling) = &self.compiling
            && let Some(substitute) = wanted.substitutes().find(is_compiled)
        {
            compiling.begin(&self.passes, device, drawn.collect(), wanted);
            return Ok(substitute);
        }
        self.passes.tile_bins.compile(device, drawn, wanted)?;
        Ok(wanted)
    }
}
