//! Buffers and textures, and what a device allows of them.
//!
//! In: a device, sizes, what they are for. Out: buffers and textures; the limits that sizes are held against.

use super::note_created;
use glam::UVec2;
use wgpu::{BufferUsages, TextureFormat};

/// Largest storage buffer that can be made and bound whole.
pub(crate) fn binding_limit(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Distance between uniforms that are bound at an offset.
pub(crate) fn alignment_of<T>(device: &wgpu::Device) -> u32 {
    let least = device.limits().min_uniform_buffer_offset_alignment;
    least.max(size_of::<T>() as u32).next_power_of_two()
}

/// A buffer that can also be written through the queue.
pub(crate) fn buffer(device: &wgpu::Device, label: &str, size: u64, usage: BufferUsages) -> wgpu::Buffer {
    note_created();
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: usage | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// A texture that passes write and later ones read; of depth, one that is only read.
pub(crate) fn texture(device: &wgpu::Device, label: &str, size: UVec2, format: TextureFormat) -> wgpu::Texture {
    let usage = if format == TextureFormat::Depth32Float {
        wgpu::TextureUsages::TEXTURE_BINDING
    } else {
        wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC
    };
    note_created();
    device.create_texture(&wgpu::TextureDescriptor {
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
