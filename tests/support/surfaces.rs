//! Opaque surfaces in front of captures.
//!
//! In: the size and depth of a surface. Out: depth textures, with one sample or four samples.

use super::depth_texture::{depth_target, uniform_depth};
use bevy_gs4d::renderer::GpuContext;
use glam::UVec2;

/// Returns a depth texture with the same value everywhere.
pub fn depth_texture(context: &GpuContext, size: UVec2, value: f32) -> wgpu::TextureView {
    uniform_depth(&context.device, &context.queue, size, value)
}

/// Returns a multisampled depth texture, and the index of its middle column. The depth is `near / distance` left of the
/// middle and 0 right of it; in the middle column half of the samples are covered. `slant` shifts the edge, in picture
/// widths over the picture height.
pub fn edge(context: &GpuContext, size: UVec2, near: f32, distance: f32, slant: f32) -> (wgpu::Texture, u32) {
    let GpuContext { device, queue, .. } = context;
    let texture = depth_target(device, size, 4);
    let column = size.x / 2;
    // The edge runs through the centers of the column's pixels.
    let end = (column as f32 + 0.5) / size.x as f32 * 2.0 - 1.0;
    let source = format!(
        "@vertex fn main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {{
            let corner = vec2(f32(i & 1u), f32(i >> 1u));
            let y = corner.y * 2.0 - 1.0;
            return vec4(mix(-1.0, {end:?} + {slant:?} * y, corner.x), y, {:?}, 1.0);
        }}",
        near / distance
    );
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: wgpu::MultisampleState { count: 4, ..wgpu::MultisampleState::default() },
        fragment: None,
        multiview_mask: None,
        cache: None,
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &view,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&pipeline);
        pass.draw(0..4, 0..1);
    }
    queue.submit([encoder.finish()]);
    (texture, column)
}
