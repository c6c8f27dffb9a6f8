//! The passes of training from pictures alone: `dropout`, `noise` and `relocate`.
//!
//! In: the parameters that are trained. Out: [`Grower`]: commands that hide Gaussians, move means at random, and relocate Gaussians.

use super::dropout::below;
use super::optimized::ADAM_GROUPS;
use super::parameters::{ParameterBuffers, TrainedPart};
use super::relocation::relocate;
use crate::offline::layout::{DropoutUniforms, NoiseUniforms, RelocationUniforms, TrainedRecord};
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::memory::binding_limit;
use crate::renderer::{GpuContext, GpuError, Headless, ShaderChecks};
use wgpu::BufferUsages;

/// Most bytes of colors that are gathered before they are scattered, and most as a share of a binding.
const MOVED_BYTES: u64 = 1 << 26;
const OF_BINDING: u64 = 4;

/// The passes `dropout`, `noise` and `relocate`.
#[derive(Debug)]
pub(super) struct Grower {
    dropout: wgpu::ComputePipeline,
    noise: wgpu::ComputePipeline,
    noise_settings: wgpu::Buffer,
    noise_group: wgpu::BindGroup,
    gather: wgpu::ComputePipeline,
    scatter: wgpu::ComputePipeline,
    moves: wgpu::Buffer,
    /// Moves whose colors are gathered at once.
    at_once: usize,
    parts: Vec<GrowingPart>,
}

/// Bindings of the passes for a part of the Gaussians.
#[derive(Debug)]
struct GrowingPart {
    dropout_settings: wgpu::Buffer,
    dropout_group: wgpu::BindGroup,
    relocation_settings: wgpu::Buffer,
    relocation_group: wgpu::BindGroup,
}

impl Grower {
    /// Compiles the passes.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn new(headless: &Headless, parameters: &ParameterBuffers) -> Result<Self, GpuError> {
        use Bind::{Read, Uniform, Write};
        let (allocator, device) = (headless.allocator(), &headless.context().device);
        let geometry = &parameters.geometry;
        let sizes = [size_of::<DropoutUniforms>(), size_of::<NoiseUniforms>(), size_of::<RelocationUniforms>()];
        let [of_dropout, of_noise, of_relocation] = sizes;
        let uniform = |label, size: usize| allocator.buffer(label, size as u64, BufferUsages::UNIFORM);
        let hiding = group_layout(device, "gs4d dropout", &[Uniform(of_dropout), Write]);
        let shader = SHADERS.module(device, "dropout", &[], ShaderChecks::Off)?;
        let dropout = pipeline(device, &shader, "dropout", &[Some(&hiding)]);
        let layout = group_layout(device, "gs4d noise", &[Uniform(of_noise), Write]);
        let shader = SHADERS.module(device, "noise", &[], ShaderChecks::Off)?;
        let noise = pipeline(device, &shader, "noise", &[Some(&layout)]);
        let noise_settings = uniform("gs4d noise settings", of_noise);
        let buffers = [&noise_settings, &geometry.values].map(wgpu::Buffer::as_entire_binding);
        let noise_group = allocator.bind_group("gs4d noise", &layout, &buffers);
        let bindings = [Uniform(of_relocation), Read, Write, Write, Write, Write, Write, Write];
        let moving = group_layout(device, "gs4d relocation", &bindings);
        let shader = SHADERS.module(device, "relocate", &[], ShaderChecks::Off)?;
        let [gather, scatter] = ["gather", "scatter"].map(|entry| pipeline(device, &shader, entry, &[Some(&moving)]));
        let each = 16 * u64::from(parameters.stride());
        let room = MOVED_BYTES.min(binding_limit(&device.limits()) / OF_BINDING);
        let at_once = (room / each).min(parameters.count().into()).max(1);
        let moves = allocator.buffer("gs4d moves", at_once * 8, BufferUsages::STORAGE);
        let moved = allocator.buffer("gs4d moved colors", at_once * each, BufferUsages::STORAGE);
        let part = |part: &TrainedPart| {
            let dropout_settings = uniform("gs4d dropout settings", of_dropout);
            let buffers = [&dropout_settings, &part.gaussians].map(wgpu::Buffer::as_entire_binding);
            let dropout_group = allocator.bind_group("gs4d dropout", &hiding, &buffers);
            let relocation_settings = uniform("gs4d relocation settings", of_relocation);
            let ([_, of_geometry @ ..], of_colors) = (geometry.stored(), part.color.stored());
            let buffers = [&[&relocation_settings, &moves, &moved][..], &of_colors, &of_geometry].concat();
            let resources: Vec<_> = buffers.into_iter().map(wgpu::Buffer::as_entire_binding).collect();
            let relocation_group = allocator.bind_group("gs4d relocation", &moving, &resources);
            GrowingPart { dropout_settings, dropout_group, relocation_settings, relocation_group }
        };
        let parts = parameters.parts.iter().map(part).collect();
        let at_once = at_once as usize;
        Ok(Self { dropout, noise, noise_settings, noise_group, gather, scatter, moves, at_once, parts })
    }

    /// Records that a share of the Gaussians is hidden until they are sliced again.
    pub(super) fn record_dropout(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        parameters: &ParameterBuffers,
        seed: u32,
        share: f64,
    ) {
        pass.set_pipeline(&self.dropout);
        for (part, own) in parameters.parts.iter().zip(&self.parts) {
            let settings = DropoutUniforms { count: part.count(), seed, below: below(share), first: part.first() };
            queue.write_buffer(&own.dropout_settings, 0, bytemuck::bytes_of(&settings));
            pass.set_bind_group(0, &own.dropout_group, &[]);
            pass.dispatch_workgroups(part.count().div_ceil(256), 1, 1);
        }
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
        let context = headless.context();
        context.queue.write_buffer(&parameters.geometry.values, 0, bytemuck::cast_slice(records));
        // No move leads to where another begins: those gathered later are still as they were.
        moves.chunks(self.at_once).for_each(|moves| self.copy(context, parameters, moves, keeps));
    }

    /// Copies colors by at most as many moves as are gathered at once, and sets moments to 0.
    fn copy(&self, context: &GpuContext, parameters: &ParameterBuffers, moves: &[[u32; 2]], keeps: bool) {
        let queue = &context.queue;
        queue.write_buffer(&self.moves, 0, bytemuck::cast_slice(moves));
        let (count, stride, keeps) = (moves.len() as u32, parameters.stride(), u32::from(keeps));
        for (part, own) in parameters.parts.iter().zip(&self.parts) {
            let (first, gaussians) = (part.first(), part.count());
            let settings = RelocationUniforms { moves: count, stride, keeps, first, count: gaussians };
            queue.write_buffer(&own.relocation_settings, 0, bytemuck::bytes_of(&settings));
        }
        let label = wgpu::CommandEncoderDescriptor { label: Some("gs4d relocation") };
        let mut encoder = context.device.create_command_encoder(&label);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let threads = count * stride.max(parameters.geometry.stride);
            for pipeline in [&self.gather, &self.scatter] {
                pass.set_pipeline(pipeline);
                for own in &self.parts {
                    pass.set_bind_group(0, &own.relocation_group, &[]);
                    pass.dispatch_workgroups(threads.div_ceil(256).min(ADAM_GROUPS), 1, 1);
                }
            }
        }
        queue.submit([encoder.finish()]);
    }
}
