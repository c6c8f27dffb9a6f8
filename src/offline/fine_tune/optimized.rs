//! Parameters on the GPU, with what the optimizer knows of each.
//!
//! In: a buffer of values. Out: [`Optimized`]: the same with gradients and moments, as `adam` takes them; commands of the pass `adam`.

use super::adam::correction;
use super::passes::Passes;
use crate::offline::layout::AdamUniforms;
use crate::renderer::{GpuError, Headless};
use wgpu::BufferUsages;

/// Most workgroups of `adam`, and of `expand`, which writes the values of the same buffers.
pub(super) const ADAM_GROUPS: u32 = 4096;

/// Most workgroups in a direction, on every device.
const MOST_GROUPS: u32 = 65_535;

/// Returns a dispatch of at least so many workgroups, which index Gaussians across and then down.
pub(super) fn across_and_down(groups: u32) -> [u32; 2] {
    let across = groups.min(MOST_GROUPS);
    [across, groups.div_ceil(across.max(1))]
}

/// One kind of parameters on the GPU, with what the optimizer knows of each.
#[derive(Debug)]
pub(super) struct Optimized {
    pub values: wgpu::Buffer,
    pub gradients: wgpu::Buffer,
    moments: [wgpu::Buffer; 2],
    settings: wgpu::Buffer,
    group: wgpu::BindGroup,
    /// Number of Gaussians or entries, and four-vectors of each.
    pub count: u32,
    pub stride: u32,
}

impl Optimized {
    /// Creates gradients and moments, which are 0, beside the values.
    pub(super) fn new(headless: &Headless, passes: &Passes, values: wgpu::Buffer, count: u32, stride: u32) -> Self {
        let allocator = headless.allocator();
        let size = u64::from(count) * u64::from(stride) * 16;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let gradients = allocator.buffer("gs4d gradients", size, usage);
        let moments = [(); 2].map(|()| allocator.buffer("gs4d moments", size, usage));
        let settings = allocator.buffer("gs4d adam", size_of::<AdamUniforms>() as u64, BufferUsages::UNIFORM);
        let buffers = [&settings, &values, &gradients, &moments[0], &moments[1]];
        let resources = buffers.map(wgpu::Buffer::as_entire_binding);
        let group = allocator.bind_group("gs4d adam", &passes.adam_group, &resources);
        Self { values, gradients, moments, settings, group, count, stride }
    }

    /// Records step number `step`, counted from 1, which updates so many values of each Gaussian, from the first; `None`: all.
    pub(super) fn record_step(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        passes: &Passes,
        rates: [[f32; 4]; 5],
        step: usize,
        values: Option<u32>,
    ) {
        let Self { count, stride, .. } = *self;
        let settings = AdamUniforms {
            rates,
            correction: correction(step),
            count,
            stride,
            values: values.unwrap_or(4 * stride),
            padding: 0,
            end: [0; 2],
        };
        queue.write_buffer(&self.settings, 0, bytemuck::bytes_of(&settings));
        pass.set_pipeline(&passes.adam);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups((count * stride).div_ceil(256).min(ADAM_GROUPS), 1, 1);
    }

    /// Records that all moments become 0.
    pub(super) fn forget_moments(&self, encoder: &mut wgpu::CommandEncoder) {
        for moments in &self.moments {
            encoder.clear_buffer(moments, 0, None);
        }
    }

    /// Returns the buffers of a state: values, first and second moments.
    pub(super) fn stored(&self) -> [&wgpu::Buffer; 3] {
        let [first, second] = &self.moments;
        [&self.values, first, second]
    }

    /// Reads the values.
    pub(super) fn read_values(&self, headless: &Headless) -> Result<Vec<u8>, GpuError> {
        headless.copy_out(&self.values, self.values.size())
    }

    /// Reads the gradients accumulated since the last step.
    pub(super) fn read_gradients(&self, headless: &Headless) -> Result<Vec<u8>, GpuError> {
        headless.copy_out(&self.gradients, self.gradients.size())
    }
}
