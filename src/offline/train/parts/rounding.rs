//! Geometry as a package will hold it, in training.
//!
//! In: the parameters that are trained, the bits of their geometry. Out: [`RoundedGeometry`]: records that are drawn as
//! if they had been packed and read again. Gradients pass straight through to the parameters, which are not rounded:
//! small steps add up until a parameter is rounded to another value.

use super::part::Part;
use super::request::{Request, RoundingSettings};
use crate::gaussian::{Parameters, SliceSettings};
use crate::offline::compress::roundings;
use crate::offline::engine::layout::{RoundingRecord, TrainedScene};
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::gpu::records::set_parameters;
use crate::offline::train::gpu::{ParameterChunk, Quantity, Workspace};
use crate::offline::train::schedule::Step;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, ShaderChecks};
use crate::scene::packed::Rounding;
use crate::scene::{Bits, SceneForm, Trained, TrainedWith};
use wgpu::BufferUsages;

/// The shader of the pass `rounding`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("rounding", include_str!("../../../../shaders/offline/rounding.wgsl"))], LIBRARIES);

/// Steps between two roundings, at least and at most. The CPU encodes all Gaussians, which takes as long as some steps.
const LEAST_STEPS: usize = 50;
const MOST_STEPS: usize = 250;
/// Gaussians for each step more than the least: the time of a step grows less with their number than that of encoding
/// them.
const GAUSSIANS_OF_STEP: usize = 1024;

/// Returns the number of steps between two roundings of this many Gaussians.
pub(crate) fn steps_between(gaussians: usize) -> usize {
    (LEAST_STEPS + gaussians / GAUSSIANS_OF_STEP).min(MOST_STEPS)
}

/// The pass `rounding`.
#[derive(Debug)]
pub(super) struct RoundedGeometry {
    settings: RoundingSettings,
    pass: wgpu::ComputePipeline,
    /// For each chunk of the Gaussians.
    groups: Vec<wgpu::BindGroup>,
    /// What rounding changes of each Gaussian.
    changes: wgpu::Buffer,
}

impl RoundedGeometry {
    /// Makes the part if geometry is rounded, and rounds it.
    ///
    /// # Errors
    /// Gaussians that the packed form cannot hold, a shader that does not compile, a lost device.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        let Some(settings) = request.rounding else { return Ok(None) };
        let made = Self::new(work, settings)?;
        made.round(work)?;
        Ok(Some(Box::new(made)))
    }

    /// Compiles the pass, which changes the sliced Gaussians and lifespans of a capture in place.
    fn new(work: &Workspace<'_>, settings: RoundingSettings) -> Result<Self, GpuError> {
        use Bind::{Read, Uniform, Write};
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let bindings = [Uniform(size_of::<TrainedScene>()), Read, Write, Write];
        let layout = group_layout(device, "gs4d rounding", &bindings);
        let shader = SHADERS.module(device, "rounding", &[], ShaderChecks::Off)?;
        // As large as the raw parameters, which fit one binding.
        let size = (work.parameters.count() as usize * size_of::<RoundingRecord>()) as u64;
        let changes = allocator.buffer("gs4d rounding", size, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let group = |chunk: &ParameterChunk| {
            let [settings, gaussians, lifespans] =
                [&chunk.scene_settings, &chunk.gaussians, &chunk.lifespans].map(wgpu::Buffer::as_entire_binding);
            let own = chunk.window(&changes, size_of::<RoundingRecord>());
            allocator.bind_group("gs4d rounding", &layout, &[settings, own, gaussians, lifespans])
        };
        let groups = work.parameters.chunks.iter().map(group).collect();
        let pass = pipeline(device, &shader, "rounding", &[Some(&layout)]);
        Ok(Self { settings, pass, groups, changes })
    }

    /// Packs the Gaussians as they are, and draws them from now on with what that changes of each: now as the package
    /// would be drawn, after further steps as far from the parameters as now.
    fn round(&self, work: &Workspace<'_>) -> Result<(), TrainerError> {
        let SceneForm::Trained(Trained { parameters, .. }) = &work.scene.form else {
            return Err(TrainerError::NotTrained);
        };
        let mut parameters = parameters.clone();
        set_parameters(&mut parameters, &work.parameters.read_records(work.headless, Quantity::Values)?);
        let changes = changes(&parameters, &work.scene.trained_with, &self.settings.bits)?;
        work.queue().write_buffer(&self.changes, 0, bytemuck::cast_slice(&changes));
        work.slice(|pass| self.record_slice(work, pass));
        Ok(())
    }
}

impl Part for RoundedGeometry {
    /// Rounds geometry again if that is due. When it is depends on the number of the step alone, and a state has the
    /// result of the last rounding: a resumed run draws the same pictures.
    fn before_views(&mut self, work: &Workspace<'_>, step: &Step) -> Result<(), TrainerError> {
        let RoundingSettings { first, every, .. } = self.settings;
        let is_due = step.index > first && (step.index - first).is_multiple_of(every);
        if is_due { self.round(work) } else { Ok(()) }
    }

    fn record_slice(&self, work: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(&self.pass);
        for (chunk, group) in work.parameters.chunks.iter().zip(&self.groups) {
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(chunk.count().div_ceil(256), 1, 1);
        }
    }

    fn buffer(&self) -> Option<&wgpu::Buffer> {
        Some(&self.changes)
    }
}

/// Returns the differences that packing by the rules of compression makes to each Gaussian of these raw parameters.
///
/// # Errors
/// Gaussians that the packed form cannot hold.
fn changes(
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
