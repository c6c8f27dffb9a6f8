//! The resources of motions: the screen-space motion of each pixel since the previous frame.
//!
//! In: the resources of a view, and the view of each instance in the previous frame. Out: [`MotionResources`]: the target of motions, its
//! uniforms and its bind groups. Frames without views of the previous frame have no motions.

use super::parameters::Instance;
use super::resources::{DesignBuffers, Resources, pixel_group, texture_bytes};
use crate::renderer::layout::{
    BACKGROUND_NONE, DEBUG_COLOR, FrameUniforms, INSTANCE_STRIDE, INSTANCES_BOUND, MotionUniforms,
};
use crate::renderer::memory::Allocator;
use crate::renderer::pipelines::Renderer;
use crate::renderer::tile_bins::BinVariant;
use crate::view::View;
use std::num::NonZeroU64;
use wgpu::{BindingResource, BufferUsages};

/// The target of motions, and the bind groups of its passes.
#[derive(Debug)]
pub(super) struct MotionResources {
    pub texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    /// The uniforms of the frame, without background and debug view.
    frame: wgpu::Buffer,
    /// One [`MotionUniforms`] for each part, with the stride of the uniforms of instances.
    before: wgpu::Buffer,
    /// Bind groups of even and of odd frames.
    pub motion: [wgpu::BindGroup; 2],
    pub pixel: wgpu::BindGroup,
    /// Opaque depth and environment map of the bind group of the pixels.
    opaque: wgpu::TextureView,
    environment: wgpu::Buffer,
    /// The variant with which tile bins blend motions: without depths.
    pub variant: BinVariant,
}

impl MotionResources {
    /// Creates the target of motions, its uniforms and its bind groups.
    pub(super) fn new(renderer: &Renderer, allocator: Allocator<'_>, made: &Resources, variant: BinVariant) -> Self {
        let parts = u64::from(made.sizes.parts) * u64::from(INSTANCE_STRIDE);
        let before = allocator.buffer("gs4d frame before", parts, BufferUsages::UNIFORM);
        let frame = allocator.buffer("gs4d frame of motions", size_of::<FrameUniforms>() as u64, BufferUsages::UNIFORM);
        let texture = allocator.texture("gs4d motion", made.sizes.picture, made.pixels.precision.format());
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let uniform = |buffer, size: usize| {
            let size = NonZeroU64::new(size as u64);
            BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size })
        };
        let instance = uniform(&made.instances, INSTANCES_BOUND as usize);
        let uniforms = [instance, uniform(&before, size_of::<MotionUniforms>())];
        let motion = match &made.buffers {
            DesignBuffers::TileBins(buffers) => buffers.motion(allocator, &renderer.layouts, &uniforms),
            DesignBuffers::GlobalSort(buffers) => {
                let group = buffers.motion(allocator, &renderer.layouts, &uniforms);
                [group.clone(), group]
            }
        };
        let pixel = motion_pixel(renderer, allocator, made, &frame, &view);
        let (opaque, environment) = (made.opaque.clone(), made.environment.clone());
        Self { texture, view, frame, before, motion, pixel, opaque, environment, variant }
    }

    /// Sets the variant that blends motions, and binds the opaque depth and the environment map of the frame, unless they are bound.
    pub(super) fn update(
        &mut self,
        renderer: &Renderer,
        allocator: Allocator<'_>,
        made: &Resources,
        variant: BinVariant,
    ) {
        self.variant = variant;
        if self.opaque != made.opaque || self.environment != made.environment {
            self.pixel = motion_pixel(renderer, allocator, made, &self.frame, &self.view);
            (self.opaque, self.environment) = (made.opaque.clone(), made.environment.clone());
        }
    }

    /// Returns the bytes of the target.
    pub(super) fn bytes(&self) -> u64 {
        texture_bytes(&self.texture)
    }

    /// Writes the uniforms, given the uniforms `frame` of the frame and the `previous` views.
    pub(super) fn write(
        &self,
        queue: &wgpu::Queue,
        frame: &FrameUniforms,
        instances: &[Instance<'_>],
        previous: &[View],
    ) {
        let frame = FrameUniforms { background_mode: BACKGROUND_NONE, debug: DEBUG_COLOR, ..*frame };
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let mut uniforms = Vec::new();
        for (index, instance) in instances.iter().enumerate() {
            let known = previous.get(index).filter(|view| view.orthographic == instance.view.orthographic);
            let before = MotionUniforms::new(known.unwrap_or(&instance.view));
            for _ in &instance.capture.parts {
                uniforms.extend_from_slice(bytemuck::bytes_of(&before));
                uniforms.resize(uniforms.len().next_multiple_of(INSTANCE_STRIDE as usize), 0);
            }
        }
        queue.write_buffer(&self.before, 0, &uniforms);
    }
}

/// Creates the bind group of the pixels of motions.
fn motion_pixel(
    renderer: &Renderer,
    allocator: Allocator<'_>,
    made: &Resources,
    frame: &wgpu::Buffer,
    view: &wgpu::TextureView,
) -> wgpu::BindGroup {
    let layout = &renderer.layouts.pixel[made.pixels.index()];
    pixel_group(allocator, layout, frame, &made.environment, [&made.opaque, view, &made.depth_view])
}
