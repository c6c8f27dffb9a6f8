//! The environment map that is trained behind a scene.
//!
//! In: the map of a capture, the gradients of the pixels of finished frames. Out: [`TrainedEnvironment`]: commands of the passes `scatter` and
//! `gather` of `environment_backward`, of `adam`, and of the copy into the map that is drawn.

use super::optimized::Optimized;
use super::passes::Passes;
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::layout::FrameUniforms;
use crate::renderer::{FinishedFrame, GpuError, Headless, ShaderChecks};
use glam::UVec2;
use wgpu::BufferUsages;

/// Most workgroups of `gather`.
const GROUPS: u32 = 4096;

/// An environment map that is trained.
#[derive(Debug)]
pub(super) struct TrainedEnvironment {
    /// The values of the map in four-vectors, the last of which may have unused values.
    pub values: Optimized,
    /// The map that is drawn.
    map: wgpu::Buffer,
    /// The gradients of the batch so far, whole numbers.
    sums: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    scatter: wgpu::ComputePipeline,
    gather: wgpu::ComputePipeline,
}

impl TrainedEnvironment {
    /// Compiles the passes. `map` holds these texels.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn new(
        headless: &Headless,
        passes: &Passes,
        map: &wgpu::Buffer,
        texels: &[f32],
    ) -> Result<Self, GpuError> {
        let (allocator, context) = (headless.allocator(), headless.context());
        let bindings = [Bind::Uniform(size_of::<FrameUniforms>()), Bind::Texture, Bind::Read, Bind::Write, Bind::Write];
        let layout = group_layout(&context.device, "gs4d environment backward", &bindings);
        let shader = SHADERS.module(&context.device, "environment_backward", &[], ShaderChecks::Off)?;
        let [scatter, gather] =
            ["scatter", "gather"].map(|entry| pipeline(&context.device, &shader, entry, &[Some(&layout)]));
        let vectors = texels.len().div_ceil(4);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let own = allocator.buffer("gs4d trained environment", 16 * vectors as u64, usage);
        context.queue.write_buffer(&own, 0, bytemuck::cast_slice(texels));
        let sums = allocator.buffer("gs4d sums of the environment", 4 * texels.len() as u64, BufferUsages::STORAGE);
        let values = Optimized::new(headless, passes, own, vectors as u32, 1);
        Ok(Self { values, map: map.clone(), sums, layout, scatter, gather })
    }

    /// Records that the gradients of the pixels of the frame that was recorded last are added to the sums.
    pub(super) fn record_scatter(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        headless: &Headless,
        pixel_gradients: &wgpu::Buffer,
        size: UVec2,
    ) {
        let Some(frame) = headless.finished() else { return };
        let group = self.group(headless, &frame, pixel_gradients);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &group, &[]);
        pass.set_pipeline(&self.scatter);
        pass.dispatch_workgroups(size.x.div_ceil(16), size.y.div_ceil(16), 1);
        // The sums are added to the gradients after each view, so that they hold the gradients of one view only.
        pass.set_pipeline(&self.gather);
        pass.dispatch_workgroups(self.values.count.div_ceil(64).min(GROUPS), 1, 1);
    }

    fn group(&self, headless: &Headless, frame: &FinishedFrame<'_>, pixel_gradients: &wgpu::Buffer) -> wgpu::BindGroup {
        let whole = wgpu::Buffer::as_entire_binding;
        let color = wgpu::BindingResource::TextureView(frame.color);
        let resources =
            [whole(frame.frame), color, whole(pixel_gradients), whole(&self.sums), whole(&self.values.gradients)];
        headless.allocator().bind_group("gs4d environment backward", &self.layout, &resources)
    }

    /// Records step number `step`, counted from 1, at this rate.
    pub(super) fn record_step(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        passes: &Passes,
        rate: f32,
        step: usize,
    ) {
        self.values.record_step(queue, pass, passes, [[rate; 4]; 5], step, None);
    }

    /// Records that the map which is drawn gets the values.
    pub(super) fn record_show(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(&self.values.values, 0, &self.map, 0, self.sums.size());
    }

    /// Returns the values of the map.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn texels(&self, headless: &Headless) -> Result<Vec<f32>, GpuError> {
        Ok(self.without_unused(&self.values.read_values(headless)?))
    }

    /// Returns the gradients with respect to the values of the map.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn gradients(&self, headless: &Headless) -> Result<Vec<f32>, GpuError> {
        Ok(self.without_unused(&self.values.read_gradients(headless)?))
    }

    fn without_unused(&self, bytes: &[u8]) -> Vec<f32> {
        bytemuck::pod_collect_to_vec(&bytes[..self.sums.size() as usize])
    }
}
