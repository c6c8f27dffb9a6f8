//! Geometry as a package will hold it, in training.
//!
//! In: the parameters that are trained, the bits of their geometry. Out: records that are drawn as if they had been packed and read again.
//! Gradients pass straight through to the parameters, which stay as they are: these move on until they are rounded to something else.

use super::parameters::{ParameterBuffers, TrainedPart};
use super::trainer_error::TrainerError;
use crate::gaussian::{Parameters, SliceSettings};
use crate::offline::layout::{RoundingRecord, TrainedScene};
use crate::offline::quantize::roundings;
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::{GpuError, Headless, ShaderChecks};
use crate::scene::Bits;
use crate::scene::TrainedWith;
use crate::scene::packed::Rounding;
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
    /// For each part of the Gaussians.
    groups: Vec<wgpu::BindGroup>,
    /// What rounding changes of each Gaussian.
    pub changes: wgpu::Buffer,
}

impl Rounder {
    /// Compiles the pass, which changes the sliced Gaussians and lifespans of a capture in place.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn new(headless: &Headless, parameters: &ParameterBuffers) -> Result<Self, GpuError> {
        use Bind::{Read, Uniform, Write};
        let (allocator, device) = (headless.allocator(), &headless.context().device);
        let bindings = [Uniform(size_of::<TrainedScene>()), Read, Write, Write];
        let layout = group_layout(device, "gs4d rounding", &bindings);
        let shader = SHADERS.module(device, "rounding", &[], ShaderChecks::Off)?;
        // As large as the raw parameters, which fit one binding.
        let size = (parameters.count() as usize * size_of::<RoundingRecord>()) as u64;
        let changes = allocator.buffer("gs4d rounding", size, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let group = |part: &TrainedPart| {
            let [settings, gaussians, lifespans] =
                [&part.scene_settings, &part.gaussians, &part.lifespans].map(wgpu::Buffer::as_entire_binding);
            let own = part.window(&changes, size_of::<RoundingRecord>());
            allocator.bind_group("gs4d rounding", &layout, &[settings, own, gaussians, lifespans])
        };
        let groups = parameters.parts.iter().map(group).collect();
        let rounding = pipeline(device, &shader, "rounding", &[Some(&layout)]);
        Ok(Self { rounding, groups, changes })
    }

    /// Writes the changes of all Gaussians.
    pub(super) fn write(&self, queue: &wgpu::Queue, changes: &[RoundingRecord]) {
        queue.write_buffer(&self.changes, 0, bytemuck::cast_slice(changes));
    }

    /// Records that the Gaussians, which have been sliced, are rounded.
    pub(super) fn record(&self, pass: &mut wgpu::ComputePass<'_>, parameters: &ParameterBuffers) {
        pass.set_pipeline(&self.rounding);
        for (part, group) in parameters.parts.iter().zip(&self.groups) {
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(part.count().div_ceil(256), 1, 1);
        }
    }
}

/// Returns the differences that packing by the rules of compression makes to each Gaussian of these raw parameters.
///
/// # Errors
/// Gaussians that the packed form cannot hold.
pub(super) fn changes(
    parameters: &Parameters,
    trained_with: &TrainedWith,
    bits: &Bits,
) -> Result<Vec<RoundingRecord>, TrainerError> {
    let prefilter_var = trained_with.prefilter_var;
    let sliced = parameters.slice(&SliceSettings { prefilter_var, ..SliceSettings::default() })?;
    Ok(roundings(&sliced, bits, trained_with.time_span())?.iter().map(record).collect())
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
