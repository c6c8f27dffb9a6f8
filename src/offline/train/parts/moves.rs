//! Gaussians that take the place of others.
//!
//! In: raw parameters in which some Gaussians are copies of others. Out: [`Moves`]: commands of the pass `relocate`,
//! which copies the colors and begins the moments of the optimizer again.

use crate::offline::engine::layout::{RelocationUniforms, TrainedRecord};
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::gpu::optimized::ADAM_GROUPS;
use crate::offline::train::gpu::{ParameterChunk, Workspace};
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::device::memory::binding_limit;
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, ShaderChecks};
use wgpu::BufferUsages;

/// The shader of the pass `relocate`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("relocate", include_str!("../../../../shaders/offline/relocate.wgsl"))], LIBRARIES);

/// Most bytes of colors that are gathered before they are scattered, and most as a share of a binding.
const MOVED_BYTES: u64 = 1 << 26;
const OF_BINDING: u64 = 4;

/// The pass `relocate`.
#[derive(Debug)]
pub(super) struct Moves {
    gather: wgpu::ComputePipeline,
    scatter: wgpu::ComputePipeline,
    moves: wgpu::Buffer,
    /// Moves whose colors are gathered at once.
    at_once: usize,
    /// Settings and bindings for each chunk of the Gaussians.
    chunks: Vec<(wgpu::Buffer, wgpu::BindGroup)>,
}

impl Moves {
    /// Compiles the pass.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn new(work: &Workspace<'_>) -> Result<Self, GpuError> {
        use Bind::{Read, Uniform, Write};
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let size = size_of::<RelocationUniforms>();
        let bindings = [Uniform(size), Read, Write, Write, Write, Write, Write, Write];
        let layout = group_layout(device, "gs4d relocation", &bindings);
        let shader = SHADERS.module(device, "relocate", &[], ShaderChecks::Off)?;
        let [gather, scatter] = ["gather", "scatter"].map(|entry| pipeline(device, &shader, entry, &[Some(&layout)]));
        let each = 16 * u64::from(work.parameters.stride());
        let room = MOVED_BYTES.min(binding_limit(&device.limits()) / OF_BINDING);
        let at_once = (room / each).min(work.parameters.count().into()).max(1);
        let moves = allocator.buffer("gs4d moves", at_once * 8, BufferUsages::STORAGE);
        let moved = allocator.buffer("gs4d moved colors", at_once * each, BufferUsages::STORAGE);
        let chunk = |chunk: &ParameterChunk| {
            let settings = allocator.buffer("gs4d relocation settings", size as u64, BufferUsages::UNIFORM);
            let ([_, of_geometry @ ..], of_colors) = (work.parameters.geometry.stored(), chunk.color.stored());
            let buffers = [&[&settings, &moves, &moved][..], &of_colors, &of_geometry].concat();
            let resources: Vec<_> = buffers.into_iter().map(wgpu::Buffer::as_entire_binding).collect();
            let group = allocator.bind_group("gs4d relocation", &layout, &resources);
            (settings, group)
        };
        let chunks = work.parameters.chunks.iter().map(chunk).collect();
        Ok(Self { gather, scatter, moves, at_once: at_once as usize, chunks })
    }

    /// Replaces the raw parameters, copies colors by these moves, each where to and where from, and sets moments to 0:
    /// of where moves lead to, and of where they begin unless `keeps`.
    pub(super) fn apply(&self, work: &Workspace<'_>, records: &[TrainedRecord], moves: &[[u32; 2]], keeps: bool) {
        if moves.is_empty() {
            return;
        }
        work.queue().write_buffer(&work.parameters.geometry.values, 0, bytemuck::cast_slice(records));
        // No move leads to where another begins: colors that are gathered later are still as they were.
        moves.chunks(self.at_once).for_each(|moves| self.copy(work, moves, keeps));
    }

    /// Copies colors by at most as many moves as are gathered at once, and sets moments to 0.
    fn copy(&self, work: &Workspace<'_>, moves: &[[u32; 2]], keeps: bool) {
        let (queue, parameters) = (work.queue(), &work.parameters);
        queue.write_buffer(&self.moves, 0, bytemuck::cast_slice(moves));
        let (count, stride, keeps) = (moves.len() as u32, parameters.stride(), u32::from(keeps));
        for (chunk, (settings, _)) in parameters.chunks.iter().zip(&self.chunks) {
            let (first, gaussians) = (chunk.first(), chunk.count());
            let uniforms = RelocationUniforms { moves: count, stride, keeps, first, count: gaussians };
            queue.write_buffer(settings, 0, bytemuck::bytes_of(&uniforms));
        }
        work.submit("gs4d relocation", |pass| {
            let threads = count * stride.max(parameters.geometry.stride);
            for pipeline in [&self.gather, &self.scatter] {
                pass.set_pipeline(pipeline);
                for (_, group) in &self.chunks {
                    pass.set_bind_group(0, group, &[]);
                    pass.dispatch_workgroups(threads.div_ceil(256).min(ADAM_GROUPS), 1, 1);
                }
            }
        });
    }
}
