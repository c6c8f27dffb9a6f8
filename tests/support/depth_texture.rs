//! Depth textures with the same value everywhere, also for the unit tests of the crate, which include this file.
//!
//! In: a device, a size, a value. Out: a texture that can be drawn to and read, and a view of it.

use glam::UVec2;

/// Returns a depth texture, not yet written.
pub fn depth_target(device: &wgpu::Device, size: UVec2, samples: u32) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: samples,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Depth32Float,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    })
}

/// Returns a depth texture with the same value everywhere.
pub fn uniform_depth(device: &wgpu::Device, queue: &wgpu::Queue, size: UVec2, value: f32) -> wgpu::TextureView {
    let view = depth_target(device, size, 1).create_view(&wgpu::TextureViewDescriptor::default());
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let depth_ops = wgpu::Operations { load: wgpu::LoadOp::Clear(value), store: wgpu::StoreOp::Store };
    // A render pass that only clears the texture.
    drop(encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &view,
            depth_ops: Some(depth_ops),
            stencil_ops: None,
        }),
        ..Default::default()
    }));
    queue.submit([encoder.finish()]);
    view
}
