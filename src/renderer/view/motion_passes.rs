//! The passes of motions at the end of a frame.
//!
//! In: a prepared view with motions. Out: two dispatches: `motion` replaces the colors of splats by their motions, `blend` or `blend_blocks`
//! blends them into the target of motions.

use super::dispatch::mark;
use super::parameters::Instance;
use super::resources::Resources;
use super::view_renderer::ViewRenderer;
use crate::renderer::active::drawn_count;
use crate::renderer::layout::INSTANCE_STRIDE;
use crate::renderer::pipelines::Renderer;
use crate::renderer::timing::PassTimer;
use crate::view::tiles;

/// Gaussians per workgroup of `motion`.
const GROUP: u32 = 256;
/// The largest number of workgroups of `motion` in the fast design, which loop over the visible splats: enough to occupy any GPU.
const MOST_GROUPS: u32 = 4096;

impl ViewRenderer {
    /// Records the passes of motions, after all other passes of the frame, if the frame has motions.
    pub(super) fn record_motion(
        &self,
        renderer: &Renderer,
        made: &Resources,
        pass: &mut wgpu::ComputePass<'_>,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        let Some(motion) = &self.motion else { return };
        let (blend, lists) = match &made.fast {
            Some(fast) => (renderer.passes.blend_blocks(motion.variant), &fast.blend_blocks),
            None => (renderer.passes.blend(self.pixels, self.at_once), &made.blend),
        };
        let Some(blend) = blend else { return };
        // motion
        let most = if made.fast.is_some() { MOST_GROUPS } else { u32::MAX };
        let mut index = 0;
        for instance in instances {
            let Some(pipeline) = renderer.passes.motion(instance.capture.storage, self.design) else { continue };
            pass.set_pipeline(pipeline);
            pass.set_bind_group(2, instance.active.map_or(&renderer.no_list, |active| &active.list), &[]);
            for (at, part) in instance.capture.parts.iter().enumerate() {
                let offset = index * INSTANCE_STRIDE;
                pass.set_bind_group(0, &motion.motion[usize::from(self.odd)], &[offset, offset]);
                pass.set_bind_group(1, &part.geometry, &[]);
                let count = drawn_count(instance.capture, at, instance.active);
                pass.dispatch_workgroups(count.div_ceil(GROUP).min(most), 1, 1);
                index += 1;
            }
        }
        mark(timer, pass);

        // blend or blend_blocks. `blend` writes the same depths again.
        let tiles = tiles(self.picture);
        pass.set_pipeline(blend);
        pass.set_bind_group(0, &motion.pixel, &[]);
        pass.set_bind_group(1, lists, &[]);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        mark(timer, pass);
    }
}
