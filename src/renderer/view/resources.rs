//! The resources of a view whose sizes depend on the view or the captures, and the bind groups over them.
//!
//! In: buffers and textures. Out: [`Resources`], which are created again only when the sizes change. Another opaque depth or environment map
//! replaces only the bind group of the pixels.

use super::bins::FastResources;
use super::sizes::Sizes;
use crate::renderer::layout::DIGIT_BITS;
use crate::renderer::layouts::Layouts;
use crate::renderer::memory::Allocator;
use crate::renderer::shaders::Pixels;
use crate::view::tiles;
use glam::UVec2;

/// Sized resources and the bind groups over them.
#[derive(Debug)]
pub(super) struct Resources {
    pub sizes: Sizes,
    /// Bytes of storage buffers and targets.
    pub bytes: u64,
    pub instances: wgpu::Buffer,
    /// Buffers that later passes, such as `score`, can read.
    pub buffers: PassBuffers,
    pub color: wgpu::Texture,
    pub color_view: wgpu::TextureView,
    pub depth: wgpu::Texture,
    pub depth_view: wgpu::TextureView,
    /// Opaque depth and environment map of the bind group of the pixels, and the variant of the pixel passes that write the targets.
    pub opaque: wgpu::TextureView,
    pub environment: wgpu::Buffer,
    pub pixels: Pixels,
    pub project: wgpu::BindGroup,
    /// Bind groups of the steps: from the projected keys into the first pair of buffers, from the first into the second, and back.
    pub sort_depth: [wgpu::BindGroup; 3],
    pub sort_tiles: [wgpu::BindGroup; 2],
    pub arguments: wgpu::BindGroup,
    pub bin: wgpu::BindGroup,
    pub ranges: wgpu::BindGroup,
    pub pixel: wgpu::BindGroup,
    pub blend: wgpu::BindGroup,
    /// Buffers and bind groups of the fast design.
    pub fast: Option<FastResources>,
}

/// Storage buffers of a frame that a later pass can read.
#[derive(Debug)]
pub struct PassBuffers {
    /// First and last + 1 pair of each tile, two words each.
    pub tile_ranges: wgpu::Buffer,
    /// Splat of each pair, ordered by tile, then depth.
    pub pair_splats: wgpu::Buffer,
    /// One [`SplatRecord`](crate::renderer::layout::SplatRecord) for each slot.
    pub splats: wgpu::Buffer,
    /// Slots of the visible splats, by depth.
    pub order: wgpu::Buffer,
    /// First pair of each visible splat, by depth.
    pub offsets: wgpu::Buffer,
    /// Depth key of each slot; [`INVISIBLE`](crate::renderer::layout::INVISIBLE) for a slot without a splat.
    pub depth_keys: wgpu::Buffer,
}

impl Resources {
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
    let [opaque, color, depth] = views.map(wgpu::BindingResource::TextureView);
    let resources = [frame.as_entire_binding(), environment.as_entire_binding(), opaque, color, depth];
    allocator.bind_group("gs4d pixel", layout, &resources)
}

/// Returns the bytes of a texture without mip levels.
pub(super) fn texture_bytes(texture: &wgpu::Texture) -> u64 {
    let texel = texture.format().block_copy_size(None).unwrap_or(0);
    u64::from(texture.width()) * u64::from(texture.height()) * u64::from(texel)
}

/// Returns the number of steps of the sort by tile.
pub(super) fn tile_steps(size: UVec2) -> u32 {
    let tiles = tiles(size);
    (u32::BITS - (tiles.x * tiles.y - 1).leading_zeros()).div_ceil(DIGIT_BITS)
}
