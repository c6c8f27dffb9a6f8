//! Extract: copies the boxes and shading of captures, and finds the cameras with fog.
//!
//! In (main world): captures with their boxes, [`ReceivesShadows`], Bevy's `NotShadowReceiver` and [`CaptureLight`];
//! cameras with `DistanceFog`. Out (render world): [`ExtractedShading`] and [`ShadeRequests`], by main-world entity.

use super::components::{CaptureLight, ReceivesShadows};
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, StreamedPicture};
use crate::plugin::pbr::shadow::CastsShadows;
use crate::plugin::render::views::shade_requests::ShadeRequests;
use bevy::asset::Assets;
use bevy::camera::Camera3d;
use bevy::camera::primitives::Aabb;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{Has, Or, With};
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::pbr::{DistanceFog, MeshPipelineViewLayouts};
use bevy::render::Extract;
use bevy::render::sync_world::{MainEntity, MainEntityHashMap};
use bevy::transform::components::GlobalTransform;
use glam::{Affine3A, Vec3, Vec3A};

/// The captures of this frame, if any capture is shaded. The memory is kept from frame to frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedShading(pub(super) MainEntityHashMap<PlacedShading>);

/// The box of a capture and its shading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlacedShading {
    /// Transform from world space that maps the capture's box to the cube from −1 to 1; `None` if the capture surrounds
    /// every camera or is not drawn.
    pub(super) cube_from_world: Option<Affine3A>,
    pub(super) has_environment: bool,
    /// `None` with Bevy's `NotShadowReceiver`.
    pub(super) shadows: Option<ReceivesShadows>,
    /// Distance behind its surface over which its own shadow sets in, world units; 0 if it casts no shadow.
    pub(super) own_shadow: f32,
    pub(super) light: Option<CaptureLight>,
}

impl PlacedShading {
    /// Returns whether shadows or light change it, not only fog.
    pub(super) fn is_shaded(&self) -> bool {
        self.shadows.is_some() || self.light.is_some()
    }
}

type Placed = (
    Entity,
    &'static GaussianCapture3d,
    &'static GlobalTransform,
    Option<&'static Aabb>,
    Option<&'static ReceivesShadows>,
    Has<NotShadowReceiver>,
    Option<(&'static CastsShadows, Has<NotShadowCaster>)>,
    Option<&'static CaptureLight>,
    Option<&'static StreamedPicture>,
);

/// Returns whether a capture or camera of the main world needs shading, or needed it in the previous frame.
pub(super) fn any_shading(
    captures: Extract<Query<(), Or<(With<ReceivesShadows>, With<CaptureLight>)>>>,
    foggy: Extract<Query<(), (With<DistanceFog>, With<Camera3d>)>>,
    requests: Res<ShadeRequests>,
) -> bool {
    !(captures.is_empty() && foggy.is_empty() && requests.cameras.is_empty() && requests.captures.is_empty())
}

pub(super) fn extract_shading(
    lit: Option<Res<MeshPipelineViewLayouts>>,
    mut extracted: ResMut<ExtractedShading>,
    mut requests: ResMut<ShadeRequests>,
    assets: Extract<Res<Assets<GaussianCapture>>>,
    captures: Extract<Query<Placed>>,
    foggy: Extract<Query<Entity, (With<DistanceFog>, With<Camera3d>)>>,
) {
    extracted.0.clear();
    requests.cameras.clear();
    requests.captures.clear();
    // Without Bevy's `PbrPlugin` the pass has no pipeline.
    if lit.is_none() {
        return;
    }
    requests.cameras.extend(foggy.iter().map(MainEntity::from));
    for (entity, capture, transform, bounds, shadows, is_no_receiver, casts, light, picture) in &captures {
        let Some(asset) = assets.get(&capture.0) else { continue };
        let placed = PlacedShading {
            cube_from_world: bounds.and_then(|bounds| cube_from_world(bounds, transform.affine())),
            has_environment: asset.scene().environment.is_some(),
            shadows: shadows.copied().filter(|_| !is_no_receiver),
            own_shadow: match casts {
                Some((casts, false)) => {
                    casts.distance(picture.map_or(asset.extent(), |picture| picture.extent), &transform.affine())
                }
                Some((_, true)) | None => 0.0,
            },
            light: light.copied(),
        };
        if placed.is_shaded() {
            requests.captures.insert(entity.into());
        }
        extracted.0.insert(entity.into(), placed);
    }
}

/// Returns the transform from world space that maps a box in capture space to the cube from −1 to 1; `None` for a
/// flattened or invalid transform.
fn cube_from_world(bounds: &Aabb, world_from_capture: Affine3A) -> Option<Affine3A> {
    // A flattened capture is not drawn, and its transform has no inverse.
    if world_from_capture.matrix3.determinant() == 0.0 {
        return None;
    }
    // A flat box must not divide by zero.
    let scale = bounds.half_extents.max(Vec3A::splat(1e-6)).recip();
    let cube_from_capture =
        Affine3A::from_scale(Vec3::from(scale)) * Affine3A::from_translation(Vec3::from(-bounds.center));
    let cube = cube_from_capture * world_from_capture.inverse();
    cube.is_finite().then_some(cube)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn corners_of_a_placed_box_map_to_corners_of_the_cube() {
        let bounds = Aabb::from_min_max(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 2.5));
        let world_from_capture = Affine3A::from_scale_rotation_translation(
            Vec3::new(2.0, 1.0, 0.5),
            Quat::from_rotation_y(0.7),
            Vec3::new(5.0, -1.0, 2.0),
        );
        let cube = cube_from_world(&bounds, world_from_capture).expect("not flat");
        let corner = |point| cube.transform_point3(world_from_capture.transform_point3(point));
        assert!(corner(Vec3::new(-1.0, 0.0, 2.0)).abs_diff_eq(-Vec3::ONE, 1e-4), "the lowest corner maps to -1");
        assert!(corner(Vec3::new(3.0, 1.0, 2.5)).abs_diff_eq(Vec3::ONE, 1e-4), "the highest corner maps to 1");
    }

    #[test]
    fn an_invalid_transform_has_no_cube() {
        let bounds = Aabb::from_min_max(Vec3::ZERO, Vec3::ONE);
        assert_eq!(
            cube_from_world(&bounds, Affine3A::from_translation(Vec3::NAN)),
            None,
            "a translation of NaN has no cube"
        );
        assert_eq!(
            cube_from_world(&bounds, Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))),
            None,
            "a flattened box has no cube"
        );
    }
}
