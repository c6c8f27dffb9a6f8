//! Random motion of faint Gaussians after each step.
//!
//! In: the raw parameters, the strength of the noise. Out: [`Noise`]: commands of the pass `noise`. The rule is in its
//! [CPU reference](crate::offline::train::reference::noise).

use super::part::Part;
use super::request::Request;
use crate::gaussian::Model;
use crate::offline::engine::layout::NoiseUniforms;
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::densification::Growth;
use crate::offline::train::gpu::Workspace;
use crate::offline::train::schedule::{Step, noise_seed};
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, ShaderChecks};
use wgpu::BufferUsages;

/// The shader of the pass `noise`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("noise", include_str!("../../../../shaders/offline/noise.wgsl"))], LIBRARIES);

/// The pass `noise`.
#[derive(Debug)]
pub(super) struct Noise {
    growth: Growth,
    seed: u64,
    pass: wgpu::ComputePipeline,
    settings: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Noise {
    /// Makes the part in training from pictures alone.
    ///
    /// # Errors
    /// Gaussians of another model than the native one: noise moves each along its four axes.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        let Some(growth) = request.settings.growth else { return Ok(None) };
        if work.scene.model() != Some(Model::Rotated4d) {
            return Err(TrainerError::Model);
        }
        Ok(Some(Box::new(Self::new(work, growth, request.settings.seed)?)))
    }

    fn new(work: &Workspace<'_>, growth: Growth, seed: u64) -> Result<Self, GpuError> {
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let size = size_of::<NoiseUniforms>();
        let layout = group_layout(device, "gs4d noise", &[Bind::Uniform(size), Bind::Write]);
        let shader = SHADERS.module(device, "noise", &[], ShaderChecks::Off)?;
        let settings = allocator.buffer("gs4d noise settings", size as u64, BufferUsages::UNIFORM);
        let buffers = [&settings, &work.parameters.geometry.values].map(wgpu::Buffer::as_entire_binding);
        let group = allocator.bind_group("gs4d noise", &layout, &buffers);
        let pass = pipeline(device, &shader, "noise", &[Some(&layout)]);
        Ok(Self { growth, seed, pass, settings, group })
    }
}

impl Part for Noise {
    fn record_step(&self, work: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>, step: &Step) {
        if !step.grows {
            return;
        }
        let (count, trained_with) = (work.parameters.count(), &work.scene.trained_with);
        let (unit, scale) = (trained_with.unit_length(), trained_with.spatial_lr_scale);
        // The noise falls with the rate of means, as in 3DGS-MCMC: Langevin dynamics have noise in proportion to the
        // step. Times a variance the strength is the deviation, a length, as the rate alone is.
        let strength = (self.growth.noise * step.rates.mean * scale * step.factor / (unit * unit)) as f32;
        let least = self.growth.least_time_scale * f64::from(trained_with.time_span());
        let least_log_scale_t = least.max(f64::from(f32::MIN_POSITIVE)).ln() as f32;
        let seed = noise_seed(self.seed, step.index);
        let settings = NoiseUniforms { count, seed, strength, least_log_scale_t };
        work.queue().write_buffer(&self.settings, 0, bytemuck::bytes_of(&settings));
        pass.set_pipeline(&self.pass);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(count.div_ceil(256), 1, 1);
    }
}
