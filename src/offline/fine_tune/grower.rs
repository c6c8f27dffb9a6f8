//! The passes of training from pictures alone: `dropout`, `noise` and `relocate`.
//!
//! In: the parameters that are trained. Out: [`Grower`]: commands that hide Gaussians, move means at random, and relocate Gaussians.

use super::dropout::below;
use super::optimized::ADAM_GROUPS;
use super::parameters::ParameterBuffers;
use super::relocation::relocate;
use crate::offline::layout::{DropoutUniforms, NoiseUniforms, RelocationUniforms, TrainedRecord};
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::{GpuError, Headless, ShaderChecks};
use wgpu::BufferUsages;

/// The passes `dropout`, `noise` and `relocate`.
#[derive(Debug)]
pub(super) struct Grower {
    dropout: wgpu::ComputePipeline,
    dropout_settings: wgpu::Buffer,
    dropout_group: wgpu::BindGroup,
    noise: wgpu::ComputePipeline,
    noise_settings: wgpu::Buffer,
    noise_group: wgpu::BindGroup,
    relocate: wgpu::ComputePipeline,
    moves: wgpu::Buffer,
    relocation_settings: wgpu::Buffer,
    relocation_group: wgpu::BindGroup,
}

impl Grower {
    /// Compiles the passes. `gaussians` are the records that `slice` writes.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn new(
        headless: &Headless,
        parameters: &ParameterBuffers,
        gaussians: &wgpu::Buffer,
    ) -> Result<Self, GpuError> {
        use Bind::{Read, Uniform, Write};
        let (allocator, device) = (headless.allocator(), &headless.context().device);
        let ParameterBuffers { geometry, color, .. } = parameters;
        let sizes = [size_of::<NoiseUniforms>(), size_of::<RelocationUniforms>()];
        let size = size_of::<DropoutUniforms>();
        let layout = group_layout(device, "gs4d dropout", &[Uniform(size), Write]);
        let shader = SHADERS.module(device, "dropout", &[], ShaderChecks::Off)?;
        let dropout = pipeline(device, &shader, "dropout", &[Some(&layout)]);
        let dropout_settings = allocator.buffer("gs4d dropout settings", size as u64, BufferUsages::UNIFORM);
        let buffers = [&dropout_settings, gaussians].map(wgpu::Buffer::as_entire_binding);
        let dropout_group = allocator.bind_group("gs4d dropout", &layout, &buffers);
        let layout = group_layout(device, "gs4d noise", &[Uniform(sizes[0]), Write]);
        let shader = SHADERS.module(device, "noise", &[], ShaderChecks::Off)?;
        let noise = pipeline(device, &shader, "noise", &[Some(&layout)]);
        let noise_settings = allocator.buffer("gs4d noise settings", sizes[0] as u64, BufferUsages::UNIFORM);
        let buffers = [&noise_settings, &geometry.values].map(wgpu::Buffer::as_entire_binding);
        let noise_group = allocator.bind_group("gs4d noise", &layout, &buffers);
        let bindings = [Uniform(sizes[1]), Read, Write, Write, Write, Write, Write];
        let layout = group_layout(device, "gs4d relocation", &bindings);
        let shader = SHADERS.module(device, "relocate", &[], ShaderChecks::Off)?;
        let relocate = pipeline(device, &shader, "relocate", &[Some(&layout)]);
        let relocation_settings = allocator.buffer("gs4d relocation settings", sizes[1] as u64, BufferUsages::UNIFORM);
        let moves = allocator.buffer("gs4d moves", u64::from(parameters.count()) * 8, BufferUsages::STORAGE);
        let ([_, of_geometry @ ..], [colors, of_colors @ ..]) = (geometry.stored(), color.stored());
        let written = [colors, of_colors[0], of_colors[1], of_geometry[0], of_geometry[1]];
        let buffers = [&[&relocation_settings, &moves][..], &written].concat();
        let resources: Vec<_> = buffers.into_iter().map(wgpu::Buffer::as_entire_binding).collect();
        let relocation_group = allocator.bind_group("gs4d relocation", &layout, &resources);
        Ok(Self {
            dropout,
            dropout_settings,
            dropout_group,
            noise,
            noise_settings,
            noise_group,
            relocate,
            moves,
            relocation_settings,
            relocation_group,
        })
    }

    /// Records that a share of the Gaussians is hidden until they are sliced again.
    pub(super) fn record_dropout(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        count: u32,
        seed: u32,
        share: f64,
    ) {
        let settings = DropoutUniforms { count, seed, below: below(share), padding: 0 };
        queue.write_buffer(&self.dropout_settings, 0, bytemuck::bytes_of(&settings));
        pass.set_pipeline(&self.dropout);
        pass.set_bind_group(0, &self.dropout_group, &[]);
        pass.dispatch_workgroups(count.div_ceil(256), 1, 1);
    }

    /// Records the noise of a step.
    pub(super) fn record_noise(&self, queue: &wgpu::Queue, pass: &mut wgpu::ComputePass<'_>, settings: NoiseUniforms) {
        let count = settings.count;
        queue.write_buffer(&self.noise_settings, 0, bytemuck::bytes_of(&settings));
        pass.set_pipeline(&self.noise);
        pass.set_bind_group(0, &self.noise_group, &[]);
        pass.dispatch_workgroups(count.div_ceil(256), 1, 1);
    }

    /// Relocates the Gaussians that have faded, by random numbers of this seed. Returns their number.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn relocate(
        &self,
        headless: &Headless,
        parameters: &ParameterBuffers,
        seed: u64,
    ) -> Result<usize, GpuError> {
        let values = parameters.geometry.read_values(headless)?;
        let mut records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&values);
        let moves = relocate(&mut records, seed);
        self.apply(headless, parameters, &records, &moves, false);
        Ok(moves.len())
    }

    /// Replaces the raw parameters, copies colors by these moves, and sets moments to 0: of where moves lead to, and of where they begin unless
    /// `keeps`.
    pub(super) fn apply(
        &self,
        headless: &Headless,
        parameters: &ParameterBuffers,
        records: &[TrainedRecord],
        moves: &[[u32; 2]],
        keeps: bool,
    ) {
        if moves.is_empty() {
            return;
        }
        let ParameterBuffers { geometry, color, .. } = parameters;
        let context = headless.context();
        let (count, stride) = (moves.len() as u32, color.stride);
        let settings = RelocationUniforms { moves: count, stride, keeps: keeps.into(), padding: 0 };
        context.queue.write_buffer(&geometry.values, 0, bytemuck::cast_slice(records));
        context.queue.write_buffer(&self.moves, 0, bytemuck::cast_slice(moves));
        context.queue.write_buffer(&self.relocation_settings, 0, bytemuck::bytes_of(&settings));
        let label = wgpu::CommandEncoderDescriptor { label: Some("gs4d relocation") };
        let mut encoder = context.device.create_command_encoder(&label);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let threads = settings.moves * color.stride.max(geometry.stride);
            pass.set_pipeline(&self.relocate);
            pass.set_bind_group(0, &self.relocation_group, &[]);
            pass.dispatch_workgroups(threads.div_ceil(256).min(ADAM_GROUPS), 1, 1);
        }
        context.queue.submit([encoder.finish()]);
    }
}
