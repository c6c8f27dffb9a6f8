//! Polycam: a scan of a scene at rest, exported as raw data.
//!
//! In: a folder with `keyframes/corrected_cameras/N.json` and `keyframes/corrected_images/N.jpg`, or else with
//! `cameras` and `images` of the same forms, which have not been aligned. Out: the views of all pictures, at time 0.
//!
//! `t_00` to `t_23` are the rows of the matrix from the camera with OpenGL's axes to a world whose y points up. As
//! nerfstudio reads it, its z becomes x, its x y, and its y z, so that z points up.

use super::footage::listed;
use super::named_images::NamedImages;
use super::numbered::entries;
use super::undivided::Undivided;
use super::{json, masks};
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::lens::{OriginalLens, checked_size};
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::cameras::pose;
use crate::offline::dataset::{CameraOptions, Clock, DatasetError, FrameProblem};
use glam::{DVec2, UVec2};
use serde::Deserialize;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Folders of cameras and of their pictures, the first that exists.
const FOLDERS: [(&str, &str); 3] = [
    ("keyframes/corrected_cameras", "keyframes/corrected_images"),
    ("corrected_cameras", "corrected_images"),
    ("keyframes/cameras", "keyframes/images"),
];
/// Pictures with a lower score are blurred.
const SHARP: f64 = 25.0;
/// The sentence about poses that the app has not improved.
const RAW: &str = "it has no corrected_cameras: poses and pictures are those of the recording, which the app has not \
                   aligned";

/// The file of a camera.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct Camera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: f64,
    height: f64,
    t_00: f64,
    t_01: f64,
    t_02: f64,
    t_03: f64,
    t_10: f64,
    t_11: f64,
    t_12: f64,
    t_13: f64,
    t_20: f64,
    t_21: f64,
    t_22: f64,
    t_23: f64,
    /// The lower, the more blurred.
    blur_score: Option<f64>,
}

/// A camera with the path of its file.
struct Keyframe {
    path: PathBuf,
    camera: Camera,
}

/// Returns whether a folder has cameras.
pub(crate) fn is_there(folder: &Path) -> bool {
    folders(folder).is_some()
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let missing = || DatasetError::Unusable { path: folder.to_owned(), reason: "no cameras in it".to_owned() };
    let (cameras, inside) = folders(folder).ok_or_else(missing)?;
    let mut keyframes = Vec::new();
    for path in files(&folder.join(cameras))? {
        let camera = Camera::deserialize(json::read(&path)?);
        let camera = camera.map_err(|reason| DatasetError::Json { path: path.clone(), reason })?;
        keyframes.push(Keyframe { path, camera });
    }
    let source = keyframes.first().map_or_else(|| folder.join(cameras), |keyframe| keyframe.path.clone());
    let mut notes: Vec<String> = (!cameras.contains("corrected")).then(|| RAW.to_owned()).into_iter().collect();
    notes.extend(leave_out_blurred(&mut keyframes));
    let (images, mut names, mut unplaced) = (NamedImages::of(folder), HashSet::new(), Vec::new());
    for (index, Keyframe { path, camera }) in keyframes.into_iter().enumerate() {
        let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
        let image = images.find(&format!("{inside}/{stem}"));
        let failed =
            move |problem: FrameProblem| DatasetError::Unusable { path: path.clone(), reason: problem.to_string() };
        let frame = camera.frame(folder, image, index, &mut names).map_err(&failed)?;
        let original = camera.size().map_err(&failed)?;
        unplaced.push(Unplaced { frame, original, failed });
    }
    let Placed { views, origin, notes: undone } = place(unplaced, options, true)?;
    notes.extend(undone);
    Ok(Undivided { source, views, splits: None, clock: Clock::default(), points: None, notes, origin })
}

/// Returns the folders of cameras and pictures.
fn folders(folder: &Path) -> Option<(&'static str, &'static str)> {
    let has_cameras = |(cameras, _): &&(&str, &str)| files(&folder.join(cameras)).is_ok_and(|files| !files.is_empty());
    FOLDERS.iter().find(has_cameras).copied()
}

/// Returns the files of cameras.
fn files(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut files = entries(folder)?;
    files.retain(|path| {
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) && path.is_file()
    });
    Ok(files)
}

/// Leaves out the blurred pictures, unless more than half of them are. Returns a sentence about them if there are any.
fn leave_out_blurred(keyframes: &mut Vec<Keyframe>) -> Option<String> {
    let is_blurred = |keyframe: &Keyframe| keyframe.camera.blur_score.is_some_and(|score| score < SHARP);
    let blurred: Vec<String> = keyframes
        .iter()
        .filter(|keyframe| is_blurred(keyframe))
        .map(|keyframe| keyframe.path.file_stem().unwrap_or_default().to_string_lossy().into_owned())
        .collect();
    let count = blurred.len();
    if count == 0 {
        return None;
    }
    let names = listed(blurred.into_iter());
    if 2 * count > keyframes.len() {
        return Some(format!(
            "most pictures, {count}, have a blur_score below {SHARP}, and are used all the same: scan the scene again, \
             more slowly: {names}"
        ));
    }
    keyframes.retain(|keyframe| !is_blurred(keyframe));
    Some(format!("{count} pictures with a blur_score below {SHARP} are left out: {names}"))
}

impl Camera {
    fn size(&self) -> Result<UVec2, FrameProblem> {
        checked_size(self.width, self.height)
    }

    fn frame(
        &self,
        folder: &Path,
        image: PathBuf,
        index: usize,
        names: &mut HashSet<String>,
    ) -> Result<Frame, FrameProblem> {
        let &Self { t_00, t_01, t_02, t_03, t_10, t_11, t_12, t_13, t_20, t_21, t_22, t_23, .. } = self;
        let to_world =
            [[t_20, t_21, t_22, t_23], [t_00, t_01, t_02, t_03], [t_10, t_11, t_12, t_13], [0.0, 0.0, 0.0, 1.0]];
        let file = image.file_name().and_then(OsStr::to_str).unwrap_or_default();
        let name = output_name(file, index, names).ok_or_else(|| FrameProblem::FileName(file.to_owned()))?;
        Ok(Frame {
            name,
            mask: masks::beside(folder, &image).map(|path| Mask { path, applied: false }),
            time: 0.0,
            world_to_camera: pose::of_opengl(pose::pose(&to_world)?),
            lens: OriginalLens::Intrinsics {
                focal: DVec2::new(self.fx, self.fy),
                center: DVec2::new(self.cx, self.cy),
            },
            distortion: Distortion::default(),
            image,
        })
    }
}
