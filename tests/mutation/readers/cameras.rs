//! Camera files.
//!
//! In: camera files of every form. Out: files with wrong numbers, names and structures; accepted cameras draw a scene.

use super::views::check_views;
use super::{Outcome, Reader};
use crate::change::text;
use crate::limits::Limits;
use crate::support::random::Random;
use crate::support::{dataset, packed_scene};
use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions, TrainingView};
use bevy_gs4d::reference;
use bevy_gs4d::scene::RuntimeScene;
use glam::{UVec2, Vec3};
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

/// Most views of a file that are drawn.
const DRAWN: usize = 2;
/// Longest side of a picture that is drawn, pixels.
const SIDE: u32 = 256;

/// The reader of camera files.
pub struct Cameras {
    folder: TempDir,
    scene: RuntimeScene,
    limits: Limits,
    seeds: Vec<String>,
}

impl Cameras {
    /// Makes a seed of every form.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let scene = packed_scene::scene(40, 1, 0);
        dataset::write(folder.path(), &scene, Vec3::ZERO, 2, 2, UVec2::new(40, 30), false);
        let transforms = fs::read_to_string(folder.path().join("transforms_test.json")).expect("just written");
        let transforms: Value = serde_json::from_str(&transforms).expect("a camera file");
        let mut intrinsics = transforms.clone();
        for (name, value) in [("fl_x", 60.0), ("fl_y", 61.0), ("cx", 20.0), ("cy", 15.0), ("k1", 0.0)] {
            intrinsics[name] = json!(value);
        }
        for frame in intrinsics["frames"].as_array_mut().expect("frames") {
            frame["mask_path"] = json!("./masks/a.png");
        }
        let pose = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]);
        let golden = json!({ "views": [{
            "file": "./images/a.jpg", "time": 0.5, "width": 40, "height": 30, "fl_x": 60.0, "fl_y": 61.0,
            "cx": 20.0, "cy": 15.0, "world_to_camera_opencv": pose,
        }] });
        let seeds = Vec::from([transforms, intrinsics, golden].map(|seed| seed.to_string()));
        Self { folder, limits: Limits::of(&scene), scene, seeds }
    }
}

impl Reader for Cameras {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        text::file(&self.seeds, random)
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let path = self.folder.path().join("cameras.json");
        fs::write(&path, bytes).expect("the folder can be written to");
        let small = CameraOptions { size: Some(UVec2::new(24, 16)), ..CameraOptions::default() };
        let halved = CameraOptions { resolution: Some(2), time_interval: Some([0.0, 1.0]), ..CameraOptions::default() };
        let mut outcome = Outcome::Drawn;
        for options in [CameraOptions::default(), small, halved] {
            match CameraFile::load(&path, &options) {
                Ok(views) => self.check(&views)?,
                Err(error) => outcome = Outcome::Refused(error.to_string()),
            }
        }
        Ok(outcome)
    }
}

impl Cameras {
    /// Checks the views of an accepted file, and draws some of them.
    fn check(&self, views: &[TrainingView]) -> Result<(), String> {
        check_views(views)?;
        let small = views.iter().filter(|view| view.camera.size.max_element() <= SIDE);
        for TrainingView { camera, time, .. } in small.take(DRAWN) {
            let view = camera.view(*time, self.scene.trained_with.raster_fov);
            let background = self.scene.trained_background();
            let frame = reference::render(&self.scene, &view, background);
            self.limits.check(&frame, &view, background)?;
        }
        Ok(())
    }
}
