//! The passes of global sort, from `project` to `blend`.
//!
//! In: a prepared view. Out: the passes, recorded into the compute pass of the frame.

use super::at_once::AtOnce;
use super::buffers::SortBuffers;
use super::passes::StepPasses;
use crate::renderer::frame::Recording;
use crate::renderer::layout::{BLOCK, DEPTH_STEPS, DIGITS, INSTANCE_STRIDE};
use crate::renderer::shaders::Pixels;
use crate::view::tiles;

impl SortBuffers {
    /// Records the passes of a frame.
    pub(super) fn record(
        &self,
        frame: &Recording<'_>,
        pass: &mut wgpu::ComputePass<'_>,
        pixels: Pixels,
        at_once: AtOnce,
    ) -> Option<()> {
        // project
        let passes = &frame.renderer.passes.global_sort;
        let (steps, blend) = (passes.steps()?, passes.blend(pixels, at_once)?);
        let pipeline = |storage, batched| passes.project(storage, batched);
        frame.dispatch_parts(pass, pipeline, &self.project, |_, count, _| count.div_ceil(256));
        frame.mark(pass);

        // sort by depth: the first step drops the invisible splats and counts the visible splats; the later steps are sized
        // by this count.
        for step in 0..DEPTH_STEPS {
            let group = &self.sort_depth[if step == 0 { 0 } else { 2 - (step as usize % 2) }];
            let blocks = (step == 0).then(|| frame.slots.div_ceil(BLOCK));
            self.sort_step(steps, pass, group, step, blocks, 0);
        }
        frame.mark(pass);

        self.record_bin(steps, pass);
        frame.mark(pass);

        // sort by tile
        for step in 0..self.tile_steps {
            let group = &self.sort_tiles[step as usize % 2];
            self.sort_step(steps, pass, group, DEPTH_STEPS + step, None, 12);
        }
        frame.mark(pass);

        // ranges
        let tiles = tiles(frame.picture);
        pass.set_pipeline(&steps.ranges);
        pass.set_bind_group(0, &self.ranges, &[]);
        pass.dispatch_workgroups((tiles.x * tiles.y).div_ceil(256), 1, 1);
        frame.mark(pass);

        // blend
        frame.dispatch_tiles(pass, blend, &self.blend, 1);
        frame.mark(pass);
        Some(())
    }

    /// Records `bin`.
    fn record_bin(&self, steps: &StepPasses, pass: &mut wgpu::ComputePass<'_>) {
        let [count, scan, offset, emit] = &steps.bin;
        pass.set_bind_group(0, &self.bin, &[]);
        pass.set_pipeline(count);
        pass.dispatch_workgroups_indirect(&self.arguments, 0);
        pass.set_pipeline(scan);
        pass.set_bind_group(1, &self.write_arguments, &[]);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(offset);
        pass.dispatch_workgroups_indirect(&self.arguments, 0);
        pass.set_pipeline(emit);
        pass.dispatch_workgroups_indirect(&self.arguments, 12);
    }

    /// Records one step of `sort`. `blocks` is the number of workgroups; if it is unknown on the host, the dispatch is
    /// indirect, at `offset` of the arguments.
    fn sort_step(
        &self,
        steps: &StepPasses,
        pass: &mut wgpu::ComputePass<'_>,
        group: &wgpu::BindGroup,
        step: u32,
        blocks: Option<u32>,
        offset: u64,
    ) {
        let dispatch = |pass: &mut wgpu::ComputePass<'_>| match blocks {
            Some(blocks) => pass.dispatch_workgroups(blocks, 1, 1),
            None => pass.dispatch_workgroups_indirect(&self.arguments, offset),
        };
        let [count, scan, visible, scatter] = &steps.sort;
        pass.set_bind_group(0, group, &[step * INSTANCE_STRIDE]);
        pass.set_pipeline(count);
        dispatch(pass);
        pass.set_pipeline(scan);
        pass.dispatch_workgroups(DIGITS, 1, 1);
        if step == 0 {
            pass.set_pipeline(visible);
            pass.set_bind_group(1, &self.write_arguments, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        pass.set_pipeline(scatter);
        dispatch(pass);
    }
}
