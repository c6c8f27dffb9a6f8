//! Files of datasets of other programs.
//!
//! In: a file of a nerfstudio, COLMAP or N3V folder, whose other files are whole. Out: files with wrong numbers, names
//! and structures. Accepted folders have views of allowed sizes with finite cameras and names of their own, and their
//! cameras are drawn.

use super::views::check_views;
use super::{Outcome, Reader};
use crate::change::{bytes, text, words};
use crate::support::random::Random;
use bevy_gs4d::internal::offline::dataset::Summary;
use bevy_gs4d::internal::offline::dataset::draw;
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use bevy_gs4d::view::RasterFov;
use glam::UVec2;
use serde_json::json;
use std::fs;
use tempfile::TempDir;

/// Number of cameras of each seed.
const CAMERAS: usize = 3;

/// The reader of one of the files.
pub struct Datasets {
    folder: TempDir,
    /// The file that is changed.
    file: &'static str,
    seeds: Vec<Vec<u8>>,
}

impl Datasets {
    /// Makes the files of a folder, and the seeds of one of them.
    pub fn new(file: &'static str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let whole: &[(&str, Vec<u8>)] = &match file {
            "transforms.json" => vec![(file, nerfstudio("OPENCV"))],
            "poses_bounds.npy" => vec![(file, poses())],
            _ if file.ends_with(".bin") => {
                vec![("sparse/0/cameras.bin", cameras_bin(4)), ("sparse/0/images.bin", images_bin())]
            }
            _ => vec![("sparse/0/cameras.txt", cameras_txt()), ("sparse/0/images.txt", images_txt())],
        };
        write(&folder, whole);
        if file == "poses_bounds.npy" {
            for camera in 0..CAMERAS {
                let path = folder.path().join(format!("cam{camera:02}/0000.png"));
                fs::create_dir_all(path.parent().expect("inside the folder")).expect("the folder can be made");
                fs::write(path, b"").expect("the folder can be written to");
            }
        }
        let mut seeds: Vec<Vec<u8>> =
            whole.iter().filter(|(name, _)| *name == file).map(|(_, bytes)| bytes.clone()).collect();
        match file {
            "transforms.json" => seeds.push(nerfstudio("OPENCV_FISHEYE")),
            "sparse/0/cameras.bin" => seeds.extend((0..11).map(cameras_bin)),
            _ => {}
        }
        Self { folder, file, seeds }
    }

    /// Makes the files of a folder, of which one is the seed.
    pub fn of(file: &'static str, whole: &[(&str, Vec<u8>)]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write(&folder, whole);
        let seeds = whole.iter().filter(|(name, _)| *name == file).map(|(_, bytes)| bytes.clone()).collect();
        Self { folder, file, seeds }
    }
}

/// Writes the files of a folder.
fn write(folder: &TempDir, whole: &[(&str, Vec<u8>)]) {
    for (name, bytes) in whole {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("inside the folder")).expect("the folder can be made");
        fs::write(path, bytes).expect("the folder can be written to");
    }
}

