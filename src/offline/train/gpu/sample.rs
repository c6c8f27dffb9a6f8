//! The images and views of a training step.
//!
//! In: images to train on. Out: [`GpuImage`], bound for the pass `loss`, and [`Sample`], one with its view.

use super::passes::Passes;
use crate::offline::dataset::CoveredImage;
use crate::renderer::device::memory::binding_limit;
use crate::renderer::{GpuError, Headless};
use crate::view::{Background, View};
use glam::UVec2;
use wgpu::BufferUsages;

/// An image on the GPU.
#[derive(Debug)]
pub struct GpuImage {
    pub(crate) size: UVec2,
    pub(crate) group: wgpu::BindGroup,
}

impl GpuImage {
    /// Uploads an image.
    pub(crate) fn new(headless: &Headless, passes: &Passes, image: &CoveredImage) -> Result<Self, GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(&image.texels);
        let (needed, limit) = (bytes.len() as u64, binding_limit(&headless.context().device.limits()));
        if needed > limit || needed == 0 {
            return Err(GpuError::Picture { size: image.size.to_array(), what: "its texels", needed, limit });
        }
        let allocator = headless.allocator();
        let buffer = allocator.buffer("gs4d image", needed, BufferUsages::STORAGE);
        headless.context().queue.write_buffer(&buffer, 0, bytes);
        let group = allocator.bind_group("gs4d image", &passes.image_group, &[buffer.as_entire_binding()]);
        Ok(Self { size: image.size, group })
    }
}

/// One view of a batch.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// Camera and time.
    pub view: &'a View,
    /// The image that the view should look like, in its size.
    pub image: &'a GpuImage,
    /// What is behind the scene, and behind the image if it is a color.
    pub background: Background,
    /// Number of the view, for reports.
    pub number: u32,
}
