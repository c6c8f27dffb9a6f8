//! Record3D: `metadata.json`, or `metadata` of an unpacked `.r3d`, with the pictures of a telephone that moves.
//!
//! In: a folder. Out: the views of the pictures `rgbd/N.jpg` or `rgb/N.jpg`, at the times of the file.
//!
//! Picture N has the pose N: a quaternion (x, y, z, w) and a place, from the camera with OpenGL's axes to the world.
//! `K` is written column by column.

use super::footage::listed;
use super::numbered::{FRAME_RATE, images, number};
use super::undivided::Undivided;
use super::{json, masks};
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::lens::{OriginalLens, checked_size};
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::cameras::{lens_matrix, pose};
use crate::offline::dataset::{CameraOptions, Clock, DatasetError, FrameProblem};
use glam::DVec2;
use serde::Deserialize;
use serde_json::Value;
use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The names of the file.
const FILES: [&str; 2] = ["metadata.json", "metadata"];
/// The folder of pictures of the app, and that of its export.
const FOLDERS: [&str; 2] = ["rgbd", "rgb"];

/// The file.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct Metadata {
    #[serde(rename = "K")]
    matrix: Value,
    w: f64,
    h: f64,
    poses: Vec<[f64; 7]>,
    fps: Option<f64>,
    /// Seconds.
    #[serde(rename = "frameTimestamps")]
    times: Option<Vec<f64>>,
    /// Focal lengths and principal point of each frame.
    #[serde(rename = "perFrameIntrinsicCoeffs")]
    lenses: Option<Vec<[f64; 4]>>,
}

/// Returns whether a folder has the file and its pictures. Other programs write a `metadata.json` beside `rgb/`, too.
pub(crate) fn is_there(folder: &Path) -> bool {
    let is_of_app = |file: PathBuf| json::read(&file).is_ok_and(|json| json.get("K").and(json.get("poses")).is_some());
    match pictures(folder) {
        Some(inside) if inside.ends_with(FOLDERS[0]) => file(folder).is_some(),
        Some(_) => file(folder).is_some_and(is_of_app),
        None => false,
    }
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let missing = || DatasetError::Unusable { path: folder.to_owned(), reason: "no metadata.json in it".to_owned() };
    let (source, inside) = file(folder).zip(pictures(folder)).ok_or_else(missing)?;
    let metadata = Metadata::deserialize(json::read(&source)?);
    let metadata = metadata.map_err(|reason| DatasetError::Json { path: source.clone(), reason })?;
    let original = checked_size(metadata.w, metadata.h)
        .map_err(|problem| DatasetError::Unusable { path: source.clone(), reason: problem.to_string() })?;
    let (pictures, mut notes) = metadata.pictures(&inside)?;
    let (times, assumed) = metadata.times();
    notes.extend(assumed);
    let failed = |frame: usize| {
        let path = source.clone();
        move |problem| DatasetError::Frame { path: path.clone(), frame, problem }
    };
    let (mut names, mut unplaced) = (HashSet::new(), Vec::new());
    for (index, image) in pictures {
        let time = times.get(index).copied().unwrap_or(0.0);
        let frame = metadata.frame(folder, (index, image, time), &mut names).map_err(failed(index))?;
        unplaced.push(Unplaced { frame, original, failed: failed(index) });
    }
    let Placed { views, origin, notes: undone } = place(unplaced, options, true)?;
    notes.extend(undone);
    Ok(Undivided { source, views, splits: None, clock: Clock::NUMBERED, points: None, notes, origin })
}

/// Returns the path of the file.
fn file(folder: &Path) -> Option<PathBuf> {
    FILES.iter().map(|name| folder.join(name)).find(|path| path.is_file())
}

/// Returns the folder of pictures.
fn pictures(folder: &Path) -> Option<PathBuf> {
    FOLDERS.iter().map(|name| folder.join(name)).find(|path| path.is_dir())
}

impl Metadata {
    /// Returns the pictures with a pose by its number, and sentences about others. Without any on disk, all poses have
    /// a picture.
    fn pictures(&self, inside: &Path) -> Result<(BTreeMap<usize, PathBuf>, Vec<String>), DatasetError> {
        let count = self.poses.len();
        let (mut found, mut others) = (BTreeMap::new(), Vec::new());
        for path in images(inside)? {
            match numbered(&path).filter(|index| *index < count) {
                Some(index) => {
                    found.entry(index).or_insert(path);
                }
                None => others.push(path.file_name().unwrap_or_default().to_string_lossy().into_owned()),
            }
        }
        if found.is_empty() {
            found = (0..count).map(|index| (index, inside.join(format!("{index}.jpg")))).collect();
        }
        let without: Vec<String> =
            (0..count).filter(|index| !found.contains_key(index)).map(|index| index.to_string()).collect();
        let sentences =
            [("pictures without a pose are left out", others), ("poses without a picture are left out", without)];
        let said = sentences.into_iter().filter(|(_, names)| !names.is_empty());
        let notes = said.map(|(start, names)| format!("{start}: {}", listed(names.into_iter()))).collect();
        Ok((found, notes))
    }

    /// Returns the times of the poses, seconds after the first one, and a sentence if they are assumed.
    fn times(&self) -> (Vec<f64>, Option<String>) {
        let times = self.times.as_deref().unwrap_or_default();
        if times.len() == self.poses.len() && times.is_sorted() {
            return (times.iter().map(|time| time - times[0]).collect(), None);
        }
        let at_rate = |rate: f64| (0..self.poses.len()).map(|index| index as f64 / rate).collect();
        match self.fps.filter(|rate| *rate > 0.0) {
            Some(rate) => {
                (at_rate(rate), Some(format!("it has no time for each pose: poses have {rate} frames a second")))
            }
            None => (at_rate(FRAME_RATE), Some("it has no times: its poses count at 30 a second".to_owned())),
        }
    }

    /// Returns the lens of a frame: its own one if each pose has one, since the telephone focuses.
    fn lens(&self, index: usize) -> Result<OriginalLens, FrameProblem> {
        let own = self.lenses.as_ref().filter(|lenses| lenses.len() == self.poses.len());
        match own.and_then(|lenses| lenses.get(index)) {
            Some(&[fx, fy, cx, cy]) => {
                Ok(OriginalLens::Intrinsics { focal: DVec2::new(fx, fy), center: DVec2::new(cx, cy) })
            }
            None => lens_matrix::of_value(&self.matrix),
        }
    }

    fn frame(
        &self,
        folder: &Path,
        (index, image, time): (usize, PathBuf, f64),
        names: &mut HashSet<String>,
    ) -> Result<Frame, FrameProblem> {
        let [qx, qy, qz, qw, x, y, z] = self.poses[index];
        let file = image.file_name().and_then(OsStr::to_str).unwrap_or_default();
        let name = output_name(file, index, names).ok_or_else(|| FrameProblem::FileName(file.to_owned()))?;
        Ok(Frame {
            name,
            mask: masks::beside(folder, &image).map(|path| Mask { path, applied: false }),
            time,
            world_to_camera: pose::of_opengl(pose::of_rotation([qw, qx, qy, qz], [x, y, z])?),
            lens: self.lens(index)?,
            distortion: Distortion::default(),
            image,
        })
    }
}

/// Returns the number that is the whole name of a picture. Copies of pictures have other names: `123(3).jpg`.
fn numbered(path: &Path) -> Option<usize> {
    let is_number = path.file_stem()?.to_str()?.bytes().all(|byte| byte.is_ascii_digit());
    number(path).filter(|_| is_number)?.try_into().ok()
}
