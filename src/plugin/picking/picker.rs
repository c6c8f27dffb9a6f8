//! The picker: rays of the world against captures where they are.
//!
//! In: the components of captures, their assets. Out: [`CapturePicker`], a system parameter.

use crate::gaussian::projection::ALPHA_MIN;
use crate::plugin::asset::GaussianCapture;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::playback::{ClipFade, Playback};
use crate::plugin::render::CaptureSettings;
use crate::scene::PickSettings;
use bevy::asset::Assets;
use bevy::camera::visibility::InheritedVisibility;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::ROQueryItem;
use bevy::ecs::system::{Query, Res, SystemParam};
use bevy::math::Ray3d;
use bevy::transform::components::GlobalTransform;
use glam::Vec3;

/// What a ray hits of a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CaptureHit {
    /// The entity with the capture.
    pub entity: Entity,
    /// Index of the Gaussian in the capture's [scene](GaussianCapture::scene).
    pub gaussian: usize,
    /// From the ray's origin, world units.
    pub distance: f32,
    /// Where on the ray that is, in the world.
    pub point: Vec3,
}

/// Casts rays at captures: `fn system(picker: CapturePicker)`.
///
/// Transforms are those of [`GlobalTransform`], which Bevy brings up to date in `PostUpdate`. The parameter reads [`Playback`],
/// [`CaptureSettings`] and transforms of captures: to change them in the same system, use a `ParamSet`.
#[derive(SystemParam)]
pub struct CapturePicker<'w, 's> {
    assets: Res<'w, Assets<GaussianCapture>>,
    captures: Query<'w, 's, Placed>,
}

type Placed = (
    Entity,
    &'static GaussianCapture3d,
    &'static CaptureSettings,
    &'static Playback,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static ClipFade>,
);

impl CapturePicker<'_, '_> {
    /// What the ray hits first, of all captures that are loaded and not hidden (whether any camera sees them or not). Each
    /// capture is taken alone: two that only together hold back half of the light are passed.
    pub fn cast(&self, ray: Ray3d) -> Option<CaptureHit> {
        let mut nearest: Option<CaptureHit> = None;
        for placed in self.captures.iter().filter(|(.., visibility, _)| visibility.get()) {
            let limit = nearest.map_or(f32::INFINITY, |hit| hit.distance);
            nearest = self.cast_within(placed, ray, limit).or(nearest);
        }
        nearest
    }

    /// What the ray hits of one capture, hidden or not. What has a scale of 0 is not hit.
    pub fn cast_on(&self, entity: Entity, ray: Ray3d) -> Option<CaptureHit> {
        self.cast_within(self.captures.get(entity).ok()?, ray, f32::INFINITY)
    }

    fn cast_within(
        &self,
        (entity, handle, settings, playback, transform, _, fade): ROQueryItem<'_, '_, Placed>,
        ray: Ray3d,
        limit: f32,
    ) -> Option<CaptureHit> {
        let capture = self.assets.get(&handle.0)?;
        let appearance = settings.appearance(fade.copied().unwrap_or_default().0);
        let affine = transform.affine();
        if affine.matrix3.determinant() == 0.0 {
            return None;
        }
        // Lengths along the ray are the same in the world and, in lengths of its direction, in the capture.
        let from_world = affine.inverse();
        let origin = from_world.transform_point3(ray.origin);
        let direction = from_world.transform_vector3(*ray.direction);
        let bounds = capture.bounds_at(playback.time)?.scaled(reach(appearance.opacity));
        bounds.entry(origin, direction).filter(|&entry| entry <= limit)?;
        let settings = PickSettings {
            time: capture.time_at(playback.time),
            use_filter: settings.filter,
            opacity: appearance.opacity,
            crop: appearance.crop,
            max_distance: limit,
            ..PickSettings::default()
        };
        let pick = capture.scene().pick(origin, direction, &settings)?;
        let point = ray.get_point(pick.distance);
        Some(CaptureHit { entity, gaussian: pick.gaussian, distance: pick.distance, point })
    }
}

/// How much farther than three standard deviations, which bounds hold, an alpha can reach 1/255: to `sqrt(2 ln(255 opacity))`, 3.33 for
/// a peak of 1. A box that holds three of every Gaussian in it, scaled by this, holds so many of each.
fn reach(opacity: f32) -> f32 {
    (2.0 * (opacity.max(1.0) / ALPHA_MIN).ln()).sqrt() / 3.0
}
