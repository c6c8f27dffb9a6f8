//! The uniforms of a frame.
//!
//! In: a prepared view, its instances, its parameters and the environment map. Out: the uniform buffers of the frame, of the parts of its
//! instances and of its motions.

use super::parameters::{Instance, ViewParameters};
use super::view_renderer::ViewRenderer;
use crate::renderer::active::drawn_count;
use crate::renderer::layout::{self, INSTANCE_STRIDE};
use crate::renderer::tile_bins::per_thread;
use crate::view::{Appearance, Background, View, tiles};

impl ViewRenderer {
    pub(super) fn write_uniforms(
        &mut self,
        queue: &wgpu::Queue,
        instances: &[Instance<'_>],
        parameters: &ViewParameters<'_>,
        environment: Option<(View, Appearance, [u32; 2])>,
    ) {
        let mut uniforms = std::mem::take(&mut self.instance_uniforms);
        uniforms.clear();
        let Some(made) = &self.resources else { return };
        let mut slot = 0;
        let mut index = 0;
        for instance in instances {
            let ViewParameters { blend_space, debug, .. } = *parameters;
            let view = layout::InstanceUniforms::new(&instance.view, &instance.appearance, blend_space, debug);
            let capture = instance.capture.instance(&view);
            let mut first_listed = 0;
            for part in 0..instance.capture.parts.len() {
                let count = drawn_count(instance.capture, part, instance.active);
                let listed = u32::from(instance.active.is_some());
                let binning = self.bins.uniform(&made.sizes, self.picture, index);
                let per_thread = per_thread(count);
                let uniform = layout::InstanceUniforms {
                    first_slot: slot,
                    count,
                    listed,
                    first_listed,
                    per_thread,
                    binning,
                    ..capture
                };
                uniforms.extend_from_slice(bytemuck::bytes_of(&uniform));
                uniforms.resize(uniforms.len().next_multiple_of(INSTANCE_STRIDE as usize), 0);
                slot += count;
                first_listed += count;
                index += 1;
            }
        }
        queue.write_buffer(&made.instances, 0, &uniforms);
        let (mode, color) = match (parameters.background, environment) {
            (Background::Color(color), _) => (layout::BACKGROUND_COLOR, color),
            (Background::Environment, Some((view, ..))) if !view.orthographic => {
                (layout::BACKGROUND_ENVIRONMENT, [0.0; 3])
            }
            _ => (layout::BACKGROUND_NONE, [0.0; 3]),
        };
        let (view, appearance, environment_size) = environment.unwrap_or_else(|| {
            let view = View::new(self.picture, 0.0, glam::Mat4::IDENTITY, glam::Vec4::ONE, glam::Vec2::ONE);
            (instances.first().map_or(view, |instance| instance.view), Appearance::default(), [0; 2])
        });
        let color = if mode == layout::BACKGROUND_ENVIRONMENT { appearance.light.to_array() } else { color };
        let to_world = view.world_to_camera.inverse();
        let column = |axis: usize| to_world.col(axis).truncate().extend(view.camera_position[axis]).to_array();
        let opaque = parameters.opaque.as_ref();
        let frame = layout::FrameUniforms {
            size: self.picture.to_array(),
            tiles: tiles(self.picture).to_array(),
            slots: self.slots,
            pair_capacity: made.sizes.pairs,
            background_mode: mode,
            opaque_samples: opaque.map_or(0, |depth| depth.samples),
            // With opaque depth the picture is composited later: the environment map must hide the surfaces behind it.
            background: [color[0], color[1], color[2], if opaque.is_some() { 0.0 } else { 1.0 }],
            projection: view.projection.to_array(),
            world_x: column(0),
            world_y: column(1),
            world_z: column(2),
            environment_size,
            opaque_origin: opaque.map_or([0; 2], |depth| depth.origin.to_array()),
            opaque_distance: opaque.map_or([0.0; 4], |depth| depth.distance),
            environment_lighting: layout::lighting_mode(&appearance, parameters.blend_space),
            debug: layout::debug_mode(parameters.debug),
            // A depth of two capture units.
            debug_depth: 2.0 * view.world_to_camera.row(2).truncate().length(),
            environment_opacity: appearance.opacity.clamp(0.0, 1.0),
            binning: self.bins.uniform(&made.sizes, self.picture, 0),
        };
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        if let Some(motion) = &self.motion {
            motion.write(queue, &frame, instances, parameters.previous.unwrap_or_default());
        }
        self.instance_uniforms = uniforms;
    }
}
