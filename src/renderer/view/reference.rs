//! The passes of the reference design: global sorts by depth and by tile.
//!
//! In: a prepared view. Out: the passes from `project` to `blend`, recorded into the compute pass of the frame.

use super::dispatch::mark;
use super::parameters::Instance;
use super::resources::{Resources, tile_steps};
use super::view_renderer::ViewRenderer;
use crate::renderer::layout::{BLOCK, DEPTH_STEPS, DIGITS, INSTANCE_STRIDE};
use crate::renderer::passes::ReferencePasses;
use crate::renderer::pipelines::Renderer;
use crate::renderer::timing::PassTimer;
use crate::view::tiles;

impl ViewRenderer {
    /// Records the passes of the reference design.
    pub(super) fn record_reference(
        &self,
        renderer: &Renderer,
        made: &Resources,
        pass: &mut wgpu::ComputePass<'_>,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        // project
        let (Some(passes), Some(blend)) =
            (renderer.passes.reference(), renderer.passes.blend(self.pixels, self.at_once))
        else {
            return;
        };
        let pipeline = |storage, batched| renderer.passes.project(storage, batched);
        self.project(pipeline, renderer, &made.project, |_, count| count.div_ceil(256), pass, instances);
        mark(timer, pass);

        // sort by depth: the first step drops the invisible splats and counts the visible splats; the later steps are sized
        // by this count.
        for step in 0..DEPTH_STEPS {
            let group = &made.sort_depth[if step == 0 { 0 } else { 2 - (step as usize % 2) }];
            let blocks = (step == 0).then(|| self.slots.div_ceil(BLOCK));
            self.sort_step(passes, pass, group, step, blocks, 0, Some(&made.arguments));
        }
        mark(timer, pass);

        // bin
        pass.set_bind_group(0, &made.bin, &[]);
        pass.set_pipeline(&passes.bin_count);
        pass.dispatch_workgroups_indirect(&self.arguments, 0);
        pass.set_pipeline(&passes.bin_scan);
        pass.set_bind_group(1, &made.arguments, &[]);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(&passes.bin_offset);
        pass.dispatch_workgroups_indirect(&self.arguments, 0);
        pass.set_pipeline(&passes.bin_emit);
        pass.dispatch_workgroups_indirect(&self.arguments, 12);
        mark(timer, pass);

        // sort by tile
        for step in 0..tile_steps(made.sizes.picture) {
            let group = &made.sort_tiles[step as usize % 2];
            self.sort_step(passes, pass, group, DEPTH_STEPS + step, None, 12, None);
        }
        mark(timer, pass);

        // ranges
        let tiles = tiles(self.picture);
        pass.set_pipeline(&passes.ranges);
        pass.set_bind_group(0, &made.ranges, &[]);
        pass.dispatch_workgroups((tiles.x * tiles.y).div_ceil(256), 1, 1);
        mark(timer, pass);

        // blend
        pass.set_pipeline(blend);
        pass.set_bind_group(0, &made.pixel, &[]);
        pass.set_bind_group(1, &made.blend, &[]);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        mark(timer, pass);
    }

    /// Records one step of `sort`. `blocks` is the number of workgroups; if it is unknown on the host, the dispatch is
    /// indirect, at `offset` of the arguments.
    fn sort_step(
        &self,
        passes: &ReferencePasses,
        pass: &mut wgpu::ComputePass<'_>,
        group: &wgpu::BindGroup,
        step: u32,
        blocks: Option<u32>,
        offset: u64,
        arguments: Option<&wgpu::BindGroup>,
    ) {
        let dispatch = |pass: &mut wgpu::ComputePass<'_>| match blocks {
            Some(blocks) => pass.dispatch_workgroups(blocks, 1, 1),
            None => pass.dispatch_workgroups_indirect(&self.arguments, offset),
        };
        pass.set_bind_group(0, group, &[step * INSTANCE_STRIDE]);
        pass.set_pipeline(&passes.sort_count);
        dispatch(pass);
        pass.set_pipeline(&passes.sort_scan);
        pass.dispatch_workgroups(DIGITS, 1, 1);
        if let (0, Some(arguments)) = (step, arguments) {
            pass.set_pipeline(&passes.sort_visible);
            pass.set_bind_group(1, arguments, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        pass.set_pipeline(&passes.sort_scatter);
        dispatch(pass);
    }
}