impl Reader for Datasets {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (seed, other) = (random.pick(&self.seeds), random.pick(&self.seeds));
        let change = if self.file.ends_with(".json") { text::change } else { words::change };
        let mut file = match (std::str::from_utf8(seed), std::str::from_utf8(other)) {
            (Ok(seed), Ok(other)) if !random.one_in(4) => change(seed, other, random).into_bytes(),
            _ => seed.clone(),
        };
        if file == *seed || random.one_in(16) {
            bytes::change(&mut file, other, random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        fs::write(self.folder.path().join(self.file), bytes).expect("the folder can be written to");
        let small = CameraOptions { size: Some(UVec2::new(24, 16)), ..CameraOptions::default() };
        let halved = CameraOptions { resolution: Some(2), time_interval: Some([0.0, 1.0]), ..CameraOptions::default() };
        let mut outcome = Outcome::Drawn;
        for options in [CameraOptions::default(), small, halved] {
            for split in [Split::Train, Split::Test] {
                match Dataset::open(self.folder.path(), split, &options) {
                    Ok(dataset) => check(&dataset.views)?,
                    Err(error) => outcome = Outcome::Refused(error.to_string()),
                }
            }
        }
        if let Ok(summary) = Summary::of(self.folder.path(), &CameraOptions::default()) {
            let picture = draw(&summary.cameras);
            if picture.pixels.len() != (picture.size.x * picture.size.y) as usize {
                return Err(format!("is drawn with {} pixels instead of {}", picture.pixels.len(), picture.size));
            }
        }
        Ok(outcome)
    }
}

/// Checks the views of an accepted folder.
fn check(views: &[TrainingView]) -> Result<(), String> {
    check_views(views)?;
    match views.iter().find(|view| !view.camera.view(view.time, RasterFov::Corrected).is_finite()) {
        Some(view) => Err(format!("has a view {:?} that is not finite", view.name)),
        None => Ok(()),
    }
}

fn nerfstudio(model: &str) -> Vec<u8> {
    let frame = |index: usize| {
        json!({
            "file_path": format!("images/f{index}.png"), "mask_path": format!("masks/f{index}.png"), "time": index,
            "transform_matrix": [[1, 0, 0, index], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]],
        })
    };
    let file = json!({
        "camera_model": model, "w": 40, "h": 30, "fl_x": 50.0, "fl_y": 51.0, "cx": 19.0, "cy": 16.0,
        "k1": 0.01, "k2": -0.01, "k3": 0.0, "k4": 0.0,
        "train_filenames": ["images/f1.png", "images/f2.png"], "test_filenames": ["images/f0.png"],
        "ply_file_path": "points.ply", "frames": (0..CAMERAS).map(frame).collect::<Vec<_>>(),
    });
    file.to_string().into_bytes()
}

pub fn poses() -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({CAMERAS}, 17), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for camera in 0..CAMERAS {
        let x = camera as f64;
        let row = [0.0, 1.0, 0.0, x, 30.0, -1.0, 0.0, 0.0, 0.0, 40.0, 0.0, 0.0, 1.0, 3.0, 50.0, 0.1, 100.0];
        bytes.extend(row.into_iter().flat_map(f64::to_le_bytes));
    }
    bytes
}

/// Returns a camera of a model.
fn cameras_bin(model: i32) -> Vec<u8> {
    // Focal lengths and principal point, then coefficients.
    let (count, focals) =
        [(3, 1), (4, 2), (4, 1), (5, 1), (8, 2), (8, 2), (12, 2), (5, 2), (4, 1), (5, 1), (12, 2)][model as usize];
    let lens = [50.0f64, 51.0].into_iter().take(focals).chain([19.0, 16.0]);
    let values = lens.chain([0.01, -0.01, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0]).take(count);
    let mut bytes = [1u64.to_le_bytes().to_vec(), 7u32.to_le_bytes().to_vec(), model.to_le_bytes().to_vec()].concat();
    bytes.extend([40u64, 30].into_iter().flat_map(u64::to_le_bytes));
    bytes.extend(values.flat_map(f64::to_le_bytes));
    bytes
}

fn images_bin() -> Vec<u8> {
    let mut bytes = (CAMERAS as u64).to_le_bytes().to_vec();
    for image in 0..CAMERAS as u32 {
        bytes.extend((image + 1).to_le_bytes());
        bytes.extend([1.0, 0.0, 0.0, 0.0, f64::from(image), 0.0, 3.0].into_iter().flat_map(f64::to_le_bytes));
        bytes.extend(7u32.to_le_bytes());
        bytes.extend(format!("cam{image}/0001.png\0").bytes());
        bytes.extend(1u64.to_le_bytes());
        bytes.extend([0; 24]);
    }
    bytes
}

fn cameras_txt() -> Vec<u8> {
    b"# cameras\n7 OPENCV 40 30 50 51 19 16 0.01 -0.01 0 0.001\n".to_vec()
}

fn images_txt() -> Vec<u8> {
    let line = |image: usize| format!("{image} 1 0 0 0 {image} 0 3 7 images of {image}.png\n1.5 2.5 -1\n");
    (0..CAMERAS).map(line).collect::<String>().into_bytes()
}
