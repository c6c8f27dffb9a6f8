//! The resources of a view whose sizes depend on the view or the captures, and the bind groups over them.
//!
//! In: sizes, the opaque depth and the environment map. Out: [`Resources`], which are created again only when the sizes change. Another opaque
//! depth or environment map replaces only the bind group of the pixels.

use super::sizes::Sizes;
use crate::renderer::design::Design;
use crate::renderer::global_sort::SortBuffers;
use crate::renderer::layout::{INSTANCE_STRIDE, INSTANCES_AT_ONCE, INSTANCES_BOUND};
use crate::renderer::layouts::Layouts;
use crate::renderer::memory::Allocator;
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Pixels;
use crate::renderer::tile_bins::BinBuffers;
use std::num::NonZeroU64;
use wgpu::{BindingResource, BufferUsages, TextureFormat};

/// Sized resources and the bind groups over them.
#[derive(Debug)]
pub(super) struct Resources {
    pub sizes: Sizes,
    /// Bytes of the view's own storage buffers and targets.
    pub bytes: u64,
    pub instances: wgpu::Buffer,
    pub color: wgpu::Texture,
    pub color_view: wgpu::TextureView,
    pub depth: wgpu::Texture,
    pub depth_view: wgpu::TextureView,
    /// Opaque depth and environment map of the bind group of the pixels, and the variant of the pixel passes that write the targets.
    pub opaque: wgpu::TextureView,
    pub environment: wgpu::Buffer,
    pub pixels: Pixels,
    pub pixel: wgpu::BindGroup,
    /// The buffers of the design.
    pub buffers: DesignBuffers,
}

/// The buffers of the design of a view.
#[derive(Debug)]
pub(super) enum DesignBuffers {
    TileBins(BinBuffers),
    GlobalSort(SortBuffers),
}

impl Resources {
    /// Creates the resources. `frame` is the uniform of the frame.
    pub(super) fn new(
        renderer: &Renderer,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        design: Design,
        sizes: Sizes,
        pixels: Pixels,
        frame: &wgpu::Buffer,
        opaque: wgpu::TextureView,
        environment: wgpu::Buffer,
    ) -> Self {
        let allocator = renderer.allocator(device);
        let layouts = &renderer.layouts;
        // A binding at the last instance has the same length as at the first.
        let instance_slots = u64::from(sizes.parts + INSTANCES_AT_ONCE - 1);
        let instances =
            allocator.buffer("gs4d instances", instance_slots * u64::from(INSTANCE_STRIDE), BufferUsages::UNIFORM);
        let instance = BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &instances,
            offset: 0,
            size: NonZeroU64::new(u64::from(INSTANCES_BOUND)),
        });
        let (buffers, bytes) = match design {
            Design::GlobalSort => {
                let buffers = SortBuffers::new(allocator, queue, layouts, sizes, frame, instance);
                let bytes = buffers.bytes;
                (DesignBuffers::GlobalSort(buffers), bytes)
            }
            Design::Auto | Design::TileBins => {
                let buffers = BinBuffers::new(allocator, layouts, &renderer.scratch, sizes, frame, instance);
                let bytes = buffers.bytes;
                (DesignBuffers::TileBins(buffers), bytes)
            }
        };
        let color = allocator.texture("gs4d color", sizes.picture, pixels.precision.format());
        let depth = allocator.texture("gs4d depth", sizes.depths, TextureFormat::Rg32Float);
        let color_view = color.create_view(&wgpu::TextureViewDescriptor::default());
        let depth_view = depth.create_view(&wgpu::TextureViewDescriptor::default());
        let views = [&opaque, &color_view, &depth_view];
        let pixel = pixel_group(allocator, &layouts.pixel[pixels.index()], frame, &environment, views);
        let bytes = bytes + texture_bytes(&color) + texture_bytes(&depth);
        Self {
            sizes,
            bytes,
            instances,
            color,
            color_view,
            depth,
            depth_view,
            opaque,
            environment,
            pixels,
            pixel,
            buffers,
        }
    }

    /// Returns the bytes of the buffers that all views share.
    pub(super) fn shared_bytes(&self) -> u64 {
        match &self.buffers {
            DesignBuffers::TileBins(bins) => bins.claim.bytes(),
            DesignBuffers::GlobalSort(_) => 0,
        }
    }

    /// Returns whether the shared buffers, if the design has any, are those that suit all views.
    pub(super) fn shares_current(&self, renderer: &Renderer) -> bool {
        match &self.buffers {
            DesignBuffers::TileBins(bins) => renderer.scratch.is_current(&bins.claim),
            DesignBuffers::GlobalSort(_) => true,
        }
    }

    /// Binds an opaque depth and an environment map, unless they are bound. While a window is resized, the depth texture changes in every
    /// frame.
    pub(super) fn bind_pixel(
        &mut self,
        allocator: Allocator<'_>,
        layouts: &Layouts,
        frame: &wgpu::Buffer,
        opaque: wgpu::TextureView,
        environment: wgpu::Buffer,
    ) {
        if self.opaque == opaque && self.environment == environment {
            return;
        }
        let views = [&opaque, &self.color_view, &self.depth_view];
        self.pixel = pixel_group(allocator, &layouts.pixel[self.pixels.index()], frame, &environment, views);
        (self.opaque, self.environment) = (opaque, environment);
    }
}

/// Creates the bind group of the pixels. `views` are the opaque depth and the targets of color and depth.
pub(super) fn pixel_group(
    allocator: Allocator<'_>,
    layout: &wgpu::BindGroupLayout,
    frame: &wgpu::Buffer,
    environment: &wgpu::Buffer,
    views: [&wgpu::TextureView; 3],
) -> wgpu::BindGroup {
    let [opaque, color, depth] = views.map(BindingResource::TextureView);
    let resources = [frame.as_entire_binding(), environment.as_entire_binding(), opaque, color, depth];
    allocator.bind_group("gs4d pixel", layout, &resources)
}

/// Returns the bytes of a texture without mip levels.
pub(super) fn texture_bytes(texture: &wgpu::Texture) -> u64 {
    let texel = texture.format().block_copy_size(None).unwrap_or(0);
    u64::from(texture.width()) * u64::from(texture.height()) * u64::from(texel)
}
