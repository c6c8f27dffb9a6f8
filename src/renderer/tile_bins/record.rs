//! The passes of tile bins, from `find_surfaces` to `blend_blocks`.
//!
//! In: a prepared view. Out: the passes, recorded into the compute pass of the frame.
//!
//! `sort_bins` and `colors` do not depend on each other and run at the same time, if each frame has its own encoder: wgpu inserts a barrier
//! between two passes of an encoder for each buffer that the second pass writes and an earlier pass used. Therefore the counters of even and
//! odd frames are in separate buffers, and so are splats and their colors. The bins are sorted first, since `sort_bins` occupies few threads
//! for a long time: `colors` uses the remaining threads.

use super::bins::per_thread;
use super::buffers::BinBuffers;
use super::state::BinState;
use crate::renderer::layout::BIN_COUNTERS;
use crate::renderer::recording::Recording;
use crate::renderer::shaders::Storage;
use crate::view::tiles;
use glam::UVec2;

/// Returns the number of splats per workgroup of `colors`, four threads per splat: `SPLATS` of the shader.
fn colors_of_group(storage: Storage) -> u32 {
    match storage {
        Storage::Coded => 32,
        Storage::Sliced | Storage::Packed => 64,
    }
}

/// The largest number of workgroups of `colors` and of `fill_bins`, which loop over the visible splats: enough to occupy any GPU.
const MOST_GROUPS: u32 = 8192;
/// The number of workgroups of `colors` where few splats were visible in an earlier frame. A workgroup that finds no splat takes time, too.
const LEAST_GROUPS: u32 = 1024;

impl BinBuffers {
    /// Clears what the passes of earlier frames have not cleared, before the compute pass of a frame with so many slots.
    pub(in crate::renderer) fn clear(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        state: &BinState,
        picture: UVec2,
        slots: u32,
    ) {
        if state.cleared != state.count(picture) {
            // The previous frame has cleared only its own number of bins.
            for bins in &self.bins {
                encoder.clear_buffer(bins, 0, None);
            }
        }
        if slots == 0 {
            // No workgroup of `project_bin` runs, which clears the last two counters for the next frame.
            let first = u64::from(BIN_COUNTERS - 2) * 4;
            encoder.clear_buffer(&self.bins[state.parity()], first, Some(8));
        }
        let shared = &self.claim.buffers;
        if shared.begins_round(state.frame) {
            encoder.clear_buffer(&shared.visible, 0, None);
        }
    }

    /// Records the passes of a frame of so many slots. `has_colors`: whether colors of splats are computed.
    pub(in crate::renderer) fn record(
        &self,
        frame: &Recording<'_>,
        pass: &mut wgpu::ComputePass<'_>,
        state: &BinState,
        slots: u32,
        has_colors: bool,
    ) {
        let passes = &frame.renderer.passes.tile_bins;
        let parity = state.parity();
        // find_surfaces
        if state.variant.blending.leaves_out_hidden() {
            let Some(find_surfaces) = passes.find_surfaces(state.variant) else { return };
            let blocks = tiles(frame.picture).map(|tiles| tiles.div_ceil(2));
            frame.dispatch_blocks(pass, find_surfaces, &self.find_surfaces[parity], blocks);
        }

        // project_bin
        let pipeline = |storage, batched| passes.project_bin(storage, batched, state.variant);
        let groups = |_, count: u32| count.div_ceil(256 * per_thread(count));
        frame.dispatch_parts(pass, pipeline, &self.project_bin[parity], groups);

        // place_bins, fill_bins
        if state.variant.counted {
            let Some([place_bins, fill_bins]) = passes.counted() else { return };
            pass.set_bind_group(0, &self.fill_bins[parity], &[]);
            pass.set_pipeline(place_bins);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_pipeline(fill_bins);
            pass.dispatch_workgroups(slots.div_ceil(256).min(MOST_GROUPS), 1, 1);
        }
        frame.mark(pass);

        // sort_bins
        let (Some(sort_bins), Some(blend_blocks)) =
            (passes.sort_bins(state.variant), passes.blend_blocks(state.variant))
        else {
            return;
        };
        let bins = state.grid(frame.picture);
        pass.set_pipeline(sort_bins);
        pass.set_bind_group(0, &self.sort_bins[parity], &[]);
        pass.dispatch_workgroups(bins.x, bins.y, 1);
        frame.mark(pass);

        // colors
        if has_colors {
            let pipeline = |storage, batched| passes.colors(storage, batched);
            let groups = |storage, count: u32| {
                let most = state.visible.div_ceil(colors_of_group(storage)).clamp(LEAST_GROUPS, MOST_GROUPS);
                count.div_ceil(colors_of_group(storage)).min(most)
            };
            frame.dispatch_parts(pass, pipeline, &self.colors[parity], groups);
        }
        frame.mark(pass);

        // blend_blocks
        frame.dispatch_tiles(pass, blend_blocks, &self.blend_blocks);
        frame.mark(pass);
    }
}
