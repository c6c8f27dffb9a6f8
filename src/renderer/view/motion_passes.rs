//! The passes of motions at the end of a frame.
//!
//! In: a prepared view with motions. Out: two dispatches: `motion` replaces the colors of splats by their motions, `blend` or `blend_blocks`
//! blends them into the target of motions.

use super::resources::{DesignBuffers, Resources};
use super::view_renderer::ViewRenderer;
use crate::renderer::active::drawn_count;
use crate::renderer::layout::INSTANCE_STRIDE;
use crate::renderer::recording::Recording;

/// Gaussians per workgroup of `motion`.
const GROUP: u32 = 256;
/// The largest number of workgroups of `motion` in tile bins, which loop over the visible splats: enough to occupy any GPU.
const MOST_GROUPS: u32 = 4096;

impl ViewRenderer {
    /// Records the passes of motions, after all other passes of the frame, if the frame has motions.
    pub(super) fn record_motion(&self, frame: &Recording<'_>, made: &Resources, pass: &mut wgpu::ComputePass<'_>) {
        let Some(motion) = &self.motion else { return };
        let (renderer, passes) = (frame.renderer, &frame.renderer.passes);
        let (blend, lists, most) = match &made.buffers {
            DesignBuffers::TileBins(bins) => {
                (passes.tile_bins.blend_blocks(motion.variant), &bins.blend_blocks, MOST_GROUPS)
            }
            DesignBuffers::GlobalSort(sort) => {
                (passes.global_sort.blend(self.pixels, self.at_once), &sort.blend, u32::MAX)
            }
        };
        let Some(blend) = blend else { return };
        // motion
        let mut index = 0;
        for instance in frame.instances {
            let Some(pipeline) = passes.motion(instance.capture.storage, self.design) else { continue };
            pass.set_pipeline(pipeline);
            pass.set_bind_group(2, instance.active.map_or(&renderer.no_list, |active| &active.list), &[]);
            for (at, part) in instance.capture.parts.iter().enumerate() {
                let offset = index * INSTANCE_STRIDE;
                pass.set_bind_group(0, &motion.motion[self.bins.parity()], &[offset, offset]);
                pass.set_bind_group(1, &part.geometry, &[]);
                let count = drawn_count(instance.capture, at, instance.active);
                pass.dispatch_workgroups(count.div_ceil(GROUP).min(most), 1, 1);
                index += 1;
            }
        }
        frame.mark(pass);

        // blend or blend_blocks. `blend` writes the same depths again.
        Recording { pixel: &motion.pixel, ..*frame }.dispatch_tiles(pass, blend, lists);
        frame.mark(pass);
    }
}
