//! Geometry as a package will hold it, in training.
//!
//! In: the parameters that are trained, the bits of their geometry. Out: records that are drawn as if they had been packed and read again.
//! Gradients pass straight through to the parameters, which stay as they are: these move on until they are rounded to something else.

use super::records::set_parameters;
use super::trainer::{Trainer, TrainerError};
use crate::gaussian::SliceSettings;
use crate::offline::quantize::roundings;
use crate::renderer::ShaderChecks;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::layout::{RoundingRecord, TrainedRecord, TrainedScene};
use crate::renderer::shaders::module;
use crate::scene::packed::Rounding;
use crate::scene::packed::encode::Bits;
use crate::scene::{SceneForm, Trained};
use wgpu::BufferUsages;

/// Steps between two roundings, at least and at most. The CPU encodes all Gaussians, which takes as long as some steps.
const LEAST_STEPS: usize = 50;
const MOST_STEPS: usize = 250;
/// Gaussians for each step more than the least: the time of a step grows less with their number than that of encoding them.
const GAUSSIANS_OF_STEP: usize = 1024;

/// Returns the number of steps between two roundings of this many Gaussians.
pub(super) fn steps_between(gaussians: usize) -> usize {
    (LEAST_STEPS + gaussians / GAUSSIANS_OF_STEP).min(MOST_STEPS)
}

/// The pass `rounding`.
#[derive(Debug)]
pub(super) struct Rounder {
    rounding: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// What rounding changes of each Gaussian.
    pub changes: wgpu::Buffer,
}

impl Rounder {
    /// Records that so many workgroups of 256 Gaussians, which have been sliced, are rounded.
    pub fn record(&self, pass: &mut wgpu::ComputePass<'_>, groups: u32) {
        pass.set_pipeline(&self.rounding);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(groups, 1, 1);
    }
}

impl Trainer<'_> {
    /// Packs the Gaussians as they are, by the rules of compression, and draws them from now on with what that changes of each: now as the
    /// package would be drawn, after further steps as far from the parameters as now. Parameters and their gradients are not rounded; terms
    /// of the loss that depend on Gaussians alone see them rounded too.
    ///
    /// # Errors
    /// Gaussians that the packed form cannot hold, a shader that does not compile, a lost device.
    pub fn round(&mut self, bits: &Bits) -> Result<(), TrainerError> {
        let SceneForm::Trained(Trained { parameters, .. }) = &self.scene.form else {
            return Err(TrainerError::NotTrained);
        };
        let mut parameters = parameters.clone();
        let trained: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&self.read(&self.geometry.values)?);
        set_parameters(&mut parameters, &trained);
        let prefilter_var = self.scene.trained_with.prefilter_var;
        let sliced = parameters.slice(&SliceSettings { prefilter_var, ..SliceSettings::default() })?;
        let roundings = roundings(&sliced, bits, self.scene.trained_with.time_span())?;
        let records: Vec<RoundingRecord> = roundings.iter().map(record).collect();
        let rounder = match self.rounder.take() {
            Some(rounder) => rounder,
            None => self.new_rounder()?,
        };
        self.headless.context().queue.write_buffer(&rounder.changes, 0, bytemuck::cast_slice(&records));
        self.rounder = Some(rounder);
        self.slice();
        Ok(())
    }

    fn new_rounder(&self) -> Result<Rounder, TrainerError> {
        use Bind::{Read, Uniform, Write};
        let Some([gaussians, lifespans, _]) = self.capture.writable() else { return Err(TrainerError::Empty) };
        let (allocator, device) = (self.headless.allocator(), &self.headless.context().device);
        let bindings = [Uniform(size_of::<TrainedScene>()), Read, Write, Write];
        let layout = group_layout(device, "gs4d rounding", &bindings);
        let shader = module(device, "rounding", &[], ShaderChecks::Off)?;
        // As large as the raw parameters, which fit one binding.
        let size = (self.capture.len() * size_of::<RoundingRecord>()) as u64;
        let changes = allocator.buffer("gs4d rounding", size, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let buffers = [&self.scene_settings, &changes, gaussians, lifespans];
        let group = allocator.bind_group("gs4d rounding", &layout, &buffers.map(wgpu::Buffer::as_entire_binding));
        let rounding = pipeline(device, &shader, "rounding", &[Some(&layout)]);
        Ok(Rounder { rounding, group, changes })
    }
}

/// Returns a rounding as the pass reads it.
fn record(rounding: &Rounding) -> RoundingRecord {
    let Rounding { mean, mean_t, velocity, rate, variance, shape, opacity } = *rounding;
    RoundingRecord {
        mean: mean.extend(mean_t).to_array(),
        velocity: velocity.extend(rate).to_array(),
        shape_x: shape.x_axis.extend(variance).to_array(),
        shape_y: shape.y_axis.extend(opacity).to_array(),
        shape_z: shape.z_axis.extend(0.0).to_array(),
    }
}
