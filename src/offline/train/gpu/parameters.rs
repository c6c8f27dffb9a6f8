//! The parameters of a scene that is trained, on the GPU.
//!
//! In: raw parameters of a scene, the buffers of its capture. Out: [`ParameterBuffers`]: parameters and color
//! coefficients with gradients, moments and notes; commands of the passes `slice` and `adam`. Raw parameters of all
//! Gaussians are in one buffer. Colors, which are several times as large, are in as many [chunks](ParameterChunk) as
//! the capture has parts, so that each can be bound.

use super::optimized::{Optimized, Quantity};
use super::passes::Passes;
use super::totals::Faults;
use crate::gaussian::Model;
use crate::offline::engine::layout::{FIRST_SEEN, TrainedRecord, TrainedScene};
use crate::offline::train::schedule::Step;
use crate::renderer::{GpuError, Headless};
use crate::scene::TrainedWith;
use std::num::NonZeroU64;
use wgpu::{BindingResource, BufferUsages};

/// Bytes of the notes of `project_backward` about gradients that are not finite, before two words for each Gaussian.
const FAULT_BYTES: u64 = 4 * FIRST_SEEN as u64;

/// Raw parameters and color coefficients, with their gradients, moments and notes.
#[derive(Debug)]
pub(crate) struct ParameterBuffers {
    pub geometry: Optimized,
    pub chunks: Vec<ParameterChunk>,
    /// Gradients that were not finite; how many views since the last step have shown each Gaussian, and its gradients
    /// on the screen.
    pub notes: wgpu::Buffer,
    count: u32,
}

/// The Gaussians of a part of the capture.
#[derive(Debug)]
pub(crate) struct ParameterChunk {
    /// Their color coefficients.
    pub color: Optimized,
    /// The sliced Gaussians.
    pub gaussians: wgpu::Buffer,
    /// The lifespans of the sliced Gaussians.
    pub lifespans: wgpu::Buffer,
    /// One [`TrainedScene`].
    pub scene_settings: wgpu::Buffer,
    /// Bind group of parameters and gradients, for `project_backward`.
    pub group: wgpu::BindGroup,
    settings: TrainedScene,
    slice: wgpu::BindGroup,
}

impl ParameterChunk {
    /// Returns the index of the first Gaussian among all.
    pub(crate) fn first(&self) -> u32 {
        self.settings.first
    }

    /// Returns the number of Gaussians.
    pub(crate) fn count(&self) -> u32 {
        self.settings.count
    }

    /// Returns the range of a buffer of all Gaussians that holds those of the chunk, `each` bytes for a Gaussian.
    pub(crate) fn window<'a>(&self, buffer: &'a wgpu::Buffer, each: usize) -> BindingResource<'a> {
        window(buffer, each, &self.settings)
    }
}

/// Chunks begin at a multiple of a block of Gaussians, so that the range begins where a binding may.
fn window<'a>(buffer: &'a wgpu::Buffer, each: usize, chunk: &TrainedScene) -> BindingResource<'a> {
    let bytes = |gaussians: u32| u64::from(gaussians) * each as u64;
    let (offset, size) = (bytes(chunk.first), NonZeroU64::new(bytes(chunk.count)));
    BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size })
}

/// Returns the number of a model in the passes.
fn number_of(model: Model) -> u32 {
    match model {
        Model::Static3d => 0,
        Model::Unrotated4d => 1,
        Model::Rotated4d => 2,
    }
}

