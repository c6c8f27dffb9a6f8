//! Parameters on the GPU, with what the optimizer knows of each.
//!
//! In: a buffer of values. Out: [`Optimized`]: the same with gradients and moments, as `adam` takes them.

use super::passes::Passes;
use crate::renderer::Headless;
use crate::renderer::layout::AdamUniforms;
use wgpu::BufferUsages;

/// One kind of parameters on the GPU, with what the optimizer knows of each.
#[derive(Debug)]
pub(super) struct Optimized {
    pub values: wgpu::Buffer,
    pub gradients: wgpu::Buffer,
    pub moments: [wgpu::Buffer; 2],
    pub settings: wgpu::Buffer,
    pub group: wgpu::BindGroup,
    /// Number of Gaussians or entries, and four-vectors of each.
    pub count: u32,
    pub stride: u32,
}

impl Optimized {
    /// Creates gradients and moments, which are 0, beside the values. `notes` say which Gaussians were seen.
    pub fn new(
        headless: &Headless,
        passes: &Passes,
        notes: &wgpu::Buffer,
        values: wgpu::Buffer,
        count: u32,
        stride: u32,
    ) -> Self {
        let allocator = headless.allocator();
        let size = u64::from(count) * u64::from(stride) * 16;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let gradients = allocator.buffer("gs4d gradients", size, usage);
        let moments = [(); 2].map(|()| allocator.buffer("gs4d moments", size, usage));
        let settings = allocator.buffer("gs4d adam", size_of::<AdamUniforms>() as u64, BufferUsages::UNIFORM);
        let buffers = [&settings, &values, &gradients, &moments[0], &moments[1], notes];
        let resources = buffers.map(wgpu::Buffer::as_entire_binding);
        let group = allocator.bind_group("gs4d adam", &passes.adam_group, &resources);
        Self { values, gradients, moments, settings, group, count, stride }
    }
}
