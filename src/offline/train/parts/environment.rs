//! The environment map that is trained behind a scene.
//!
//! In: the map of a capture, the gradients of the pixels of finished frames. Out: [`TrainedEnvironment`]: commands of
//! the passes `scatter` and `gather` of `environment_backward`, of `adam`, and of the copy into the map that is drawn.

use super::part::Part;
use super::request::Request;
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::gpu::{Optimized, Quantity, RecordedView, Workspace};
use crate::offline::train::schedule::Step;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::layout::FrameUniforms;
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{FinishedFrame, GpuError, ShaderChecks};
use crate::scene::{Environment, GaussianScene};
use crate::view::Background;
use wgpu::BufferUsages;

/// The shader of the pass `environment_backward`.
pub(super) static SHADERS: ShaderSet = ShaderSet::new(
    &[("environment_backward", include_str!("../../../../shaders/offline/environment_backward.wgsl"))],
    LIBRARIES,
);

/// Most workgroups of `gather`.
const GROUPS: u32 = 4096;

/// An environment map that is trained.
#[derive(Debug)]
pub(super) struct TrainedEnvironment {
    /// The values of the map in four-vectors, the last of which may have unused values.
    values: Optimized,
    /// The map that is drawn.
    map: wgpu::Buffer,
    /// The gradients of one view, whole numbers.
    sums: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    scatter: wgpu::ComputePipeline,
    gather: wgpu::ComputePipeline,
}

impl TrainedEnvironment {
    /// Makes the part if the scene has a map.
    pub(super) fn make(work: &Workspace<'_>, _: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        match (&work.scene.environment, work.capture.environment()) {
            (Some(Environment { texels, .. }), Some(map)) => Ok(Some(Box::new(Self::new(work, map, texels)?))),
            _ => Ok(None),
        }
    }

    /// Compiles the passes. `map` holds these texels.
    fn new(work: &Workspace<'_>, map: &wgpu::Buffer, texels: &[f32]) -> Result<Self, GpuError> {
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let bindings = [Bind::Uniform(size_of::<FrameUniforms>()), Bind::Texture, Bind::Read, Bind::Write, Bind::Write];
        let layout = group_layout(device, "gs4d environment backward", &bindings);
        let shader = SHADERS.module(device, "environment_backward", &[], ShaderChecks::Off)?;
        let [scatter, gather] = ["scatter", "gather"].map(|entry| pipeline(device, &shader, entry, &[Some(&layout)]));
        let vectors = texels.len().div_ceil(4);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let own = allocator.buffer("gs4d trained environment", 16 * vectors as u64, usage);
        work.queue().write_buffer(&own, 0, bytemuck::cast_slice(texels));
        let sums = allocator.buffer("gs4d sums of the environment", 4 * texels.len() as u64, BufferUsages::STORAGE);
        let values = Optimized::new(work.headless, &work.passes, own, vectors as u32, 1);
        Ok(Self { values, map: map.clone(), sums, layout, scatter, gather })
    }

    fn group(
        &self,
        work: &Workspace<'_>,
        frame: &FinishedFrame<'_>,
        pixel_gradients: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        let whole = wgpu::Buffer::as_entire_binding;
        let color = wgpu::BindingResource::TextureView(frame.color);
        let resources =
            [whole(frame.frame), color, whole(pixel_gradients), whole(&self.sums), whole(&self.values.gradients)];
        work.headless.allocator().bind_group("gs4d environment backward", &self.layout, &resources)
    }
}

impl Part for TrainedEnvironment {
    /// Records that the gradients of the pixels of the frame are added to those of the map.
    fn record_view(&self, work: &Workspace<'_>, view: &RecordedView<'_>, encoder: &mut wgpu::CommandEncoder) {
        let Some(frame) = work.headless.finished() else { return };
        if view.background != Background::Environment {
            return;
        }
        let group = self.group(work, &frame, &view.buffers.pixel_gradients);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &group, &[]);
        pass.set_pipeline(&self.scatter);
        pass.dispatch_workgroups(view.size.x.div_ceil(16), view.size.y.div_ceil(16), 1);
        // The sums are added to the gradients after each view, so that they hold the gradients of one view only.
        pass.set_pipeline(&self.gather);
        pass.dispatch_workgroups(self.values.count.div_ceil(64).min(GROUPS), 1, 1);
    }

    fn record_step(&self, work: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>, step: &Step) {
        let rate = (step.rates.environment * step.factor) as f32;
        self.values.record_step(work.queue(), pass, &work.passes, [[rate; 4]; 5], step.count, None);
    }

    fn refresh(&self, _: &Workspace<'_>, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(&self.values.values, 0, &self.map, 0, self.sums.size());
    }

    fn optimized(&self) -> Option<&Optimized> {
        Some(&self.values)
    }

    fn write(&self, work: &Workspace<'_>, what: Quantity, scene: &mut GaussianScene) -> Result<(), GpuError> {
        if let Some(map) = &mut scene.environment {
            let bytes = self.values.read(work.headless, what)?;
            map.texels = bytemuck::pod_collect_to_vec(&bytes[..self.sums.size() as usize]);
        }
        Ok(())
    }
}
