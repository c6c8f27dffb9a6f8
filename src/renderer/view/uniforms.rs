//! The uniforms of a frame.
//!
//! In: a prepared view, its instances, its parameters and the environment map. Out: the uniform buffers of the frame, of the parts of its
//! instances and of its motions.

use super::view_renderer::ViewRenderer;
use crate::renderer::frame::Preparation;
use crate::renderer::frame::ViewParameters;
use crate::renderer::layout::{self, FrameUniforms, INSTANCE_STRIDE, InstanceUniforms};
use crate::view::{Appearance, Background, View, tiles};
use glam::{Mat4, Vec2, Vec4};

impl ViewRenderer {
    /// Writes the uniforms of the parts of instances.
    pub(super) fn write_instances(&mut self, frame: &Preparation<'_>, parameters: &ViewParameters<'_>) {
        let Self { resources: Some(made), instance_uniforms: uniforms, design, .. } = self else { return };
        uniforms.clear();
        let (mut slot, mut index) = (0, 0);
        for instance in frame.instances {
            let ViewParameters { blend_space, debug, .. } = *parameters;
            let capture = instance.capture;
            let seen = capture.settings.in_view(&instance.view, &instance.appearance, blend_space, debug);
            let (listed, first_listed) = instance.active.map_or((0, 0), |active| (1, active.first()));
            let middle = capture.middle(seen.camera_z);
            let mut own = InstanceUniforms { listed, first_listed, middle, ..seen };
            for part in 0..capture.parts.len() {
                own.first_slot = slot;
                own.count = instance.drawn(part);
                (own.per_thread, own.binning) = design.of_part(index, own.count);
                uniforms.extend_from_slice(bytemuck::bytes_of(&own));
                uniforms.resize(uniforms.len().next_multiple_of(INSTANCE_STRIDE as usize), 0);
                slot += own.count;
                own.first_listed += instance.listed(part);
                index += 1;
            }
        }
        frame.queue.write_buffer(&made.instances, 0, uniforms);
    }

    /// Writes the uniforms of a frame, and of its motions.
    pub(super) fn write_frame(&self, frame: &Preparation<'_>, parameters: &ViewParameters<'_>) {
        let Preparation { queue, instances, .. } = *frame;
        let around = instances.iter().find_map(|i| Some((i.view, i.appearance, i.capture.environment.as_ref()?.size)));
        let (mode, color) = match (parameters.background, around) {
            (Background::Color(color), _) => (layout::BACKGROUND_COLOR, color),
            (Background::Environment, Some((view, appearance, _))) if !view.orthographic => {
                (layout::BACKGROUND_ENVIRONMENT, appearance.light.to_array())
            }
            _ => (layout::BACKGROUND_NONE, [0.0; 3]),
        };
        let (view, appearance, environment_size) = around.unwrap_or_else(|| {
            let view = View::new(self.picture, 0.0, Mat4::IDENTITY, Vec4::ONE, Vec2::ONE);
            (instances.first().map_or(view, |instance| instance.view), Appearance::default(), [0; 2])
        });
        let to_world = view.world_to_camera.inverse();
        let column = |axis: usize| to_world.col(axis).truncate().extend(view.camera_position[axis]).to_array();
        let opaque = parameters.opaque.as_ref();
        let uniforms = FrameUniforms {
            size: self.picture.to_array(),
            tiles: tiles(self.picture).to_array(),
            slots: self.slots,
            pair_capacity: self.pair_capacity(),
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
            binning: self.design.of_part(0, 0).1,
        };
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&uniforms));
        if let Some(motion) = &self.motion {
            motion.write(frame, &uniforms, parameters.previous.unwrap_or_default());
        }
    }
}
