//! The densification of the original on the GPU: the pass `statistics`, and the copies that `relocate` makes.
//!
//! In: the parameters that are trained, the notes of `project_backward`. Out: [`Cloner`]: commands that add up gradients on the screen;
//! Gaussians that are cloned, split and removed by them, and opacities that are reset.

use super::cloning::{Densified, densify, is_free, reset_opacity};
use super::grower::Grower;
use super::parameters::ParameterBuffers;
use crate::offline::layout::TrainedRecord;
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::{GpuError, Headless, ShaderChecks};
use wgpu::BufferUsages;

/// What a densification depends on besides parameters and gradients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloningStep {
    /// Views of each step since the last densification: their losses have this share, and the original's thresholds are of whole losses.
    pub batch: usize,
    /// Whether large Gaussians are removed.
    pub removes_large: bool,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// The pass `statistics`.
#[derive(Debug)]
pub(super) struct Cloner {
    pass: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// For each Gaussian the sum of its mean gradients, and the number of steps that have shown it.
    pub statistics: wgpu::Buffer,
}

impl Cloner {
    /// Compiles the pass.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn new(headless: &Headless, parameters: &ParameterBuffers) -> Result<Self, GpuError> {
        let (allocator, device) = (headless.allocator(), &headless.context().device);
        let layout = group_layout(device, "gs4d statistics", &[Bind::Read, Bind::Write]);
        let shader = SHADERS.module(device, "statistics", &[], ShaderChecks::Off)?;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let statistics = allocator.buffer("gs4d statistics", u64::from(parameters.count()) * 8, usage);
        let buffers = [&parameters.notes, &statistics].map(wgpu::Buffer::as_entire_binding);
        Ok(Self {
            pass: pipeline(device, &shader, "statistics_of_step", &[Some(&layout)]),
            group: allocator.bind_group("gs4d statistics", &layout, &buffers),
            statistics,
        })
    }

    /// Records that the gradients of a step are added.
    pub(super) fn record(&self, pass: &mut wgpu::ComputePass<'_>, count: u32) {
        pass.set_pipeline(&self.pass);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(count.div_ceil(256), 1, 1);
    }

    /// Returns the mean gradient of each Gaussian over the steps that have shown it, of a whole loss.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn gradients(&self, headless: &Headless, batch: usize) -> Result<Vec<f32>, GpuError> {
        let bytes = headless.copy_out(&self.statistics, self.statistics.size())?;
        let statistics: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(statistics.into_iter().map(|[sum, steps]| batch as f32 * sum / steps.max(1.0)).collect())
    }

    /// Removes, clones and splits Gaussians, and begins new statistics. `extent` is that of the cameras.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn densify(
        &self,
        headless: &Headless,
        parameters: &ParameterBuffers,
        grower: &Grower,
        extent: f64,
        step: &CloningStep,
    ) -> Result<Densified, GpuError> {
        let mut records = records(headless, parameters)?;
        let gradients = self.gradients(headless, step.batch)?;
        let densified = densify(&mut records, &gradients, extent, step.removes_large, step.seed);
        grower.apply(headless, parameters, &records, &densified.moves, true);
        let context = headless.context();
        let mut encoder = context.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.statistics, 0, None);
        context.queue.submit([encoder.finish()]);
        Ok(densified)
    }
}

/// Returns the number of Gaussians, without free places.
///
/// # Errors
/// A lost device.
pub(super) fn taken(headless: &Headless, parameters: &ParameterBuffers) -> Result<usize, GpuError> {
    Ok(records(headless, parameters)?.iter().filter(|record| !is_free(record)).count())
}

/// Lowers all opacities, and sets their moments to 0.
///
/// # Errors
/// A lost device.
pub(super) fn reset(headless: &Headless, parameters: &ParameterBuffers) -> Result<(), GpuError> {
    let queue = &headless.context().queue;
    let [values, moments @ ..] = parameters.geometry.stored();
    let mut records = records(headless, parameters)?;
    reset_opacity(&mut records);
    queue.write_buffer(values, 0, bytemuck::cast_slice(&records));
    for buffer in moments {
        let mut moments: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&headless.copy_out(buffer, buffer.size())?);
        moments.iter_mut().for_each(|moments| moments.opacity_logit = [0.0; 4]);
        queue.write_buffer(buffer, 0, bytemuck::cast_slice(&moments));
    }
    Ok(())
}

fn records(headless: &Headless, parameters: &ParameterBuffers) -> Result<Vec<TrainedRecord>, GpuError> {
    Ok(bytemuck::pod_collect_to_vec(&parameters.geometry.read_values(headless)?))
}