impl ParameterBuffers {
    /// Uploads raw parameters. `parts` are those of the capture, with their numbers of Gaussians and their buffers of
    /// Gaussians, lifespans and color coefficients; the coefficients, `stride` four-vectors for each Gaussian, are
    /// trained in place.
    pub(crate) fn new<'a>(
        headless: &Headless,
        passes: &Passes,
        (model, prefilter_var): (Model, f32),
        records: &[TrainedRecord],
        stride: u32,
        parts: impl Iterator<Item = (u32, [&'a wgpu::Buffer; 3])>,
    ) -> Self {
        let allocator = headless.allocator();
        let queue = &headless.context().queue;
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let total = records.len() as u32;
        let raw = allocator.buffer("gs4d trained", size_of_val(records) as u64, storage);
        queue.write_buffer(&raw, 0, bytemuck::cast_slice(records));
        let notes = allocator.buffer("gs4d notes", FAULT_BYTES + 8 * u64::from(total), storage);
        let geometry = Optimized::new(headless, passes, raw, total, 5);
        let mut first = 0;
        let chunk = |(count, [gaussians, lifespans, harmonics]): (u32, [&wgpu::Buffer; 3])| {
            let settings = TrainedScene { count, model: number_of(model), prefilter_var, view: 0, first, total };
            first += count;
            let color = Optimized::new(headless, passes, harmonics.clone(), count, stride);
            let uniform = BufferUsages::UNIFORM;
            let scene_settings = allocator.buffer("gs4d trained scene", size_of::<TrainedScene>() as u64, uniform);
            let whole = wgpu::Buffer::as_entire_binding;
            let [values, gradients] =
                [&geometry.values, &geometry.gradients].map(|all| window(all, size_of::<TrainedRecord>(), &settings));
            let sliced = [whole(&scene_settings), values.clone(), whole(gaussians), whole(lifespans)];
            let slice = allocator.bind_group("gs4d slice", &passes.slice_group, &sliced);
            let trained = [values, whole(&color.values), gradients, whole(&color.gradients), whole(&notes)];
            let group = allocator.bind_group("gs4d parameters", &passes.parameters_group, &trained);
            let (gaussians, lifespans) = (gaussians.clone(), lifespans.clone());
            ParameterChunk { color, gaussians, lifespans, scene_settings, group, settings, slice }
        };
        let chunks = parts.map(chunk).collect();
        Self { geometry, chunks, notes, count: total }
    }

    /// Returns the number of Gaussians.
    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    /// Returns the number of four-vectors of the color of each Gaussian.
    pub(crate) fn stride(&self) -> u32 {
        self.chunks.first().map_or(0, |chunk| chunk.color.stride)
    }

    /// Returns the only chunk.
    ///
    /// # Errors
    /// There are several, and `what` needs all Gaussians in one binding.
    pub(crate) fn only_chunk(&self, what: &'static str) -> Result<&ParameterChunk, GpuError> {
        match &self.chunks[..] {
            [chunk] => Ok(chunk),
            chunks => {
                let bytes = |chunk: &ParameterChunk| chunk.color.values.size();
                let (needed, limit) = (chunks.iter().map(bytes).sum(), chunks.iter().map(bytes).max().unwrap_or(0));
                Err(GpuError::TooLarge { what, needed, limit })
            }
        }
    }

    /// Writes the settings of the scene for the view of this number.
    pub(crate) fn write_scene(&self, queue: &wgpu::Queue, view: u32) {
        for chunk in &self.chunks {
            let settings = TrainedScene { view, ..chunk.settings };
            queue.write_buffer(&chunk.scene_settings, 0, bytemuck::bytes_of(&settings));
        }
    }

    /// Records that the parameters are sliced.
    pub(crate) fn record_slice(&self, pass: &mut wgpu::ComputePass<'_>, passes: &Passes) {
        pass.set_pipeline(&passes.slice);
        for chunk in &self.chunks {
            pass.set_bind_group(0, &chunk.slice, &[]);
            pass.dispatch_workgroups(chunk.count().div_ceil(256), 1, 1);
        }
    }

    /// Records the optimizer's step.
    pub(crate) fn record_step(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        passes: &Passes,
        trained_with: &TrainedWith,
        step: &Step,
    ) {
        let Step { count, rates, factor, color_values, .. } = *step;
        let of_geometry = rates.of_parameters(trained_with.spatial_lr_scale, trained_with.unit_length(), factor);
        self.geometry.record_step(queue, pass, passes, of_geometry, count, None);
        let of_color = rates.of_harmonics(factor);
        for chunk in &self.chunks {
            chunk.color.record_step(queue, pass, passes, of_color, count, color_values);
        }
    }

    /// Records that the notes about which Gaussians were seen are cleared.
    pub(crate) fn forget_seen(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.notes, FAULT_BYTES, None);
    }

    /// Returns the gradients that were not finite so far; `None` if there were none.
    pub(crate) fn faults(&self, headless: &Headless) -> Result<Option<Faults>, GpuError> {
        let bytes = headless.copy_out(&self.notes, FAULT_BYTES)?;
        Ok(Faults::of(bytemuck::pod_read_unaligned(&bytes)))
    }

    /// Reads the raw parameters of all Gaussians, or their gradients.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn read_records(&self, headless: &Headless, what: Quantity) -> Result<Vec<TrainedRecord>, GpuError> {
        Ok(bytemuck::pod_collect_to_vec(&self.geometry.read(headless, what)?))
    }

    /// Reads the color coefficients of all Gaussians, or their gradients.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn read_colors(&self, headless: &Headless, what: Quantity) -> Result<Vec<f32>, GpuError> {
        let chunks = self.chunks.iter().map(|chunk| chunk.color.read(headless, what));
        Ok(bytemuck::pod_collect_to_vec(&chunks.collect::<Result<Vec<_>, _>>()?.concat()))
    }

    /// Returns what the optimizer changes: raw parameters, then the colors of each chunk.
    pub(crate) fn optimized(&self) -> impl Iterator<Item = &Optimized> {
        std::iter::once(&self.geometry).chain(self.chunks.iter().map(|chunk| &chunk.color))
    }
}
