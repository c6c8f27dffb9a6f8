//! The passes of tile bins, from `find_surfaces` to `blend_blocks`.
//!
//! In: a prepared view. Out: the passes, recorded into the compute pass of the frame.
//!
//! `sort_bins` and `colors` do not depend on each other and run at the same time, if each frame has its own encoder: wgpu inserts a barrier
//! between two passes of an encoder for each buffer that the second pass writes and an earlier pass used. Therefore the counters of even and
//! odd frames are in separate buffers, and splats and their colors are in two buffers rather than one. The bins are sorted first, since
//! `sort_bins` occupies few threads for a long time: `colors` uses the remaining threads.

use super::bins::per_thread;
use super::buffers::BinBuffers;
use super::state::BinState;
use crate::renderer::frame::Recording;
use crate::renderer::shaders::Storage;

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
/// The same for each of several instances that are drawn by one dispatch: one of them may have most of the splats.
const LEAST_OF_INSTANCE: u32 = 256;

impl BinBuffers {
    /// Records the passes of a frame; `None` where a pass has not been compiled.
    pub(super) fn record(
        &self,
        frame: &Recording<'_>,
        pass: &mut wgpu::ComputePass<'_>,
        state: &BinState,
    ) -> Option<()> {
        self.record_projection(frame, pass, state)?;
        let (passes, parity) = (&frame.renderer.passes.tile_bins, state.parity());
        let (sort_bins, blend_blocks) = (passes.sort_bins(state.variant)?, passes.blend_blocks(state.variant)?);
        // sort_bins
        let bins = state.grid();
        pass.set_pipeline(sort_bins);
        pass.set_bind_group(0, &self.sort_bins[parity], &[]);
        pass.dispatch_workgroups(bins.x, bins.y, 1);
        frame.mark(pass);

        // colors
        if frame.has_colors {
            let pipeline = |storage, batched| passes.colors(storage, batched);
            let groups = |storage, count: u32, instances: u32| {
                let groups = |splats: u32| splats.div_ceil(colors_of_group(storage));
                let most = state.visible.map_or(MOST_GROUPS, |count| groups(count).clamp(LEAST_GROUPS, MOST_GROUPS));
                // Of many instances few have more than twice the mean of visible splats; their workgroups loop for longer.
                groups(count).min((2 * most).div_ceil(instances).max(LEAST_OF_INSTANCE)).min(most)
            };
            frame.dispatch_parts(pass, pipeline, &self.colors[parity], groups);
        }
        frame.mark(pass);

        // blend_blocks
        frame.dispatch_tiles(pass, blend_blocks, &self.blend_blocks, 1);
        frame.mark(pass);
        Some(())
    }

    /// Records the passes that fill the bins: `find_surfaces`, `project_bin`, `place_bins`, `fill_bins`.
    fn record_projection(
        &self,
        frame: &Recording<'_>,
        pass: &mut wgpu::ComputePass<'_>,
        state: &BinState,
    ) -> Option<()> {
        let (passes, parity) = (&frame.renderer.passes.tile_bins, state.parity());
        // find_surfaces
        if state.variant.blending.leaves_out_hidden() {
            frame.dispatch_tiles(pass, passes.find_surfaces(state.variant)?, &self.find_surfaces[parity], 2);
        }

        // project_bin
        let pipeline = |storage, batched| passes.project_bin(storage, batched, state.variant);
        let groups = |_, count: u32, _| count.div_ceil(256 * per_thread(count));
        frame.dispatch_parts(pass, pipeline, &self.project_bin[parity], groups);

        // place_bins, fill_bins
        if state.variant.counted {
            let [place_bins, fill_bins] = passes.counted()?;
            pass.set_bind_group(0, &self.fill_bins[parity], &[]);
            pass.set_pipeline(place_bins);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_pipeline(fill_bins);
            pass.dispatch_workgroups(frame.slots.div_ceil(256).min(MOST_GROUPS), 1, 1);
        }
        frame.mark(pass);
        Some(())
    }
}
