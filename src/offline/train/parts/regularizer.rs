//! The terms of the loss that depend on Gaussians alone, in training.
//!
//! In: weights, the unit of length, the parameters that are trained. Out: [`Regularizer`]: commands of the pass
//! `regularize`, which adds the gradients of the terms to those of the batch. The terms are in the [CPU
//! reference](crate::offline::train::reference::terms).

use super::part::Part;
use super::request::Request;
use crate::offline::engine::layout::{TrainedRecord, TrainedScene};
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::gpu::optimized::across_and_down;
use crate::offline::train::gpu::{Optimized, ParameterChunk, Quantity, Workspace};
use crate::offline::train::reference::neighbors::{NEIGHBORS, neighbors};
use crate::offline::train::reference::terms::{FALLOFF, MOMENT, Terms};
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, Headless, ShaderChecks};
use bytemuck::{Pod, Zeroable};
use wgpu::BufferUsages;

/// The shader of the pass `regularize`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("regularize", include_str!("../../../../shaders/offline/regularize.wgsl"))], LIBRARIES);

/// The weights of the terms for each Gaussian, as `regularize` reads them.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct TermWeights {
    /// Weight of the length of its velocity.
    pub motion: f32,
    /// Weight of the length of the difference between its velocity and the velocity of a neighbor at the same position.
    pub rigid: f32,
    /// Weight of its opacity.
    pub opacity: f32,
    /// Weight of each of its spatial scales.
    pub scale: f32,
    /// The weight of a neighbor is `exp(−falloff d)`, `d` its distance.
    pub falloff: f32,
}

/// The pass `regularize`.
#[derive(Debug)]
pub(super) struct Regularizer {
    pass: wgpu::ComputePipeline,
    /// For each chunk of the Gaussians.
    groups: Vec<wgpu::BindGroup>,
    neighbors: wgpu::Buffer,
    /// Whether neighbors have been searched for.
    searched: bool,
    /// Steps between two searches for neighbors; `None` if no term needs them.
    search_every: Option<usize>,
}

impl Regularizer {
    /// Makes the part if a term of Gaussians alone has a weight.
    ///
    /// # Errors
    /// A weight of any term that is negative or not a number, a rigid term of more Gaussians than a binding holds.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        let terms = &request.settings.terms;
        if let Some((term, weight)) = terms.wrong() {
            return Err(TrainerError::Weight { term, weight });
        }
        if terms.is_regularizing() { Ok(Some(Box::new(Self::new(work, terms)?))) } else { Ok(None) }
    }

    /// Compiles the pass.
    fn new(work: &Workspace<'_>, terms: &Terms) -> Result<Self, GpuError> {
        use Bind::{Read, Uniform, Write};
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let count = work.parameters.count() as usize;
        let search_every = (terms.rigid > 0.0).then(|| terms.search_every.max(1));
        if search_every.is_some() {
            // Neighbors are of all Gaussians.
            work.parameters.only_chunk("the Gaussians of a rigid term")?;
        }
        let sizes = [size_of::<TrainedScene>(), size_of::<TermWeights>()];
        let bindings = [Uniform(sizes[0]), Uniform(sizes[1]), Read, Read, Read, Write];
        let layout = group_layout(device, "gs4d terms", &bindings);
        let shader = SHADERS.module(device, "regularize", &[], ShaderChecks::Off)?;
        let weights = allocator.buffer("gs4d weights of terms", sizes[1] as u64, BufferUsages::UNIFORM);
        let settings = weights_of(terms, count, work.scene.trained_with.unit_length());
        work.queue().write_buffer(&weights, 0, bytemuck::bytes_of(&settings));
        let listed = if search_every.is_some() { count * NEIGHBORS } else { 1 };
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let neighbors = allocator.buffer("gs4d neighbors", (listed * size_of::<u32>()) as u64, storage);
        let group = |chunk: &ParameterChunk| {
            let ParameterChunk { scene_settings, gaussians, .. } = chunk;
            let [read, listed] = [[scene_settings, &weights], [gaussians, &neighbors]]
                .map(|buffers| buffers.map(wgpu::Buffer::as_entire_binding));
            let Optimized { values, gradients, .. } = &work.parameters.geometry;
            let [values, gradients] = [values, gradients].map(|all| [chunk.window(all, size_of::<TrainedRecord>())]);
            let resources = [&read[..], &values, &listed, &gradients].concat();
            allocator.bind_group("gs4d terms", &layout, &resources)
        };
        let groups = work.parameters.chunks.iter().map(group).collect();
        let pass = pipeline(device, &shader, "regularize", &[Some(&layout)]);
        Ok(Self { pass, groups, neighbors, searched: false, search_every })
    }

    /// Searches for the neighbors of all Gaussians at their current means.
    fn search(&mut self, work: &Workspace<'_>) -> Result<(), GpuError> {
        let records = work.parameters.read_records(work.headless, Quantity::Values)?;
        let means: Vec<[f32; 3]> = records.iter().map(|record| record.mean).collect();
        self.set_neighbors(work.headless, bytemuck::cast_slice(&neighbors(&means)));
        Ok(())
    }

    /// Replaces the neighbors of all Gaussians.
    fn set_neighbors(&mut self, headless: &Headless, bytes: &[u8]) {
        headless.context().queue.write_buffer(&self.neighbors, 0, bytes);
        self.searched = true;
    }
}

/// Returns the weights of the terms for each of `count` Gaussians, of which the terms are means. `unit` is the unit of
/// length, capture units.
fn weights_of(terms: &Terms, count: usize, unit: f64) -> TermWeights {
    let share = 1.0 / count as f64;
    TermWeights {
        motion: (terms.motion * MOMENT * share / unit) as f32,
        rigid: (terms.rigid * MOMENT * share / NEIGHBORS as f64 / unit) as f32,
        opacity: (terms.opacity * share) as f32,
        scale: (terms.scale * share / 3.0 / unit) as f32,
        falloff: (FALLOFF / unit) as f32,
    }
}

impl Part for Regularizer {
    /// Adds the gradients of the terms. If a term needs neighbors, these are searched for before the first step, then
    /// after every [`Terms::search_every`] steps.
    fn accumulate(&mut self, work: &Workspace<'_>, index: usize) -> Result<(), GpuError> {
        if self.search_every.is_some_and(|every| !self.searched || index.is_multiple_of(every)) {
            self.search(work)?;
        }
        work.submit("gs4d terms", |pass| {
            pass.set_pipeline(&self.pass);
            for (chunk, group) in work.parameters.chunks.iter().zip(&self.groups) {
                pass.set_bind_group(0, group, &[]);
                let [across, down] = across_and_down(chunk.count().div_ceil(64));
                pass.dispatch_workgroups(across, down, 1);
            }
        });
        Ok(())
    }

    fn neighbors(&self, work: &Workspace<'_>) -> Result<Vec<u8>, GpuError> {
        if self.searched { work.headless.copy_out(&self.neighbors, self.neighbors.size()) } else { Ok(Vec::new()) }
    }

    fn resume(&mut self, work: &Workspace<'_>, neighbors: &[u8]) {
        if self.neighbors.size() == neighbors.len() as u64 {
            self.set_neighbors(work.headless, neighbors);
        }
    }
}
