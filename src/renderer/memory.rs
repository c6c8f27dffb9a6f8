//! Creation of buffers, textures and bind groups, and the limits of a device for them.
//!
//! In: a device, sizes and usages. Out: buffers, textures and bind groups, each counted; the limits that sizes are
//! checked against; an error where memory runs out.

use super::error::GpuError;
use super::work::WorkCounters;
use glam::UVec2;
use pollster::block_on;
use wgpu::{BufferUsages, TextureFormat};

/// Creates resources on a device and counts them.
#[derive(Debug, Clone, Copy)]
pub struct Allocator<'a> {
    /// The device.
    pub device: &'a wgpu::Device,
    /// Counts the resources created.
    pub work: &'a WorkCounters,
}

impl Allocator<'_> {
    /// Creates a buffer that can also be written through the queue.
    pub fn buffer(self, label: &str, size: u64, usage: BufferUsages) -> wgpu::Buffer {
        self.work.add_created();
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Creates a texture that passes write and later passes read. A depth texture is only read.
    pub fn texture(self, label: &str, size: UVec2, format: TextureFormat) -> wgpu::Texture {
        let usage = if format == TextureFormat::Depth32Float {
            wgpu::TextureUsages::TEXTURE_BINDING
        } else {
            wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC
        };
        self.work.add_created();
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    }

    /// Creates a bind group whose bindings are numbered in order.
    pub fn bind_group(
        self,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = resources
            .iter()
            .enumerate()
            .map(|(i, resource)| wgpu::BindGroupEntry { binding: i as u32, resource: resource.clone() })
            .collect();
        self.work.add_created();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
    }
}

/// Runs `create`, which allocates `needed` bytes or more. If the device has too little memory, an error is returned, instead of a panic of
/// wgpu.
///
/// # Errors
/// The device has no memory left, or rejects an object that uses a resource without memory.
pub fn with_room<T>(device: &wgpu::Device, needed: u64, create: impl FnOnce() -> T) -> Result<T, GpuError> {
    let refused = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let lacking = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let created = create();
    let lacking = block_on(lacking.pop());
    let refused = block_on(refused.pop());
    match (lacking, refused) {
        (Some(error), _) => Err(GpuError::Memory { needed, reason: error.to_string() }),
        (None, Some(error)) => Err(GpuError::Device(error.to_string())),
        (None, None) => Ok(created),
    }
}

/// Returns the size of the largest storage buffer that can be created and bound as a whole, bytes.
pub fn binding_limit(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Checks that the device can create textures of this size.
///
/// # Errors
/// No pixels, or a longer side than the device allows.
pub fn require_texture(size: UVec2, limits: &wgpu::Limits) -> Result<(), GpuError> {
    let limit = limits.max_texture_dimension_2d;
    match size.min_element() == 0 || size.max_element() > limit {
        true => Err(GpuError::Size { width: size.x, height: size.y, limit }),
        false => Ok(()),
    }
}
