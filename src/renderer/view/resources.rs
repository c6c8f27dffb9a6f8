//! The resources of a view whose sizes depend on the view or the captures, and the bind groups over them.
//!
//! In: sizes, the opaque depth and the environment map. Out: [`Resources`], which are created again only when the sizes change. Another opaque
//! depth or environment map replaces only the bind group of the pixels.

use crate::renderer::frame::Sizes;
use crate::renderer::frame::{Preparation, ViewDesign};
use crate::renderer::layout::{INSTANCE_STRIDE, INSTANCES_AT_ONCE, INSTANCES_BOUND};
use crate::renderer::shaders::Pixels;
use std::num::NonZeroU64;
use wgpu::{BindingResource, BufferUsages, TextureFormat, TextureView, TextureViewDescriptor};

/// Sized resources of every design, and the bind groups over them.
#[derive(Debug)]
pub(super) struct Resources {
    pub sizes: Sizes,
    pub instances: wgpu::Buffer,
    pub color: wgpu::Texture,
    pub color_view: TextureView,
    pub depth: wgpu::Texture,
    pub depth_view: TextureView,
    /// Opaque depth and environment map of the bind group of the pixels, and the variant of the pixel passes that write the targets.
    pub opaque: TextureView,
    pub environment: wgpu::Buffer,
    pub pixels: Pixels,
    pub pixel: wgpu::BindGroup,
}

impl Resources {
    /// Creates the resources, and the buffers of the design. `uniform` is the uniform of the frame.
    pub(super) fn new(
        frame: &Preparation<'_>,
        design: &mut dyn ViewDesign,
        sizes: Sizes,
        uniform: &wgpu::Buffer,
        opaque: TextureView,
        environment: wgpu::Buffer,
    ) -> Self {
        let (allocator, pixels) = (frame.allocator(), frame.pixels);
        // A binding at the last instance has the same length as at the first.
        let instance_slots = u64::from(sizes.parts + INSTANCES_AT_ONCE - 1);
        let instances =
            allocator.buffer("gs4d instances", instance_slots * u64::from(INSTANCE_STRIDE), BufferUsages::UNIFORM);
        let instance = BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &instances,
            offset: 0,
            size: NonZeroU64::new(u64::from(INSTANCES_BOUND)),
        });
        design.create(frame, sizes, [uniform.as_entire_binding(), instance]);
        let color = allocator.texture("gs4d color", sizes.picture, pixels.precision.format());
        let depth = allocator.texture("gs4d depth", sizes.depths, TextureFormat::Rg32Float);
        let [color_view, depth_view] =
            [&color, &depth].map(|texture| texture.create_view(&TextureViewDescriptor::default()));
        let views = [&opaque, &color_view, &depth_view];
        let pixel = pixel_group(frame, pixels, uniform, &environment, views);
        Self { sizes, instances, color, color_view, depth, depth_view, opaque, environment, pixels, pixel }
    }

    /// Binds an opaque depth and an environment map, unless they are bound. While a window is resized, the depth texture changes in every
    /// frame.
    pub(super) fn bind_pixel(
        &mut self,
        frame: &Preparation<'_>,
        uniform: &wgpu::Buffer,
        opaque: TextureView,
        environment: wgpu::Buffer,
    ) {
        if self.opaque == opaque && self.environment == environment {
            return;
        }
        let views = [&opaque, &self.color_view, &self.depth_view];
        self.pixel = pixel_group(frame, self.pixels, uniform, &environment, views);
        (self.opaque, self.environment) = (opaque, environment);
    }
}

/// Creates the bind group of the pixels. `views` are the opaque depth and the targets of color and depth.
pub(super) fn pixel_group(
    frame: &Preparation<'_>,
    pixels: Pixels,
    uniform: &wgpu::Buffer,
    environment: &wgpu::Buffer,
    views: [&TextureView; 3],
) -> wgpu::BindGroup {
    let [opaque, color, depth] = views.map(BindingResource::TextureView);
    let resources = [uniform.as_entire_binding(), environment.as_entire_binding(), opaque, color, depth];
    frame.allocator().bind_group("gs4d pixel", &frame.renderer.layouts.pixel[pixels.index()], &resources)
}

/// Returns the bytes of a texture without mip levels.
pub(super) fn texture_bytes(texture: &wgpu::Texture) -> u64 {
    let texel = texture.format().block_copy_size(None).unwrap_or(0);
    u64::from(texture.width()) * u64::from(texture.height()) * u64::from(texel)
}
