//! The frame: one compute pass, recorded in the order of the table in [`crate::renderer`].
//!
//! In: a prepared view and the instances it was prepared for. Out: commands.

use super::resources::{Resources, tile_steps};
use super::{Instance, ViewRenderer};
use crate::renderer::active::drawn_count;
use crate::renderer::layout::{BLOCK, DEPTH_STEPS, DIGITS, INSTANCE_STRIDE, INSTANCES_AT_ONCE};
use crate::renderer::pipelines::{ReferencePasses, Renderer};
use crate::renderer::shaders::Storage;
use crate::renderer::timing::PassTimer;
use crate::view::tiles;

impl ViewRenderer {
    /// Records the frame: one compute pass, in the order of the table in [`crate::renderer`].
    pub fn record(&mut self, renderer: &Renderer, encoder: &mut wgpu::CommandEncoder, instances: &[Instance<'_>]) {
        let timing = self.timing.take();
        let timer = timing.as_ref().filter(|(_, readback)| readback.is_idle()).map(|(timer, _)| timer);
        self.record_timed(renderer, encoder, instances, timer);
        self.timing = timing.map(|(timer, mut readback)| {
            if readback.is_idle() {
                timer.resolve(encoder);
                readback.copy(encoder, timer.resolved(), 0);
            }
            (timer, readback)
        });
    }

    /// Records the frame, with timestamps if a timer is given.
    pub(in crate::renderer) fn record_timed(
        &mut self,
        renderer: &Renderer,
        encoder: &mut wgpu::CommandEncoder,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        let Some(made) = &self.resources else { return };
        let fast = made.fast.as_ref();
        if let Some(fast) = fast.filter(|_| self.cleared_bins != self.bin_count()) {
            // The frame before has only cleared as many as it had.
            for bins in &fast.bins {
                encoder.clear_buffer(bins, 0, None);
            }
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("gs4d"),
            timestamp_writes: timer.and_then(PassTimer::frame_writes),
        });
        match fast {
            Some(fast) => self.record_fast(renderer, made, fast, &mut pass, instances, timer),
            None => self.record_reference(renderer, made, &mut pass, instances, timer),
        }
        self.record_motion(renderer, made, &mut pass, instances, timer);
        drop(pass);
        let (counters, offset) = self.counters();
        let counters = counters.clone();
        self.readback.copy(encoder, &counters, offset);
        self.cleared_bins = self.bin_count();
        self.recorded = true;
    }

    /// Records the passes of the reference design.
    fn record_reference(
        &self,
        renderer: &Renderer,
        made: &Resources,
        pass: &mut wgpu::ComputePass<'_>,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        // project
        let (Some(passes), Some(blend)) = (renderer.reference(), renderer.blend(self.pixels)) else { return };
        let pipeline = |storage, batched| renderer.project(storage, batched);
        self.project(pipeline, renderer, &made.project, |_, count| count.div_ceil(256), pass, instances);
        mark(timer, pass);

        // sort by depth: the first step drops the invisible splats and counts the others; the later steps are sized
        // by that count.
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

    /// Records one dispatch of `project`, `project_bin` or `colors` for each part of each instance, or for several instances of the same
    /// Gaussians; `groups` returns the number of workgroups for a number of Gaussians in a storage, and `pipeline` that for one instance or,
    /// if `true`, for several.
    pub(super) fn project<'a>(
        &self,
        pipeline: impl Fn(Storage, bool) -> Option<&'a wgpu::ComputePipeline>,
        renderer: &Renderer,
        group: &wgpu::BindGroup,
        groups: impl Fn(Storage, u32) -> u32,
        pass: &mut wgpu::ComputePass<'_>,
        instances: &[Instance<'_>],
    ) {
        let mut index = 0;
        for joined in instances.chunk_by(Instance::joins) {
            // Neighbors of the same Gaussians: wgpu waits between two dispatches.
            for batch in joined.chunks(INSTANCES_AT_ONCE as usize) {
                let (instance, count) = (&batch[0], batch.len() as u32);
                let Some(pipeline) = pipeline(instance.capture.storage, joined.len() > 1) else { continue };
                pass.set_pipeline(pipeline);
                pass.set_bind_group(2, instance.active.map_or(&renderer.no_list, |active| &active.list), &[]);
                for (at, part) in instance.capture.parts.iter().enumerate() {
                    pass.set_bind_group(0, group, &[index * INSTANCE_STRIDE]);
                    pass.set_bind_group(1, &part.geometry, &[]);
                    pass.set_bind_group(3, &part.color, &[]);
                    let gaussians = drawn_count(instance.capture, at, instance.active);
                    pass.dispatch_workgroups(groups(instance.capture.storage, gaussians), 1, count);
                    // Those that are drawn together have one part.
                    index += count;
                }
            }
        }
    }

    /// Records one step of `sort`. `blocks` is the number of workgroups if the host knows it; otherwise the dispatch is
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

/// Marks the end of a pass, if the frame is timed.
pub(super) fn mark(timer: Option<&PassTimer>, pass: &mut wgpu::ComputePass<'_>) {
    if let Some(timer) = timer {
        timer.mark(pass);
    }
}
