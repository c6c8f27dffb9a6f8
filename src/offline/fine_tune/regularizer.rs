//! The terms of the loss that depend on Gaussians alone, in training.
//!
//! In: weights, the unit of length, the parameters that are trained. Out: gradients, added to those of the batch.

use super::neighbors::{NEIGHBORS, neighbors};
use super::optimized::{Optimized, across_and_down};
use super::parameters::{ParameterBuffers, TrainedPart};
use super::terms::{FALLOFF, MOMENT, Terms};
use crate::offline::layout::{TermWeights, TrainedRecord, TrainedScene};
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::{GpuError, Headless, ShaderChecks};
use wgpu::BufferUsages;

/// The pass `regularize`.
#[derive(Debug)]
pub(super) struct Regularizer {
    regularize: wgpu::ComputePipeline,
    /// For each part of the Gaussians.
    groups: Vec<wgpu::BindGroup>,
    neighbors: wgpu::Buffer,
    /// Whether neighbors have been searched for.
    searched: bool,
    /// Steps between two searches for neighbors; `None` if no term needs them.
    search_every: Option<usize>,
}

impl Regularizer {
    /// Compiles the pass for terms with these weights and this unit of length, capture units.
    ///
    /// # Errors
    /// A rigid term of more Gaussians than a binding holds, a shader that does not compile.
    pub(super) fn new(
        headless: &Headless,
        parameters: &ParameterBuffers,
        terms: &Terms,
        unit: f64,
    ) -> Result<Self, GpuError> {
        use Bind::{Read, Uniform, Write};
        let (allocator, device) = (headless.allocator(), &headless.context().device);
        let count = parameters.count() as usize;
        let sizes = [size_of::<TrainedScene>(), size_of::<TermWeights>()];
        let bindings = [Uniform(sizes[0]), Uniform(sizes[1]), Read, Read, Read, Write];
        let layout = group_layout(device, "gs4d terms", &bindings);
        let shader = SHADERS.module(device, "regularize", &[], ShaderChecks::Off)?;
        let weights = allocator.buffer("gs4d weights of terms", sizes[1] as u64, BufferUsages::UNIFORM);
        let share = 1.0 / count as f64;
        let settings = TermWeights {
            motion: (terms.motion * MOMENT * share / unit) as f32,
            rigid: (terms.rigid * MOMENT * share / NEIGHBORS as f64 / unit) as f32,
            opacity: (terms.opacity * share) as f32,
            scale: (terms.scale * share / 3.0 / unit) as f32,
            falloff: (FALLOFF / unit) as f32,
        };
        headless.context().queue.write_buffer(&weights, 0, bytemuck::bytes_of(&settings));
        let search_every = (terms.rigid > 0.0).then(|| terms.search_every.max(1));
        if search_every.is_some() {
            // Neighbors are of all Gaussians.
            parameters.only_part("the Gaussians of a rigid term")?;
        }
        let listed = if search_every.is_some() { count * NEIGHBORS } else { 1 };
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let neighbors = allocator.buffer("gs4d neighbors", (listed * size_of::<u32>()) as u64, storage);
        let group = |part: &TrainedPart| {
            let TrainedPart { scene_settings, gaussians, .. } = part;
            let [read, listed] = [[scene_settings, &weights], [gaussians, &neighbors]]
                .map(|buffers| buffers.map(wgpu::Buffer::as_entire_binding));
            let Optimized { values, gradients, .. } = &parameters.geometry;
            let [values, gradients] = [values, gradients].map(|all| [part.window(all, size_of::<TrainedRecord>())]);
            let resources = [&read[..], &values, &listed, &gradients].concat();
            allocator.bind_group("gs4d terms", &layout, &resources)
        };
        let groups = parameters.parts.iter().map(group).collect();
        let regularize = pipeline(device, &shader, "regularize", &[Some(&layout)]);
        Ok(Self { regularize, groups, neighbors, searched: false, search_every })
    }

    /// Searches for the neighbors of all Gaussians at their current means if the search is due: before the first step, then after every
    /// [`Terms::search_every`] steps. Does nothing if no term needs neighbors.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn search(
        &mut self,
        headless: &Headless,
        parameters: &ParameterBuffers,
        step: usize,
    ) -> Result<(), GpuError> {
        if self.search_every.is_some_and(|every| !self.searched || step.is_multiple_of(every)) {
            let records = parameters.geometry.read_values(headless)?;
            let records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&records);
            let means: Vec<[f32; 3]> = records.iter().map(|record| record.mean).collect();
            self.set_neighbors(headless, bytemuck::cast_slice(&neighbors(&means)));
        }
        Ok(())
    }

    /// Records that the gradients of the terms are added to those of the Gaussians.
    pub(super) fn record(&self, pass: &mut wgpu::ComputePass<'_>, parameters: &ParameterBuffers) {
        pass.set_pipeline(&self.regularize);
        for (part, group) in parameters.parts.iter().zip(&self.groups) {
            pass.set_bind_group(0, group, &[]);
            let [across, down] = across_and_down(part.count().div_ceil(64));
            pass.dispatch_workgroups(across, down, 1);
        }
    }

    /// Replaces the neighbors of all Gaussians by those of a state, if it has as many.
    pub(super) fn resume(&mut self, headless: &Headless, neighbors: &[u8]) {
        if self.neighbors.size() == neighbors.len() as u64 {
            self.set_neighbors(headless, neighbors);
        }
    }

    /// Replaces the neighbors of all Gaussians.
    fn set_neighbors(&mut self, headless: &Headless, bytes: &[u8]) {
        headless.context().queue.write_buffer(&self.neighbors, 0, bytes);
        self.searched = true;
    }

    /// Returns the neighbors of all Gaussians; empty if they have not been searched for.
    pub(super) fn neighbors(&self, headless: &Headless) -> Result<Vec<u8>, GpuError> {
        if self.searched { headless.copy_out(&self.neighbors, self.neighbors.size()) } else { Ok(Vec::new()) }
    }
}
