//! Gaussians that stand, in training.
//!
//! In: the time interval of the scene, its parameters after a step. Out: [`StandingGaussians`]: commands of the pass
//! `standing`, which brings Gaussians of a long life to rest. The rule is in its [CPU
//! reference](crate::offline::train::reference::standing).

use super::part::Part;
use super::request::Request;
use crate::gaussian::Model;
use crate::offline::engine::layout::{TrainedRecord, TrainedScene};
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::gpu::{ParameterChunk, Workspace};
use crate::offline::train::reference::standing::Standing;
use crate::offline::train::schedule::Step;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, ShaderChecks};
use bytemuck::{Pod, Zeroable};
use wgpu::BufferUsages;

/// The shader of the pass `standing`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("standing", include_str!("../../../../shaders/offline/standing.wgsl"))], LIBRARIES);

/// The times of what stands, and the size of a color, as `standing` reads them.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct StandingUniforms {
    /// Temporal mean of what stands.
    pub middle: f32,
    /// Least temporal scale of a Gaussian that is brought to rest.
    pub least_scale_t: f32,
    /// Logarithm of the temporal scale of what stands.
    pub log_scale_t: f32,
    /// Four-vectors of the color of each Gaussian.
    pub stride: u32,
}

/// The pass `standing`.
#[derive(Debug)]
pub(super) struct StandingGaussians {
    pass: wgpu::ComputePipeline,
    /// For each chunk of the Gaussians.
    groups: Vec<wgpu::BindGroup>,
}

impl StandingGaussians {
    /// Makes the part if it is asked for. Gaussians of other models than the native one are at rest anyway, and a still
    /// has no time in which they could move.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        let is_native = work.scene.model() == Some(Model::Rotated4d);
        match Standing::of(work.scene.trained_with.time_interval) {
            Some(times) if request.settings.standing && is_native => Ok(Some(Box::new(Self::new(work, times)?))),
            _ => Ok(None),
        }
    }

    fn new(work: &Workspace<'_>, times: Standing) -> Result<Self, GpuError> {
        use Bind::{Uniform, Write};
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let sizes = [size_of::<TrainedScene>(), size_of::<StandingUniforms>()];
        let layout = group_layout(device, "gs4d standing", &[Uniform(sizes[0]), Uniform(sizes[1]), Write, Write]);
        let shader = SHADERS.module(device, "standing", &[], ShaderChecks::Off)?;
        let settings = allocator.buffer("gs4d standing settings", sizes[1] as u64, BufferUsages::UNIFORM);
        let Standing { middle, least_scale_t, log_scale_t } = times;
        let uniforms = StandingUniforms { middle, least_scale_t, log_scale_t, stride: work.parameters.stride() };
        work.queue().write_buffer(&settings, 0, bytemuck::bytes_of(&uniforms));
        let group = |chunk: &ParameterChunk| {
            let [scene, settings, colors] =
                [&chunk.scene_settings, &settings, &chunk.color.values].map(wgpu::Buffer::as_entire_binding);
            let records = chunk.window(&work.parameters.geometry.values, size_of::<TrainedRecord>());
            allocator.bind_group("gs4d standing", &layout, &[scene, settings, records, colors])
        };
        let groups = work.parameters.chunks.iter().map(group).collect();
        let pass = pipeline(device, &shader, "standing", &[Some(&layout)]);
        Ok(Self { pass, groups })
    }
}

impl Part for StandingGaussians {
    fn record_step(&self, work: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>, _step: &Step) {
        pass.set_pipeline(&self.pass);
        for (chunk, group) in work.parameters.chunks.iter().zip(&self.groups) {
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(chunk.count().div_ceil(256), 1, 1);
        }
    }
}
