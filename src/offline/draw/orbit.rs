//! Cameras around a scene, and subsets of views.
//!
//! In: a scene, the number of views, the picture size. Out: named cameras, each with a time ([`Shot`]).

use super::DrawError;
use crate::scene::near::extent;
use crate::scene::{Bounds, RuntimeScene};
use crate::view::{Camera, NEAR, View};
use glam::{UVec2, Vec3};
use std::f32::consts::TAU;

/// Default picture size of an orbit, pixels.
pub(crate) const ORBIT_SIZE: UVec2 = UVec2::splat(400);
/// Horizontal field of view, radians.
const FIELD_OF_VIEW: f32 = 0.7;
/// Elevation of the cameras above the center, radians.
const ELEVATION: f32 = 0.35;
/// Least radius of a core around which cameras are placed, near limits.
const LEAST_RADIUS: f32 = 0.5;
/// Distance that is added for cores smaller than half a unit, in radii; for larger cores, the near limit of the
/// original is added.
const MARGIN: f32 = 0.4;

/// A named camera at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Name of the picture, without extension.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// Timestamp, in the capture's unit.
    pub time: f32,
}

impl Shot {
    /// Returns the renderer's view of a scene for this shot.
    pub fn view(&self, scene: &RuntimeScene) -> View {
        self.camera.view(self.time, scene.trained_with.optics())
    }
}

/// Returns `count` views on a circle around the core of the scene ([`Bounds::core`]), about its up axis, each with the
/// whole core in view. Their times are evenly spaced over the time interval, both ends included.
///
/// # Errors
/// A scene without Gaussians, or with Gaussians that are too far apart.
pub fn orbit(scene: &RuntimeScene, count: usize, size: UVec2) -> Result<Vec<Shot>, DrawError> {
    let core = Bounds::core(scene.iter()).ok_or(DrawError::NothingToOrbit)?;
    let tan_x = (FIELD_OF_VIEW / 2.0).tan();
    let tan = tan_x.min(tan_x * size.y as f32 / size.x as f32);
    let distance = distance(radius(scene, core), scene.trained_with.near, tan.atan());
    let up = scene.playback.up.vector();
    let side = up.any_orthonormal_vector();
    let front = up.cross(side);
    let [first, last] = scene.trained_with.time_interval;
    let shot = |index: usize| {
        let angle = TAU * index as f32 / count as f32;
        let flat: Vec3 = side * angle.cos() + front * angle.sin();
        let outward = flat * ELEVATION.cos() + up * ELEVATION.sin();
        let progress = index as f32 / (count.max(2) - 1) as f32;
        Shot {
            name: format!("orbit_{index:04}"),
            camera: Camera::look_at(core.center() + outward * distance, core.center(), up, FIELD_OF_VIEW, size),
            time: first + (last - first) * progress,
        }
    };
    let shots: Vec<Shot> = (0..count).map(shot).collect();
    match shots.iter().all(|shot| shot.camera.world_to_camera.is_finite()) {
        true => Ok(shots),
        false => Err(DrawError::TooFarApart),
    }
}

/// Returns the radius of the sphere that cameras show: that of the core; for a scene smaller than the scenes of the
/// original, the extent of the scene.
fn radius(scene: &RuntimeScene, core: Bounds) -> f32 {
    let near = scene.trained_with.near;
    let is_small = near < NEAR || core.radius() < LEAST_RADIUS * near;
    if is_small { extent(scene.iter()) } else { core.radius() }
}

/// Returns the distance at which a sphere touches the sides of a picture of this half field of view, plus a margin.
/// `near` is the near limit of the scene: if it is smaller than that of the original, the picture is the same at every
/// scale of the scene.
fn distance(radius: f32, near: f32, half_field: f32) -> f32 {
    let radius = radius.max(LEAST_RADIUS * near);
    radius / half_field.sin() + (MARGIN * radius).min(NEAR).max(near)
}

/// Returns an evenly spaced subset of at most `count` shots or views, in their order.
pub(crate) fn share<T>(all: Vec<T>, count: usize) -> Vec<T> {
    let total = all.len();
    let count = count.min(total);
    let chosen = all.into_iter().enumerate().filter(|(i, _)| i * count / total != (i + 1) * count / total);
    chosen.map(|(_, one)| one).collect()
}

/// Returns each shot at `times` times instead of its own time: at the middles of `times` equal parts of the interval.
pub(crate) fn at_times(shots: Vec<Shot>, times: usize, [first, last]: [f32; 2]) -> Vec<Shot> {
    let time = |k: usize| first + (last - first) * (k as f32 + 0.5) / times as f32;
    let repeated = |shot: Shot| (0..times).map(move |k| Shot { time: time(k), ..shot.clone() });
    shots.into_iter().flat_map(repeated).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shots(count: usize) -> Vec<Shot> {
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, FIELD_OF_VIEW, ORBIT_SIZE);
        (0..count).map(|index| Shot { name: index.to_string(), camera, time: 0.0 }).collect()
    }

    #[test]
    fn distances_are_in_proportion_to_small_scenes_and_add_the_near_limit_to_others() {
        let half = (FIELD_OF_VIEW / 2.0).tan().atan();
        for radius in [0.1f32, 0.3, 2.0, 1e5] {
            let found = distance(radius, NEAR, half);
            assert_eq!(found, radius / half.sin() + 0.2, "a radius of {radius} with the near limit of the original");
        }
        assert_eq!(distance(0.01, NEAR, half), 0.1 / half.sin() + 0.2, "no closer than that near limit allows");
        let relative = |radius: f32| distance(radius, 0.1 * radius, half) / radius;
        for radius in [1e-6, 1e-3, 0.2] {
            assert!((relative(radius) / relative(0.4) - 1.0).abs() < 1e-5, "in proportion to a radius of {radius}");
        }
        assert_eq!(distance(1.0, 0.1, half), 1.0 / half.sin() + 0.2, "from half a unit on the margin stays");
    }

    #[test]
    fn subsets_are_even_and_in_order() {
        let names = |count: usize| share(shots(6), count).into_iter().map(|shot| shot.name).collect::<Vec<_>>();
        assert_eq!(names(3), ["1", "3", "5"], "every second shot");
        assert_eq!(names(9).len(), 6, "all shots if more are wanted");
        assert!(share(Vec::<Shot>::new(), 3).is_empty(), "no shots, no subset");
    }

    #[test]
    fn times_are_the_middles_of_equal_parts() {
        let shots = at_times(shots(2), 2, [2.0, 4.0]);
        let times: Vec<f32> = shots.iter().map(|shot| shot.time).collect();
        assert_eq!(times, [2.5, 3.5, 2.5, 3.5], "each shot at both times");
        assert_eq!(shots[2].name, "1", "the times of one shot follow each other");
    }
}
