//! The views to draw: those of a camera file, or a circle around the scene.
//!
//! In: `--cameras FILE` or `--orbit N`, sizes, a fixed time. Out: named cameras at a time each ([`Shot`]).

use super::data::or_give_size;
use super::values;
use crate::cli::output::failure::Failure;
use crate::cli::output::note::note;
use crate::offline::dataset::{CameraFile, CameraOptions};
use crate::offline::draw::orbit::ORBIT_SIZE;
use crate::offline::draw::{Shot, orbit};
use crate::offline::store::outputs::Files;
use crate::scene::RuntimeScene;
use crate::view::Lens;
use glam::UVec2;
use std::path::PathBuf;

/// Which views to draw.
#[derive(clap::Args)]
#[command(next_help_heading = "Views")]
pub(crate) struct ViewArgs {
    /// Views of a camera file: transforms*.json, or golden*.json with a list `views`; each frame at its own time.
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    cameras: Option<PathBuf>,
    /// N views on a circle around the scene, about its up axis, while time runs through the interval.
    #[arg(long, value_name = "N", value_parser = values::count(100_000))]
    orbit: Option<usize>,
    /// Draw every view at this time.
    #[arg(long, value_name = "T", value_parser = values::number, allow_hyphen_values = true)]
    time: Option<f32>,
    /// Picture size [default: w and h of the camera file, else that of the first image found beside it, after
    /// --resolution; 400x400 for --orbit].
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    size: Option<UVec2>,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with_all = ["size", "orbit"], requires = "cameras")]
    resolution: Option<i32>,
}

impl ViewArgs {
    /// Adds the camera file, if one is given, and the images that it names to the files that the verb reads.
    pub(crate) fn add_to(&self, files: Files) -> Files {
        self.cameras.iter().fold(files, |files, path| files.reads_cameras(path))
    }

    /// Returns whether the views are on an orbit, which turns about the axis that points up.
    pub(crate) fn are_of_orbit(&self) -> bool {
        self.cameras.is_none()
    }

    /// Returns how many views to use: all of `--orbit` if it is given, else `count`.
    pub(crate) fn limit(&self, count: usize) -> usize {
        self.orbit.unwrap_or(count)
    }

    /// Returns the shots of the camera file or, without one, of an orbit: `count` views unless `--orbit` gives their
    /// number.
    ///
    /// # Errors
    /// A camera file that cannot be used, a scene without Gaussians to go around.
    pub(crate) fn shots(&self, scene: &RuntimeScene, count: usize) -> Result<Vec<Shot>, Failure> {
        let mut shots = match &self.cameras {
            Some(path) => {
                if self.resolution.is_some() && CameraFile::ignores_resolution(path)? {
                    let reason =
                        "has the sizes of its pictures, on which --resolution has no effect: give --size, or neither";
                    return Err(Failure::about(path, reason));
                }
                let options = CameraOptions {
                    size: self.size,
                    resolution: self.resolution,
                    origin: Some(scene.trained_with.origin),
                    ..CameraOptions::default()
                };
                let views = CameraFile::load(path, &options).map_err(or_give_size)?;
                views.into_iter().map(|view| Shot { name: view.name, camera: view.camera, time: view.time }).collect()
            }
            None => orbit(scene, self.orbit.unwrap_or(count), self.size.unwrap_or(ORBIT_SIZE))?,
        };
        if let Some(time) = self.time {
            shots.iter_mut().for_each(|shot| shot.time = time);
        }
        point_out(scene, &shots);
        Ok(shots)
    }
}

/// Prints notes about views outside the time interval and about another field of view than in training.
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
