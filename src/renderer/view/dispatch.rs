//! Dispatches of both designs over the parts of instances.
//!
//! In: a prepared view, its instances and a pipeline. Out: one dispatch for each part of each instance; timestamps between passes.

use super::parameters::Instance;
use super::view_renderer::ViewRenderer;
use crate::renderer::active::drawn_count;
use crate::renderer::layout::{INSTANCE_STRIDE, INSTANCES_AT_ONCE};
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Storage;
use crate::renderer::timing::PassTimer;

impl ViewRenderer {
    /// Records one dispatch of `project`, `project_bin` or `colors` for each part of each instance, or for several consecutive instances of
    /// the same Gaussians. `groups` returns the number of workgroups for a storage and a number of Gaussians; `pipeline` returns the pipeline
    /// for a storage and one or (`true`) several instances.
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
            // Consecutive instances of the same Gaussians in one dispatch: wgpu inserts a barrier between two dispatches.
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
                    // Instances that are drawn together have one part.
                    index += count;
                }
            }
        }
    }
}

/// Marks the end of a pass, if the frame is timed.
pub(super) fn mark(timer: Option<&PassTimer>, pass: &mut wgpu::ComputePass<'_>) {
    if let Some(timer) = timer {
        timer.mark(pass);
    }
}
