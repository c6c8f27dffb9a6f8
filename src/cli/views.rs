//! Which views to draw: those of a camera file, or a circle around the scene.
//!
//! In: `--cameras FILE` or `--orbit N`, sizes, a fixed time. Out: named cameras at a time each ([`Shot`]).

use super::failure::Failure;
use super::report::note;
use super::values;
use crate::offline::dataset::{CameraFile, CameraOptions};
use crate::scene::{Bounds, RuntimeScene};
use crate::view::{Camera, Lens, View};
use glam::{UVec2, Vec3};
use std::f32::consts::TAU;
use std::path::PathBuf;

/// Horizontal field of view of an orbit, radians.
const ORBIT_FOV: f32 = 0.7;
/// Height of an orbit over the centre, radians.
const ORBIT_ELEVATION: f32 = 0.35;
/// Picture size of an orbit.
const ORBIT_SIZE: UVec2 = UVec2::splat(400);

/// Which views to draw.
#[derive(clap::Args)]
#[command(next_help_heading = "Views")]
pub struct ViewArgs {
    /// Views of a camera file: transforms*.json, or golden*.json with a list `views`; each frame at its own time.
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    cameras: Option<PathBuf>,
    /// N views on a circle around the scene, about its up axis, while time runs through the interval.
    #[arg(long, value_name = "N", value_parser = values::count(100_000))]
    orbit: Option<usize>,
    /// Draw every view at this time.
    #[arg(long, value_name = "T", value_parser = values::number, allow_hyphen_values = true)]
    time: Option<f32>,
    /// Picture size [default: w and h of the camera file, else that of the first image found beside it, after --resolution;
    /// 400x400 for --orbit].
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    size: Option<UVec2>,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with_all = ["size", "orbit"])]
    resolution: Option<i32>,
}

/// A named camera at a time.
pub struct Shot {
    /// Name of the picture, without extension.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// Timestamp, in the capture's unit.
    pub time: f32,
}

impl Shot {
    /// What the renderer takes, for this scene.
    pub fn view(&self, scene: &RuntimeScene) -> View {
        self.camera.view(self.time, scene.trained_with.raster_fov)
    }
}

impl ViewArgs {
    /// How many views to take of all there are, when `count` is enough: an orbit that was asked for stays whole.
    pub fn limit(&self, count: usize) -> usize {
        self.orbit.unwrap_or(count)
    }

    /// The shots of the camera file, or else of an orbit (of `orbit` views unless `--orbit` says how many).
    ///
    /// # Errors
    /// A camera file that cannot be used, a scene without Gaussians to go around.
    pub fn shots(&self, scene: &RuntimeScene, orbit: usize) -> Result<Vec<Shot>, Failure> {
        let mut shots = match &self.cameras {
            Some(path) => {
                let options = CameraOptions { size: self.size, resolution: self.resolution, time_interval: None };
                let views = CameraFile::load(path, &options)?;
                views.into_iter().map(|view| Shot { name: view.name, camera: view.camera, time: view.time }).collect()
            }
            None => around(scene, self.orbit.unwrap_or(orbit), self.size.unwrap_or(ORBIT_SIZE))?,
        };
        if let Some(time) = self.time {
            shots.iter_mut().for_each(|shot| shot.time = time);
        }
        point_out(scene, &shots);
        Ok(shots)
    }
}

/// Notes on what would otherwise surprise.
fn point_out(scene: &RuntimeScene, shots: &[Shot]) {
    let [first, last] = scene.trained_with.time_interval;
    let outside = shots.iter().filter(|shot| !(first..=last).contains(&shot.time)).count();
    if outside > 0 {
        let all = shots.len();
        note(&format!(
            "note: {outside} of {all} views lie outside the time interval {first} to {last} that the capture was trained on; \
             was it converted without --time-interval?"
        ));
    }
    if scene.trained_with.uses_fov_sentinel() && shots.iter().any(|shot| matches!(shot.camera.lens, Lens::Fov { .. })) {
        note("note: trained with the placeholder field of view of intrinsics cameras, drawn here with the true one");
    }
}

/// A circle around the middle of the scene, from which all of it is seen.
fn around(scene: &RuntimeScene, count: usize, size: UVec2) -> Result<Vec<Shot>, Failure> {
    let core = Bounds::core(scene.iter()).ok_or_else(|| Failure::new("the scene has no Gaussians to go around"))?;
    let tan_x = (ORBIT_FOV / 2.0).tan();
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
        let outward = flat * ORBIT_ELEVATION.cos() + up * ORBIT_ELEVATION.sin();
        let progress = index as f32 / (count.max(2) - 1) as f32;
        Shot {
            name: format!("orbit_{index:04}"),
            camera: Camera::look_at(core.center() + outward * distance, core.center(), up, ORBIT_FOV, size),
            time: first + (last - first) * progress,
        }
    };
    Ok((0..count).map(shot).collect())
}
