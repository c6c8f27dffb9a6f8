//! Cameras around a scene, and shares of such views.
//!
//! In: a scene, how many views, the picture size. Out: named cameras at a time each ([`Shot`]).

use super::OfflineError;
use crate::scene::{Bounds, RuntimeScene};
use crate::view::{Camera, View};
use glam::{UVec2, Vec3};
use std::f32::consts::TAU;

/// Default picture size of an orbit, pixels.
pub(crate) const ORBIT_SIZE: UVec2 = UVec2::splat(400);
/// Horizontal field of view, radians.
const FIELD_OF_VIEW: f32 = 0.7;
/// Elevation of the cameras above the center, radians.
const ELEVATION: f32 = 0.35;

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
        self.camera.view(self.time, scene.trained_with.raster_fov)
    }
}

/// Returns `count` views on a circle around the core of the scene ([`Bounds::core`]), about its up axis, each with the
/// whole core in view. Their times are evenly spaced over the time interval, both ends included.
///
/// # Errors
/// A scene without Gaussians, or with some that are too far apart.
pub fn orbit(scene: &RuntimeScene, count: usize, size: UVec2) -> Result<Vec<Shot>, OfflineError> {
    let core = Bounds::core(scene.iter()).ok_or(OfflineError::NothingToOrbit)?;
    let tan_x = (FIELD_OF_VIEW / 2.0).tan();
    let tan = tan_x.min(tan_x * size.y as f32 / size.x as f32);
    // The sphere about the core touches the sides of the picture; with the near limit to spare.
    let distance = core.radius().max(0.1) / tan.atan().sin() + 0.2;
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
        false => Err(OfflineError::TooFarApart),
    }
}

/// Returns an even share of at most `count` shots or views, in their order.
pub(crate) fn share<T>(all: Vec<T>, count: usize) -> Vec<T> {
    let total = all.len();
    let count = count.min(total);
    let chosen = all.into_iter().enumerate().filter(|(i, _)| i * count / total != (i + 1) * count / total);
    chosen.map(|(_, one)| one).collect()
}

/// Returns each shot at `times` times instead of its own: at the middles of as many equal parts of the interval.
pub(crate) fn at_times(shots: Vec<Shot>, times: usize, [first, last]: [f32; 2]) -> Vec<Shot> {
    let time = |k: usize| first + (last - first) * (k as f32 + 0.5) / times as f32;
    let seen = |shot: Shot| (0..times).map(move |k| Shot { time: time(k), ..shot.clone() });
    shots.into_iter().flat_map(seen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shots(count: usize) -> Vec<Shot> {
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, FIELD_OF_VIEW, ORBIT_SIZE);
        (0..count).map(|index| Shot { name: index.to_string(), camera, time: 0.0 }).collect()
    }

    #[test]
    fn shares_are_even_and_in_order() {
        let names = |count: usize| share(shots(6), count).into_iter().map(|shot| shot.name).collect::<Vec<_>>();
        assert_eq!(names(3), ["1", "3", "5"], "every second");
        assert_eq!(names(9).len(), 6, "no more than there are");
        assert!(share(Vec::<Shot>::new(), 3).is_empty(), "nothing of nothing");
    }

    #[test]
    fn times_are_the_middles_of_equal_parts() {
        let shots = at_times(shots(2), 2, [2.0, 4.0]);
        let times: Vec<f32> = shots.iter().map(|shot| shot.time).collect();
        assert_eq!(times, [2.5, 3.5, 2.5, 3.5], "each shot at both times");
        assert_eq!(shots[2].name, "1", "shot by shot");
    }
}
