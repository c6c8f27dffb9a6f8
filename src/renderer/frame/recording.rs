//! What the passes of both designs have in common while a frame is recorded.
//!
//! In: a prepared view and its instances. Out: dispatches over the parts of instances and over tiles, and timestamps between passes.

use crate::renderer::frame::Instance;
use crate::renderer::layout::{INSTANCE_STRIDE, INSTANCES_AT_ONCE};
use crate::renderer::passes::MotionPass;
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Storage;
use crate::renderer::timing::PassTimer;
use crate::view::tiles;
use glam::UVec2;

/// A frame that is recorded.
#[derive(Debug, Clone, Copy)]
pub(in crate::renderer) struct Recording<'a> {
    pub renderer: &'a Renderer,
    pub instances: &'a [Instance<'a>],
    /// Size of the picture, and number of slots.
    pub picture: UVec2,
    pub slots: u32,
    /// Whether colors of splats are computed.
    pub has_colors: bool,
    /// Uniforms, background, opaque depth and targets of the pixels.
    pub pixel: &'a wgpu::BindGroup,
    /// Timestamps, if the frame is timed.
    pub timer: Option<&'a PassTimer>,
}

impl Recording<'_> {
    /// Marks the end of a pass, if the frame is timed.
    pub(in crate::renderer) fn mark(&self, pass: &mut wgpu::ComputePass<'_>) {
        if let Some(timer) = self.timer {
            timer.mark(pass);
        }
    }

    /// Records one dispatch of `project`, `project_bin` or `colors` for each part of each instance, or for several consecutive instances
    /// that [join](Instance::joins). `groups` returns the number of workgroups of an instance for a storage, a number of Gaussians
    /// and the number of instances of the dispatch; `pipeline` returns the pipeline
    /// for a storage and one or (`true`) several instances.
    pub(in crate::renderer) fn dispatch_parts<'a>(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        pipeline: impl Fn(Storage, bool) -> Option<&'a wgpu::ComputePipeline>,
        group: &wgpu::BindGroup,
        groups: impl Fn(Storage, u32, u32) -> u32,
    ) {
        let mut index = 0;
        for joined in self.instances.chunk_by(Instance::joins) {
            // Consecutive instances of one capture in one dispatch: wgpu inserts a barrier between two dispatches.
            for batch in joined.chunks(INSTANCES_AT_ONCE as usize) {
                let (instance, count) = (&batch[0], batch.len() as u32);
                let Some(pipeline) = pipeline(instance.capture.storage, joined.len() > 1) else { continue };
                pass.set_pipeline(pipeline);
                pass.set_bind_group(2, self.renderer.list(instance.active), &[]);
                for (at, part) in instance.capture.parts.iter().enumerate() {
                    pass.set_bind_group(0, group, &[index * INSTANCE_STRIDE]);
                    pass.set_bind_group(1, &part.geometry, &[]);
                    pass.set_bind_group(3, &part.color, &[]);
                    // More Gaussians may need fewer workgroups: each thread then has several.
                    let own = batch.iter().map(|instance| groups(instance.capture.storage, instance.drawn(at), count));
                    pass.dispatch_workgroups(own.max().unwrap_or_default(), 1, count);
                    // Instances that are drawn together have one part.
                    index += count;
                }
            }
        }
    }

    /// Records `motion`: at most `most` workgroups for each part.
    pub(in crate::renderer) fn dispatch_motion(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        motion: &MotionPass,
        group: &wgpu::BindGroup,
        most: u32,
    ) {
        let mut index = 0;
        for instance in self.instances {
            let Some(pipeline) = motion.pipeline(instance.capture.storage) else { continue };
            pass.set_pipeline(pipeline);
            pass.set_bind_group(2, self.renderer.list(instance.active), &[]);
            for (at, part) in instance.capture.parts.iter().enumerate() {
                let offset = index * INSTANCE_STRIDE;
                pass.set_bind_group(0, group, &[offset, offset]);
                pass.set_bind_group(1, &part.geometry, &[]);
                let count = instance.drawn(at);
                // 256 Gaussians per workgroup.
                pass.dispatch_workgroups(count.div_ceil(256).min(most), 1, 1);
                index += 1;
            }
        }
        self.mark(pass);
    }

    /// Records a pass over pixels: a workgroup for each square of `side` x `side` tiles. `lists` are the pass's own buffers.
    pub(in crate::renderer) fn dispatch_tiles(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        pipeline: &wgpu::ComputePipeline,
        lists: &wgpu::BindGroup,
        side: u32,
    ) {
        let groups = tiles(self.picture).map(|tiles| tiles.div_ceil(side));
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, self.pixel, &[]);
        pass.set_bind_group(1, lists, &[]);
        pass.dispatch_workgroups(groups.x, groups.y, 1);
    }
}
