//! Extract: copies the contact shadows of this frame.
//!
//! In (main world): captures with a [`CaptureContactShadow`], their bounds, visibility, layers and ranges. Out (render
//! world): [`ExtractedContactShadows`].

use super::component::{CaptureContactShadow, Ellipse};
use crate::plugin::asset::CaptureState;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::pbr::in_range::{InRange, Ranges};
use crate::plugin::playback::ClipFade;
use crate::plugin::render::CaptureSettings;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::render::Extract;
use bevy::transform::components::GlobalTransform;
use glam::Affine3A;

/// The contact shadows of this frame, including shadows that no camera sees. The memory is kept from frame to frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedContactShadows(pub(super) Vec<PlacedShadow>);

/// One contact shadow.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlacedShadow {
    pub(super) ellipse: Ellipse,
    /// Softness of the edge, from 0 to 1.
    pub(super) softness: f32,
    pub(super) layers: RenderLayers,
    pub(super) in_range: InRange,
}

/// Returns whether any capture of the main world has a contact shadow.
pub(super) fn any_contact_shadow(captures: Extract<Query<(), With<CaptureContactShadow>>>) -> bool {
    !captures.is_empty()
}

/// Returns whether there is a contact shadow in this frame or, before the extraction, in the previous frame.
pub(super) fn any_extracted(shadows: Res<ExtractedContactShadows>) -> bool {
    !shadows.0.is_empty()
}

type Placed = (
    Entity,
    &'static CaptureContactShadow,
    &'static CaptureState,
    &'static CaptureSettings,
    Option<&'static ClipFade>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static Aabb>,
    Option<&'static RenderLayers>,
);

/// Extracts the visible contact shadows. A camera may see a shadow without its capture.
pub(super) fn extract_contact_shadows(
    mut extracted: ResMut<ExtractedContactShadows>,
    captures: Extract<Query<Placed, With<GaussianCapture3d>>>,
    ranges: Extract<Ranges>,
) {
    extracted.0.clear();
    let shadows = captures.iter().filter_map(
        |(entity, settings, state, capture, fade, transform, visibility, bounds, layers)| {
            let bounds = bounds.filter(|_| *state == CaptureState::Ready && visibility.get())?;
            let opacity = capture.appearance(fade.copied().unwrap_or_default().0).opacity.min(1.0);
            let ellipse = ellipse(settings, bounds, &transform.affine(), opacity)?;
            let (softness, layers) = (settings.softness(), layers.cloned().unwrap_or_default());
            Some(PlacedShadow { ellipse, softness, layers, in_range: ranges.of(entity) })
        },
    );
    extracted.0.extend(shadows);
}

/// Returns the ellipse beneath a capture's bounds; `None` if it is not visible.
fn ellipse(
    settings: &CaptureContactShadow,
    bounds: &Aabb,
    world_from_capture: &Affine3A,
    opacity: f32,
) -> Option<Ellipse> {
    let center = world_from_capture.transform_point3a(bounds.center);
    let half_size = world_from_capture.matrix3.abs() * bounds.half_extents;
    let ellipse = settings.beneath(center.into(), half_size.into()).filter(|_| opacity > 0.0)?;
    Some(Ellipse { strength: ellipse.strength * opacity, ..ellipse })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn the_ellipse_of_a_rotated_capture_is_flat_on_the_ground() {
        // One unit wide and long, three units high, in capture space with z up.
        let bounds = Aabb::from_min_max(Vec3::new(-0.5, -0.5, 0.0), Vec3::new(0.5, 0.5, 3.0));
        let upright = Affine3A::from_rotation_translation(Quat::from_rotation_x(-FRAC_PI_2), Vec3::new(2.0, 0.0, 1.0));
        let settings = CaptureContactShadow { softness: 0.0, ..CaptureContactShadow::default() };
        let beneath = |opacity| ellipse(&settings, &bounds, &upright, opacity);
        let ellipse = beneath(1.0).expect("an ellipse beneath a capture on the ground");
        let [middle, edge] = [Vec3::ZERO, Vec3::X].map(|at| ellipse.world_from_disk.transform_point3(at));
        assert!(
            middle.abs_diff_eq(Vec3::new(2.0, 0.0, 1.0), 0.01),
            "the ellipse is beneath the capture, not at {middle}"
        );
        assert!(
            edge.abs_diff_eq(Vec3::new(2.5, 0.0, 1.0), 0.01),
            "the ellipse is as wide as the capture, not up to {edge}"
        );
        let half = beneath(0.5).expect("an ellipse at half opacity");
        assert!(
            (half.strength - 0.5 * ellipse.strength).abs() < 1e-6,
            "the strength follows the opacity of the capture"
        );
        assert_eq!(beneath(0.0), None, "a transparent capture has no ellipse");
    }
}
