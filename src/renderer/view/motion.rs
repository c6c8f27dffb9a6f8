//! Motions: how far what a view shows has moved on the screen since the frame before.
//!
//! In: a prepared view, and the view of each instance one frame before. Out: [`MotionResources`], and two dispatches at the end of the frame:
//! `motion` puts the motions of splats in place of their colors, which have been blended, and the last pass of the design blends them into
//! a target of their own, over the same lists. Without views of the frame before there are neither.

use super::record::mark;
use super::resources::{Resources, pixel_group, texture_bytes};
use super::{Design, Instance, ViewParameters, ViewRenderer};
use crate::renderer::GpuError;
use crate::renderer::active::drawn_count;
use crate::renderer::layout::{
    BACKGROUND_NONE, DEBUG_COLOR, FrameUniforms, INSTANCE_STRIDE, INSTANCES_BOUND, MotionUniforms,
};
use crate::renderer::memory::Allocator;
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::FastVariant;
use crate::renderer::timing::PassTimer;
use crate::view::{DebugView, View, tiles};
use std::num::NonZeroU64;
use wgpu::{BindingResource, BufferUsages};

/// Gaussians of a workgroup.
const GROUP: u32 = 256;
/// The largest number of workgroups of the fast design, which go on until all visible splats have a motion: enough for any GPU.
const MOST_GROUPS: u32 = 4096;

/// The target of motions, and what its passes bind.
#[derive(Debug)]
pub(super) struct MotionResources {
    pub texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    /// The values of the frame, without background and debug view.
    frame: wgpu::Buffer,
    /// One [`MotionUniforms`] for each part, as far apart as the uniforms of instances.
    before: wgpu::Buffer,
    /// Bind groups of even and of odd frames.
    motion: [wgpu::BindGroup; 2],
    pixel: wgpu::BindGroup,
    /// What the bind group of the pixels was created for.
    opaque: wgpu::TextureView,
    environment: wgpu::Buffer,
    /// How the fast design blends motions: without depths.
    variant: FastVariant,
}

impl ViewRenderer {
    /// Returns the names of the passes that are timed.
    pub(super) fn timed_passes(&self) -> &'static [&'static str] {
        self.design.timed_passes(self.motion.is_some())
    }

    /// Creates what the motions of a frame need, unless it has been; releases it if the frame has none.
    pub(super) fn prepare_motion(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        instances: &[Instance<'_>],
        parameters: &ViewParameters<'_>,
    ) -> Result<(), GpuError> {
        let known = self.motion.take();
        if parameters.previous.is_some() {
            let storages = instances.iter().map(|instance| instance.capture.storage);
            renderer.compile_motion(device, storages, self.design)?;
            let color = ViewParameters { depths: false, debug: DebugView::Color, ..*parameters };
            let variant = FastVariant { blending: color.blending(), ..self.variant };
            if self.design == Design::Fast {
                renderer.compile_fast(device, std::iter::empty(), variant)?;
            }
            if let Some(made) = &self.resources {
                let allocator = renderer.allocator(device);
                let mut motion = known.unwrap_or_else(|| self.make_motion(renderer, allocator, made, variant));
                motion.variant = variant;
                if motion.opaque != made.opaque || motion.environment != made.environment {
                    motion.pixel = motion_pixel(renderer, allocator, made, &motion.frame, &motion.view);
                    (motion.opaque, motion.environment) = (made.opaque.clone(), made.environment.clone());
                }
                self.motion = Some(motion);
            }
        }
        // Frames with motions have more passes.
        if self.timing.as_ref().is_some_and(|(timer, _)| timer.passes() != self.timed_passes()) {
            self.measure(device, queue, renderer, false);
            self.measure(device, queue, renderer, true);
        }
        Ok(())
    }

    fn make_motion(
        &self,
        renderer: &Renderer,
        allocator: Allocator<'_>,
        made: &Resources,
        variant: FastVariant,
    ) -> MotionResources {
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
        let splats = made.buffers.splats.as_entire_binding();
        let group = |index: usize, buffers: &[BindingResource<'_>]| {
            let resources = [&uniforms[..], buffers].concat();
            allocator.bind_group("gs4d motion", &renderer.layouts.motion[index], &resources)
        };
        let motion = match &made.fast {
            Some(fast) => fast.bins.each_ref().map(|bins| {
                let [bins, visible] = [bins, &fast.visible].map(wgpu::Buffer::as_entire_binding);
                group(1, &[bins, visible, splats.clone(), fast.splat_colors.as_entire_binding()])
            }),
            None => {
                let group = group(0, &[made.buffers.depth_keys.as_entire_binding(), splats]);
                [group.clone(), group]
            }
        };
        let pixel = motion_pixel(renderer, allocator, made, &frame, &view);
        let (opaque, environment) = (made.opaque.clone(), made.environment.clone());
        MotionResources { texture, view, frame, before, motion, pixel, opaque, environment, variant }
    }

    /// Records the passes of motions, after all others of the frame, if it has motions.
    pub(super) fn record_motion(
        &self,
        renderer: &Renderer,
        made: &Resources,
        pass: &mut wgpu::ComputePass<'_>,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        let Some(motion) = &self.motion else { return };
        let (blend, lists) = match &made.fast {
            Some(fast) => (renderer.blend_blocks(motion.variant), &fast.blend_blocks),
            None => (renderer.blend(self.pixels), &made.blend),
        };
        let Some(blend) = blend else { return };
        // motion
        let most = if made.fast.is_some() { MOST_GROUPS } else { u32::MAX };
        let mut index = 0;
        for instance in instances {
            let Some(pipeline) = renderer.motion(instance.capture.storage, self.design) else { continue };
            pass.set_pipeline(pipeline);
            pass.set_bind_group(2, instance.active.map_or(&renderer.no_list, |active| &active.list), &[]);
            for (at, part) in instance.capture.parts.iter().enumerate() {
                let offset = index * INSTANCE_STRIDE;
                pass.set_bind_group(0, &motion.motion[usize::from(self.odd)], &[offset, offset]);
                pass.set_bind_group(1, &part.geometry, &[]);
                let count = drawn_count(instance.capture, at, instance.active);
                pass.dispatch_workgroups(count.div_ceil(GROUP).min(most), 1, 1);
                index += 1;
            }
        }
        mark(timer, pass);

        // blend or blend_blocks. The former writes the depths once more, the same.
        let tiles = tiles(self.picture);
        pass.set_pipeline(blend);
        pass.set_bind_group(0, &motion.pixel, &[]);
        pass.set_bind_group(1, lists, &[]);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        mark(timer, pass);
    }
}

impl MotionResources {
    /// Returns the bytes of the target.
    pub fn bytes(&self) -> u64 {
        texture_bytes(&self.texture)
    }

    /// Writes the uniforms, given those of the frame for colors.
    pub fn write(&self, queue: &wgpu::Queue, frame: &FrameUniforms, instances: &[Instance<'_>], previous: &[View]) {
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
