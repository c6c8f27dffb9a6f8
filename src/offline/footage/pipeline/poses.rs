//! The cameras of footage without a calibration, as COLMAP finds them.
//!
//! In: a folder with a video or a folder of frames for each camera. Out: [`FoundCameras`], which can be stored and
//! become a calibration.

use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::lens::OriginalLens;
use crate::offline::dataset::formats::footage::{self, Calibration, RigCamera};
use crate::offline::dataset::formats::numbered::{images, is_video};
use crate::offline::dataset::formats::video;
use crate::offline::footage::FootageError;
use crate::offline::footage::colmap::calibrate;
use crate::offline::store::results::Key;
use crate::offline::work::Progress;
use glam::{DMat4, DVec2, UVec2};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Most moments whose pictures are tried.
const MOMENTS: usize = 5;

/// The names of cameras, with their pictures of the same moments.
pub(super) type Pictures = Vec<(String, Vec<PathBuf>)>;

/// Returns the pictures of some moments. Videos are decoded.
///
/// # Errors
/// Videos or folders that cannot be read.
pub(super) fn pictures(folder: &Path, progress: &mut dyn Progress) -> Result<Pictures, FootageError> {
    let mut cameras = Vec::new();
    for (name, path) in footage::found(folder)? {
        let frames = match is_video(&path) {
            true => video::frames(folder, &path, &name, progress)?,
            false => images(&path)?,
        };
        cameras.push((name, frames));
    }
    let moments = cameras.iter().map(|(_, frames)| frames.len()).filter(|count| *count > 0).min().unwrap_or(0);
    for (_, frames) in &mut cameras {
        *frames = chosen(moments).iter().filter_map(|moment| frames.get(*moment)).cloned().collect();
    }
    Ok(cameras)
}

/// Returns at most [`MOMENTS`] of so many moments, evenly spread, ascending.
fn chosen(moments: usize) -> Vec<usize> {
    let wanted = moments.min(MOMENTS);
    (0..wanted).map(|index| (2 * index + 1) * moments / (2 * wanted)).collect()
}

/// Returns the key of pictures and names.
///
/// # Errors
/// A picture that cannot be read.
pub(super) fn key(pictures: &[(String, Vec<PathBuf>)]) -> Result<Key, FootageError> {
    let mut key = Key::of(b"poses");
    for (name, pictures) in pictures {
        let paths: Vec<&Path> = pictures.iter().map(PathBuf::as_path).collect();
        key = key.and(name).with(Key::of_files(&paths)?);
    }
    Ok(key)
}

/// The cameras that have been found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct FoundCameras {
    /// What found them, for messages.
    source: String,
    cameras: Vec<FoundCamera>,
    notes: Vec<String>,
}

/// A camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct FoundCamera {
    name: String,
    size: Option<[u32; 2]>,
    /// Column by column.
    world_to_camera: [f64; 16],
    focal: [f64; 2],
    center: [f64; 2],
    fisheye: bool,
    radial: [f64; 4],
    denominator: [f64; 3],
    tangential: [f64; 2],
}

impl FoundCameras {
    /// Finds cameras by their pictures.
    ///
    /// # Errors
    /// No COLMAP, cameras that cannot be placed, an interruption.
    pub(super) fn of(pictures: &[(String, Vec<PathBuf>)], progress: &mut dyn Progress) -> Result<Self, FootageError> {
        let Calibration { source, cameras, notes } = calibrate(pictures, progress)?;
        let source = source.to_string_lossy().into_owned();
        Ok(Self { source, cameras: cameras.into_iter().filter_map(FoundCamera::of).collect(), notes })
    }

    /// Returns the calibration.
    pub(super) fn calibration(self) -> Calibration {
        let cameras = self.cameras.into_iter().map(FoundCamera::in_rig).collect();
        Calibration { source: self.source.into(), cameras, notes: self.notes }
    }
}

impl FoundCamera {
    /// Returns a camera that can be stored. All lenses of COLMAP have focal lengths.
    fn of(camera: RigCamera) -> Option<Self> {
        let OriginalLens::Intrinsics { focal, center } = camera.lens else { return None };
        let Distortion { fisheye, radial, denominator, tangential } = camera.distortion;
        Some(Self {
            name: camera.name,
            size: camera.size.map(|size| size.to_array()),
            world_to_camera: camera.world_to_camera.to_cols_array(),
            focal: focal.to_array(),
            center: center.to_array(),
            fisheye,
            radial,
            denominator,
            tangential,
        })
    }

    fn in_rig(self) -> RigCamera {
        let Self { fisheye, radial, denominator, tangential, .. } = self;
        RigCamera {
            name: self.name,
            size: self.size.map(UVec2::from),
            world_to_camera: DMat4::from_cols_array(&self.world_to_camera),
            lens: OriginalLens::Intrinsics { focal: DVec2::from(self.focal), center: DVec2::from(self.center) },
            distortion: Distortion { fisheye, radial, denominator, tangential },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_spread_around_the_middle() {
        assert_eq!(chosen(100), [10, 30, 50, 70, 90], "five of a hundred");
        assert_eq!(chosen(2), [0, 1], "both of two");
        assert!(chosen(0).is_empty(), "no frames");
    }

    #[test]
    fn stored_cameras_are_those_that_were_found() {
        let camera = RigCamera {
            name: "left".to_owned(),
            size: Some(UVec2::new(8, 6)),
            world_to_camera: DMat4::from_rotation_y(0.3),
            lens: OriginalLens::Intrinsics { focal: DVec2::new(9.0, 8.0), center: DVec2::new(4.0, 3.0) },
            distortion: Distortion { radial: [0.1, 0.0, 0.0, 0.0], ..Distortion::default() },
        };
        let stored = FoundCamera::of(camera).expect("it has focal lengths");
        let returned = FoundCamera::of(stored.clone().in_rig()).expect("it has focal lengths");
        assert_eq!(returned, stored, "nothing is lost");
        assert_eq!(stored.radial[0], 0.1, "the distortion");
    }
}
