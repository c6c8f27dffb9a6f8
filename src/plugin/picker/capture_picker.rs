//! The picker: intersects rays in world space with placed captures.
//!
//! In: the components and assets of captures. Out: [`CapturePicker`], a system parameter.

use crate::gaussian::alpha::reach_squared;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::{ClipFade, Playback};
use crate::plugin::render::CaptureSettings;
use crate::plugin::render::captures::view::CameraLens;
use crate::plugin::render::logged::warn_once_each;
use crate::scene::{PickSettings, RuntimeScene};
use bevy::asset::Assets;
use bevy::camera::visibility::InheritedVisibility;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::ROQueryItem;
use bevy::ecs::system::{Query, Res, SystemParam};
use bevy::math::Ray3d;
use bevy::transform::components::GlobalTransform;
use glam::{Affine3A, UVec2, Vec3, Vec4};
use std::sync::Arc;

/// Where a ray hits a capture.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// Describes a hit. Means of Gaussians are in capture space, hit points in world space.
/// fn describe(
///     hit: &CaptureHit,
///     captures: &Assets<GaussianCapture>,
///     placed: &Query<&GaussianCapture3d>,
/// ) -> Option<String> {
///     let capture = captures.get(&placed.get(hit.entity).ok()?.0)?;
///     let gaussian = capture.scene().iter().nth(hit.gaussian)?;
///     Some(format!("{} away at {}: mean {:?}", hit.distance, hit.point, gaussian.mean))
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
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
/// Captures in chunk files are not hit: their Gaussians are on the GPU only.
///
/// [`GlobalTransform`] places the captures; Bevy updates it in `PostUpdate`. The parameter reads [`Playback`],
/// [`CaptureSettings`] and [`GlobalTransform`]: to change these components in the same system, use a `ParamSet`.
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

/// The lens and the pose of the camera through which a ray goes.
type Eye<'a> = (&'a CameraLens, Affine3A);

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
    /// Returns the nearest hit among all captures that are loaded and not hidden, whether a camera sees them or not;
    /// `None` if the ray hits none. Each capture is tested alone: the ray passes through two captures that absorb half
    /// of the light only together.
    pub fn cast(&self, ray: Ray3d) -> Option<CaptureHit> {
        Aim::cast_all(&self.aims(ray, None, |_, visibility| visibility.get(), |_| true)).first().copied()
    }

    /// Returns the searches of a ray in all captures for which `takes_part` is true and whose box it meets, nearest box
    /// first. Gaussians that the `eye` does not draw because they are too near are not hit. `blocks` says whether a
    /// capture hides the captures behind it from the ray.
    pub(crate) fn aims(
        &self,
        ray: Ray3d,
        eye: Option<Eye<'_>>,
        takes_part: impl Fn(Entity, InheritedVisibility) -> bool,
        blocks: impl Fn(Entity) -> bool,
    ) -> Vec<Aim> {
        let captures = self.captures.iter().filter(|(entity, .., visibility, _)| takes_part(*entity, **visibility));
        let mut aims: Vec<Aim> = captures
            .filter_map(|placed| self.aim(placed, ray, eye).map(|aim| Aim { blocks: blocks(aim.entity), ..aim }))
            .collect();
        aims.sort_by(|a, b| a.entry.total_cmp(&b.entry));
        aims
    }

    /// Returns the hit of one capture, hidden or not; `None` if the ray misses it, or it is not loaded or has scale 0.
    pub fn cast_on(&self, entity: Entity, ray: Ray3d) -> Option<CaptureHit> {
        self.aim(self.captures.get(entity).ok()?, ray, None)?.cast(f32::INFINITY)
    }

    /// Returns the search of a ray in one capture; `None` if the ray misses its box, the eye cannot see it, or as for
    /// [`Self::cast_on`].
    fn aim(
        &self,
        (entity, handle, settings, playback, transform, _, fade): ROQueryItem<'_, '_, Placed>,
        ray: Ray3d,
        eye: Option<Eye<'_>>,
    ) -> Option<Aim> {
        let capture = self.assets.get(&handle.0)?;
        if capture.is_released() {
            warn_once_each(&format!(
                "capture {entity} is not picked: its Gaussians are on the GPU only; load it with \
                 RenderAssetUsages::default() in CaptureLoaderSettings, or let rays pass it with Pickable::IGNORE"
            ));
            return None;
        }
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
        let entry = bounds.entry(origin, direction)?;
        let near_plane = match eye {
            Some((lens, world_from_camera)) => Some(near_plane(lens, world_from_camera, affine, capture)?),
            None => None,
        };
        let settings = PickSettings {
            time: capture.time_at(playback.time),
            use_filter: settings.filter,
            opacity: appearance.opacity,
            crop: appearance.crop,
            near_plane,
            ..PickSettings::default()
        };
        let scene = capture.shared_scene();
        Some(Aim { entity, scene, ray, origin, direction, entry, settings, blocks: true })
    }
}

