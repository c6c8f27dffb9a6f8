//! The parameters of a scene that is trained, on the GPU.
//!
//! In: raw parameters of a scene, the buffers of its capture. Out: [`ParameterBuffers`]: parameters and color coefficients with gradients,
//! moments and notes; commands of the pass `slice`.

use super::optimized::Optimized;
use super::passes::Passes;
use super::totals::Faults;
use crate::gaussian::Model;
use crate::offline::layout::{FIRST_SEEN, TrainedRecord, TrainedScene};
use crate::renderer::{GpuError, Headless};
use wgpu::BufferUsages;

/// Bytes of the notes of `project_backward` about gradients that are not finite, before two words for each Gaussian.
const FAULT_BYTES: u64 = 4 * FIRST_SEEN as u64;

/// Raw parameters and color coefficients, with their gradients, moments and notes.
#[derive(Debug)]
pub(super) struct ParameterBuffers {
    pub geometry: Optimized,
    pub color: Optimized,
    /// One [`TrainedScene`].
    pub scene_settings: wgpu::Buffer,
    /// Gradients that were not finite; how many views since the last step have shown each Gaussian, and its gradients on the screen.
    pub notes: wgpu::Buffer,
    /// Bind group of parameters and gradients, for `project_backward`.
    pub group: wgpu::BindGroup,
    settings: TrainedScene,
    slice: wgpu::BindGroup,
}

/// Returns the settings of a trained scene, for the view number 0.
pub(super) fn scene_settings(model: Model, count: u32, prefilter_var: f32) -> TrainedScene {
    let model = match model {
        Model::Static3d => 0,
        Model::Unrotated4d => 1,
        Model::Rotated4d => 2,
    };
    TrainedScene { count, model, prefilter_var, view: 0 }
}

impl ParameterBuffers {
    /// Uploads raw parameters. The three buffers of the capture hold Gaussians, lifespans and color coefficients; the coefficients, `stride`
    /// four-vectors for each Gaussian, are trained in place.
    pub(super) fn new(
        headless: &Headless,
        passes: &Passes,
        settings: TrainedScene,
        records: &[TrainedRecord],
        stride: u32,
        [gaussians, lifespans, harmonics]: [&wgpu::Buffer; 3],
    ) -> Self {
        let allocator = headless.allocator();
        let queue = &headless.context().queue;
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let count = settings.count;
        let raw = allocator.buffer("gs4d trained", size_of_val(records) as u64, storage);
        queue.write_buffer(&raw, 0, bytemuck::cast_slice(records));
        let notes = allocator.buffer("gs4d notes", FAULT_BYTES + 8 * u64::from(count), storage);
        let geometry = Optimized::new(headless, passes, &notes, raw, count, 5);
        let color = Optimized::new(headless, passes, &notes, harmonics.clone(), count, stride);
        let uniform = BufferUsages::UNIFORM;
        let scene_settings = allocator.buffer("gs4d trained scene", size_of::<TrainedScene>() as u64, uniform);
        let slice = allocator.bind_group(
            "gs4d slice",
            &passes.slice_group,
            &[&scene_settings, &geometry.values, gaussians, lifespans].map(wgpu::Buffer::as_entire_binding),
        );
        let buffers = [&geometry.values, &color.values, &geometry.gradients, &color.gradients, &notes];
        let group = allocator.bind_group(
            "gs4d parameters",
            &passes.parameters_group,
            &buffers.map(wgpu::Buffer::as_entire_binding),
        );
        Self { geometry, color, scene_settings, notes, group, settings, slice }
    }

    /// Returns the number of Gaussians.
    pub(super) fn count(&self) -> u32 {
        self.settings.count
    }

    /// Writes the settings of the scene for the view of this number.
    pub(super) fn write_scene(&self, queue: &wgpu::Queue, view: u32) {
        let settings = TrainedScene { view, ..self.settings };
        queue.write_buffer(&self.scene_settings, 0, bytemuck::bytes_of(&settings));
    }

    /// Records that the parameters are sliced.
    pub(super) fn record_slice(&self, pass: &mut wgpu::ComputePass<'_>, passes: &Passes) {
        pass.set_pipeline(&passes.slice);
        pass.set_bind_group(0, &self.slice, &[]);
        pass.dispatch_workgroups(self.count().div_ceil(256), 1, 1);
    }

    /// Records that the notes about seen Gaussians are cleared.
    pub(super) fn forget_seen(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.notes, FAULT_BYTES, None);
    }

    /// Returns the gradients that were not finite so far; `None` if there were none.
    pub(super) fn faults(&self, headless: &Headless) -> Result<Option<Faults>, GpuError> {
        let bytes = headless.copy_out(&self.notes, FAULT_BYTES)?;
        Ok(Faults::of(bytemuck::pod_read_unaligned(&bytes)))
    }
}
