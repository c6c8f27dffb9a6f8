//! The picker: intersects rays in world space with placed captures.
//!
//! In: the components and assets of captures. Out: [`CapturePicker`], a system parameter.

use crate::gaussian::alpha::reach_squared;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
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

/// Where a ray hits a capture.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// Describes a hit. Means of Gaussians are in capture space, hit points in world space.
/// fn describe(hit: &CaptureHit, captures: &Assets<GaussianCapture>, placed: &Query<&GaussianCapture3d>) -> Option<String> {
///     let capture = captures.get(&placed.get(hit.entity).ok()?.0)?;
///     let gaussian = capture.scene().iter().nth(hit.gaussian)?;
///     Some(format!("{} away at {}: mean {:?}", hit.distance, hit.point, gaussian.mean))
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CaptureHit {
    /// The entity with the capture.
    pub entity: Entity,
    /// Index of the Gaussian in the capture's [scene](GaussianCapture::scene).
    pub gaussian: usize,
    /// Distance from the ray's origin, in world units.
    pub distance: f32,
    /// The point on the ray at this distance, in world space.
    pub point: Vec3,
}

/// Casts rays at captures: a system parameter.
///
/// [`GlobalTransform`] places the captures; Bevy updates it in `PostUpdate`. The parameter reads [`Playback`], [`CaptureSettings`] and
/// [`GlobalTransform`] of captures: to change these components in the same system, use a `ParamSet`.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// Logs the Gaussian in front of the camera.
/// fn aim(picker: CapturePicker, camera: Single<&GlobalTransform, With<Camera3d>>) {
///     let ray = Ray3d::new(camera.translation(), camera.forward());
///     if let Some(hit) = picker.cast(ray) {
///         info!("Gaussian {} of {}, {} away", hit.gaussian, hit.entity, hit.distance);
///     }
/// }
/// # bevy::ecs::system::assert_is_system(aim);
/// ```
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
    /// Returns the nearest hit among all captures that are loaded and not hidden, whether a camera sees them or not; `None` if the ray hits
    /// none. Each capture is tested alone: the ray passes through two captures that absorb half of the light only together.
    pub fn cast(&self, ray: Ray3d) -> Option<CaptureHit> {
        self.cast_through(ray, |_, visibility| visibility.get(), |_| true).first().copied()
    }

    /// Returns the hits of all captures for which `takes_part` is true, nearest first, up to and including the nearest capture for which
    /// `blocks` is true.
    pub(crate) fn cast_through(
        &self,
        ray: Ray3d,
        takes_part: impl Fn(Entity, InheritedVisibility) -> bool,
        blocks: impl Fn(Entity) -> bool,
    ) -> Vec<CaptureHit> {
        let (mut hits, mut limit) = (Vec::new(), f32::INFINITY);
        for placed in self.captures.iter().filter(|(entity, .., visibility, _)| takes_part(*entity, **visibility)) {
            let Some(hit) = self.cast_within(placed, ray, limit) else { continue };
            if blocks(hit.entity) {
                limit = hit.distance;
            }
            hits.push(hit);
        }
        hits.retain(|hit| hit.distance <= limit);
        hits.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        hits
    }

    /// Returns the hit of one capture, hidden or not; `None` if the ray misses it, it is not loaded, or its scale is 0.
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
        // A world distance equals the distance in capture space divided by the length of the transformed direction.
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

/// Returns the factor on a box of three standard deviations (as bounds are) beyond which no alpha reaches 1/255:
/// `sqrt(2 ln(255 opacity)) / 3`. The radius is 3.33 standard deviations for a peak of 1.
fn reach(opacity: f32) -> f32 {
    reach_squared(opacity.max(1.0)).sqrt() / 3.0
}
