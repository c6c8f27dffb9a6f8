//! Views without a random share of the Gaussians.
//!
//! In: the share of each step. Out: [`Dropout`]: commands of the pass `dropout`, which hides Gaussians until they are
//! sliced again. Why that helps is in the [CPU reference](crate::offline::train::reference::dropout).

use super::part::Part;
use super::request::Request;
use crate::offline::engine::layout::DropoutUniforms;
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::densification::Growth;
use crate::offline::train::gpu::Workspace;
use crate::offline::train::reference::dropout::below;
use crate::offline::train::schedule::{Step, dropout_seed};
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, ShaderChecks};
use wgpu::BufferUsages;

/// The shader of the pass `dropout`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("dropout", include_str!("../../../../shaders/offline/dropout.wgsl"))], LIBRARIES);

/// The pass `dropout`.
#[derive(Debug)]
pub(super) struct Dropout {
    growth: Growth,
    seed: u64,
    pass: wgpu::ComputePipeline,
    /// Settings and bindings for each chunk of the Gaussians.
    chunks: Vec<(wgpu::Buffer, wgpu::BindGroup)>,
}

impl Dropout {
    /// Makes the part if Gaussians are hidden in any step.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        match request.settings.growth {
            Some(growth) if growth.dropout > 0.0 => Ok(Some(Box::new(Self::new(work, growth, request.settings.seed)?))),
            _ => Ok(None),
        }
    }

    fn new(work: &Workspace<'_>, growth: Growth, seed: u64) -> Result<Self, GpuError> {
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let size = size_of::<DropoutUniforms>();
        let layout = group_layout(device, "gs4d dropout", &[Bind::Uniform(size), Bind::Write]);
        let shader = SHADERS.module(device, "dropout", &[], ShaderChecks::Off)?;
        let chunks = work.parameters.chunks.iter().map(|chunk| {
            let settings = allocator.buffer("gs4d dropout settings", size as u64, BufferUsages::UNIFORM);
            let buffers = [&settings, &chunk.gaussians].map(wgpu::Buffer::as_entire_binding);
            let group = allocator.bind_group("gs4d dropout", &layout, &buffers);
            (settings, group)
        });
        let chunks = chunks.collect();
        let pass = pipeline(device, &shader, "dropout", &[Some(&layout)]);
        Ok(Self { growth, seed, pass, chunks })
    }
}

impl Part for Dropout {
    fn before_views(&mut self, work: &Workspace<'_>, step: &Step) -> Result<(), TrainerError> {
        let share = if step.grows { self.growth.dropout(step.index) } else { 0.0 };
        if share > 0.0 {
            let (seed, below) = (dropout_seed(self.seed, step.index), below(share));
            work.submit("gs4d dropout", |pass| {
                pass.set_pipeline(&self.pass);
                for (chunk, (settings, group)) in work.parameters.chunks.iter().zip(&self.chunks) {
                    let uniforms = DropoutUniforms { count: chunk.count(), seed, below, first: chunk.first() };
                    work.queue().write_buffer(settings, 0, bytemuck::bytes_of(&uniforms));
                    pass.set_bind_group(0, group, &[]);
                    pass.dispatch_workgroups(chunk.count().div_ceil(256), 1, 1);
                }
            });
        }
        Ok(())
    }
}
