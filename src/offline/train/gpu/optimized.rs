//! Parameters on the GPU, with their gradients and the moments of the optimizer.
//!
//! In: a buffer of values. Out: [`Optimized`], the buffers of the pass `adam`, and its commands.

use super::passes::Passes;
use crate::offline::engine::layout::AdamUniforms;
use crate::offline::train::reference::adam::correction;
use crate::renderer::{GpuError, Headless};
use wgpu::BufferUsages;

/// Most workgroups of `adam`, and of `expand`, which writes the values of the same buffers.
pub(crate) const ADAM_GROUPS: u32 = 4096;

/// Most workgroups in a direction, on every device.
const MOST_GROUPS: u32 = 65_535;

/// Returns a dispatch of at least so many workgroups, which index Gaussians across and then down.
pub(crate) fn across_and_down(groups: u32) -> [u32; 2] {
    let across = groups.min(MOST_GROUPS);
    [across, groups.div_ceil(across.max(1))]
}

/// What is read of parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// The parameters.
    Values,
    /// Their gradients, accumulated since the last step.
    Gradients,
}

/// One kind of parameters on the GPU, with their gradients and moments.
#[derive(Debug)]
pub(crate) struct Optimized {
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
    pub(crate) fn new(headless: &Headless, passes: &Passes, values: wgpu::Buffer, count: u32, stride: u32) -> Self {
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

    /// Records a step, which is number `count` since the moments were 0, counted from 1. It updates the first `values`
    /// values of each Gaussian; `None`: all. Gradients become 0.
    pub(crate) fn record_step(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        passes: &Passes,
        rates: [[f32; 4]; 5],
        count: usize,
        values: Option<u32>,
    ) {
        let stride = self.stride;
        let settings = AdamUniforms {
            rates,
            correction: correction(count),
            count: self.count,
            stride,
            values: values.unwrap_or(4 * stride),
            padding: 0,
            end: [0; 2],
        };
        queue.write_buffer(&self.settings, 0, bytemuck::bytes_of(&settings));
        pass.set_pipeline(&passes.adam);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups((self.count * stride).div_ceil(256).min(ADAM_GROUPS), 1, 1);
    }

    /// Records that all moments become 0.
    pub(crate) fn forget_moments(&self, encoder: &mut wgpu::CommandEncoder) {
        for moments in &self.moments {
            encoder.clear_buffer(moments, 0, None);
        }
    }

    /// Returns the buffers of a state: values, first and second moments.
    pub(crate) fn stored(&self) -> [&wgpu::Buffer; 3] {
        let [first, second] = &self.moments;
        [&self.values, first, second]
    }

    /// Reads the values or the gradients.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn read(&self, headless: &Headless, what: Quantity) -> Result<Vec<u8>, GpuError> {
        let buffer = match what {
            Quantity::Values => &self.values,
            Quantity::Gradients => &self.gradients,
        };
        headless.copy_out(buffer, buffer.size())
    }
}
