//! The screen-space motion of each pixel since the previous frame.
//!
//! In: the resources of a view, and the view of each instance in the previous frame. Out: [`MotionResources`]: the target of motions, its
//! uniforms and its bind groups. At the end of the frame `motion` replaces the colors of splats by their motions, and `blend` or `blend_blocks`
//! blends them into the target. Frames without views of the previous frame have no motions.

use super::resources::{Resources, pixel_group};
use crate::renderer::frame::{Preparation, ViewDesign};
use crate::renderer::layout::{
    BACKGROUND_NONE, DEBUG_COLOR, FrameUniforms, INSTANCE_STRIDE, INSTANCES_BOUND, MotionUniforms,
};
use crate::view::View;
use std::num::NonZeroU64;
use wgpu::{BindGroup, BindingResource, BufferUsages, TextureView, TextureViewDescriptor};

/// The target of motions, and the bind groups of its passes.
#[derive(Debug)]
pub(super) struct MotionResources {
    pub texture: wgpu::Texture,
    pub view: TextureView,
    /// The uniforms of the frame, without background and debug view.
    frame: wgpu::Buffer,
    /// One [`MotionUniforms`] for each part, with the stride of the uniforms of instances.
    before: wgpu::Buffer,
    /// Bind groups of `motion` of even and of odd frames.
    pub motion: [BindGroup; 2],
    pub pixel: BindGroup,
    /// Opaque depth and environment map of the bind group of the pixels.
    opaque: TextureView,
    environment: wgpu::Buffer,
}

impl MotionResources {
    /// Creates the target of motions, its uniforms and its bind groups; `None` if the design has no buffers.
    pub(super) fn new(preparation: &Preparation<'_>, made: &Resources, design: &dyn ViewDesign) -> Option<Self> {
        let allocator = preparation.allocator();
        let parts = u64::from(made.sizes.parts) * u64::from(INSTANCE_STRIDE);
        let before = allocator.buffer("gs4d frame before", parts, BufferUsages::UNIFORM);
        let frame = allocator.buffer("gs4d frame of motions", size_of::<FrameUniforms>() as u64, BufferUsages::UNIFORM);
        let texture = allocator.texture("gs4d motion", made.sizes.picture, made.pixels.precision.format());
        let view = texture.create_view(&TextureViewDescriptor::default());
        let uniform = |buffer, size: usize| {
            let size = NonZeroU64::new(size as u64);
            BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size })
        };
        let instance = uniform(&made.instances, INSTANCES_BOUND as usize);
        let motion = design.motion_groups(preparation, &[instance, uniform(&before, size_of::<MotionUniforms>())])?;
        let (opaque, environment) = (made.opaque.clone(), made.environment.clone());
        let views = [&opaque, &view, &made.depth_view];
        let pixel = pixel_group(preparation, made.pixels, &frame, &environment, views);
        Some(Self { texture, view, frame, before, motion, pixel, opaque, environment })
    }

    /// Binds the opaque depth and the environment map of the frame, unless they are bound.
    pub(super) fn update(&mut self, preparation: &Preparation<'_>, made: &Resources) {
        if self.opaque != made.opaque || self.environment != made.environment {
            let views = [&made.opaque, &self.view, &made.depth_view];
            self.pixel = pixel_group(preparation, made.pixels, &self.frame, &made.environment, views);
            (self.opaque, self.environment) = (made.opaque.clone(), made.environment.clone());
        }
    }

    /// Writes the uniforms, given the `uniforms` of the frame and the `previous` views.
    pub(super) fn write(&self, frame: &Preparation<'_>, uniforms: &FrameUniforms, previous: &[View]) {
        let uniforms = FrameUniforms { background_mode: BACKGROUND_NONE, debug: DEBUG_COLOR, ..*uniforms };
        frame.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&uniforms));
        let mut uniforms = Vec::new();
        for (index, instance) in frame.instances.iter().enumerate() {
            let known = previous.get(index).filter(|view| view.orthographic == instance.view.orthographic);
            let before = MotionUniforms::new(known.unwrap_or(&instance.view));
            for _ in &instance.capture.parts {
                uniforms.extend_from_slice(bytemuck::bytes_of(&before));
                uniforms.resize(uniforms.len().next_multiple_of(INSTANCE_STRIDE as usize), 0);
            }
        }
        frame.queue.write_buffer(&self.before, 0, &uniforms);
    }
}
