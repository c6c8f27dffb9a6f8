//! The contents of textures.
//!
//! In: a color texture. Out: its bytes, row by row.

use bevy_gs4d::renderer::GpuContext;

/// Returns the bytes of a color texture whose rows need no padding.
pub fn texture_bytes(context: &GpuContext, view: &wgpu::TextureView) -> Vec<u8> {
    let texture = view.texture();
    let texel = texture.format().block_copy_size(None).expect("a color format");
    let (size, row) = (texture.size(), texture.width() * texel);
    assert_eq!(row % wgpu::COPY_BYTES_PER_ROW_ALIGNMENT, 0, "rows need no padding");
    let buffer = context.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row) * u64::from(size.height),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, size);
    context.queue.submit([encoder.finish()]);
    buffer.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the copy can be mapped"));
    context.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
    buffer.slice(..).get_mapped_range().to_vec()
}
