//! The terms of the loss that depend on Gaussians alone, in training.
//!
//! In: weights, the parameters that are trained. Out: gradients, added to those of the batch.

use super::neighbors::{NEIGHBORS, neighbors};
use super::terms::{MOMENT, Terms};
use super::trainer::{Trainer, TrainerError};
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::layout::{TermWeights, TrainedRecord, TrainedScene};
use crate::renderer::shaders::module;
use crate::renderer::{GpuError, ShaderChecks};
use wgpu::BufferUsages;

/// The pass `regularize`.
#[derive(Debug)]
pub(super) struct Regularizer {
    regularize: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    pub neighbors: wgpu::Buffer,
    /// Whether neighbors have been searched for.
    pub searched: bool,
}

impl Trainer<'_> {
    /// Sets the weights of further terms of the loss, which are 0 at first.
    ///
    /// # Errors
    /// A weight that is negative or not a number, a shader that does not compile.
    pub fn set_terms(&mut self, terms: Terms) -> Result<(), TrainerError> {
        if let Some((term, weight)) = terms.wrong() {
            return Err(TrainerError::Weight { term, weight });
        }
        self.regularizer = if terms.is_regularizing() { Some(self.regularizer_of(&terms)?) } else { None };
        self.terms = terms;
        Ok(())
    }

    fn regularizer_of(&self, terms: &Terms) -> Result<Regularizer, TrainerError> {
        use Bind::{Read, Uniform, Write};
        let Some([gaussians, ..]) = self.capture.writable() else { return Err(TrainerError::Empty) };
        let (allocator, device) = (self.headless.allocator(), &self.headless.context().device);
        let sizes = [size_of::<TrainedScene>(), size_of::<TermWeights>()];
        let bindings = [Uniform(sizes[0]), Uniform(sizes[1]), Read, Read, Read, Write];
        let layout = group_layout(device, "gs4d terms", &bindings);
        let shader = module(device, "regularize", &[], ShaderChecks::Off)?;
        let weights = allocator.buffer("gs4d weights of terms", sizes[1] as u64, BufferUsages::UNIFORM);
        let share = 1.0 / self.capture.len() as f64;
        let settings = TermWeights {
            motion: (terms.motion * MOMENT * share) as f32,
            rigid: (terms.rigid * MOMENT * share / NEIGHBORS as f64) as f32,
            opacity: (terms.opacity * share) as f32,
            padding: 0,
        };
        self.headless.context().queue.write_buffer(&weights, 0, bytemuck::bytes_of(&settings));
        let listed = if terms.rigid > 0.0 { self.capture.len() * NEIGHBORS } else { 1 };
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let neighbors = allocator.buffer("gs4d neighbors", (listed * size_of::<u32>()) as u64, storage);
        let geometry = &self.geometry;
        let buffers = [&self.scene_settings, &weights, &geometry.values, gaussians, &neighbors, &geometry.gradients];
        let group = allocator.bind_group("gs4d terms", &layout, &buffers.map(wgpu::Buffer::as_entire_binding));
        let regularize = pipeline(device, &shader, "regularize", &[Some(&layout)]);
        Ok(Regularizer { regularize, group, neighbors, searched: false })
    }

    /// Adds the gradients of the terms that depend on Gaussians alone to those of the batch of a step, from 0. Neighbors are searched for
    /// before the first and again as often as the terms say.
    ///
    /// # Errors
    /// A lost device.
    pub fn accumulate_terms(&mut self, step: usize) -> Result<(), GpuError> {
        let every = self.terms.search_every.max(1);
        let Some(regularizer) = &self.regularizer else { return Ok(()) };
        if self.terms.rigid > 0.0 && (!regularizer.searched || step.is_multiple_of(every)) {
            self.search()?;
        }
        let Some(regularizer) = &self.regularizer else { return Ok(()) };
        let mut encoder = self.encoder("gs4d terms");
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&regularizer.regularize);
            pass.set_bind_group(0, &regularizer.group, &[]);
            pass.dispatch_workgroups((self.capture.len() as u32).div_ceil(64), 1, 1);
        }
        self.headless.context().queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Searches for the neighbors of all Gaussians as they are.
    fn search(&mut self) -> Result<(), GpuError> {
        let records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&self.read(&self.geometry.values)?);
        let means: Vec<[f32; 3]> = records.iter().map(|record| record.mean).collect();
        self.set_neighbors(bytemuck::cast_slice(&neighbors(&means)));
        Ok(())
    }

    /// Replaces the neighbors of all Gaussians.
    pub(super) fn set_neighbors(&mut self, bytes: &[u8]) {
        if let Some(regularizer) = &mut self.regularizer {
            self.headless.context().queue.write_buffer(&regularizer.neighbors, 0, bytes);
            regularizer.searched = true;
        }
    }

    /// Returns the neighbors of all Gaussians; empty if they have not been searched for.
    pub(super) fn neighbors(&self) -> Result<Vec<u8>, GpuError> {
        match &self.regularizer {
            Some(Regularizer { neighbors, searched: true, .. }) => self.read(neighbors),
            _ => Ok(Vec::new()),
        }
    }
}