/// The search of a ray in one capture, without the world: it can run on another thread.
#[derive(Debug, Clone)]
pub(crate) struct Aim {
    entity: Entity,
    scene: Arc<RuntimeScene>,
    /// The ray in world space, and its origin and direction in capture space.
    ray: Ray3d,
    origin: Vec3,
    direction: Vec3,
    /// Distance at which the ray enters the capture's box.
    entry: f32,
    settings: PickSettings,
    /// Whether the capture hides the captures behind it from the ray.
    blocks: bool,
}

impl PartialEq for Aim {
    /// Two searches are equal if they find the same hit.
    fn eq(&self, other: &Self) -> bool {
        let is_same_ray = (self.ray, self.origin, self.direction) == (other.ray, other.origin, other.direction);
        let is_same_capture = self.entity == other.entity && Arc::ptr_eq(&self.scene, &other.scene);
        is_same_capture && is_same_ray && self.settings == other.settings && self.blocks == other.blocks
    }
}

impl Aim {
    /// Returns the entity with the capture.
    #[cfg(feature = "picking")]
    pub(crate) fn entity(&self) -> Entity {
        self.entity
    }

    /// Returns the number of Gaussians that the search visits.
    #[cfg(feature = "picking")]
    pub(crate) fn count(&self) -> usize {
        self.scene.len()
    }

    /// Returns the hit, if it is at most at this distance.
    fn cast(&self, limit: f32) -> Option<CaptureHit> {
        if self.entry > limit {
            return None;
        }
        let settings = PickSettings { max_distance: limit, ..self.settings };
        let pick = self.scene.pick(self.origin, self.direction, &settings)?;
        let point = self.ray.get_point(pick.distance);
        Some(CaptureHit { entity: self.entity, gaussian: pick.gaussian, distance: pick.distance, point })
    }

    /// Returns the hits of all searches, nearest first, up to and including the nearest capture that blocks.
    pub(crate) fn cast_all(aims: &[Self]) -> Vec<CaptureHit> {
        let (mut hits, mut limit) = (Vec::new(), f32::INFINITY);
        for aim in aims {
            let Some(hit) = aim.cast(limit) else { continue };
            if aim.blocks {
                limit = hit.distance;
            }
            hits.push(hit);
        }
        hits.retain(|hit| hit.distance <= limit);
        hits.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        hits
    }
}

/// Returns the plane, in the space of a placed capture, behind which a camera draws its Gaussians; `None` if it is not
/// drawn.
fn near_plane(
    lens: &CameraLens,
    world_from_camera: Affine3A,
    world_from_capture: Affine3A,
    capture: &GaussianCapture,
) -> Option<Vec4> {
    // The plane depends neither on the size of the picture nor on the time and the level of detail.
    let view = lens.view(UVec2::ONE, 0.0, world_from_camera, world_from_capture)?;
    let view = view.with_optics(capture.scene().optics(0, false));
    Some(view.world_to_camera.row(2) - Vec4::W * view.near)
}

/// Returns the factor on a box of three standard deviations (as bounds are) beyond which no alpha reaches 1/255:
/// `sqrt(2 ln(255 opacity)) / 3`. The radius is 3.33 standard deviations for a peak of 1.
fn reach(opacity: f32) -> f32 {
    reach_squared(opacity.max(1.0)).sqrt() / 3.0
}

#[cfg(all(test, feature = "picking"))]
pub(crate) mod tests {
    use super::*;

    /// Returns a search along the z axis from z = 4 in a capture of `count` Gaussians at the origin.
    pub(crate) fn aim_at(entity: Entity, count: usize, time: f32) -> Aim {
        use crate::gaussian::{Gaussian, Harmonics};
        let gaussian = Gaussian {
            mean: [0.0; 3],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [0.1, 0.0, 0.0, 0.1, 0.0, 0.1],
            opacity: 0.9,
            padding: 0.0,
        };
        let scene = Arc::new(RuntimeScene::sliced(vec![gaussian; count], Harmonics::default()));
        let (origin, direction) = (Vec3::Z * 4.0, Vec3::NEG_Z);
        let ray = Ray3d::new(origin, bevy::math::Dir3::NEG_Z);
        let settings = PickSettings { time, ..PickSettings::default() };
        Aim { entity, scene, ray, origin, direction, entry: 3.0, settings, blocks: true }
    }

    #[test]
    fn searches_of_another_time_are_different() {
        let aim = aim_at(Entity::PLACEHOLDER, 1, 0.0);
        assert_eq!(aim.clone(), aim, "a search of the same scene, ray and time");
        let later = Aim { settings: PickSettings { time: 1.0, ..aim.settings }, ..aim.clone() };
        assert_ne!(later, aim, "a search at another time");
        assert_ne!(aim_at(Entity::PLACEHOLDER, 1, 0.0), aim, "a search in another scene");
    }
}
