//! N3V: `poses_bounds.npy` with a video or a folder of frames for each camera.
//!
//! In: a folder. Out: the views of all cameras at all frames, 30 a second; the first camera is the test camera.
//!
//! `camNN.mp4` and folders `camNN`, sorted by name, go with the rows. The frames of a camera are the images in
//! `camNN/`, `camNN/images/`, `frames/camNN/` or `images/camNN/`; without any, those of its video.

use super::numbered::{entries, images, is_video};
use super::poses_bounds::{self, POSES};
use super::standing::{self, Standing};
use super::undivided::Undivided;
use super::video::{self, Videos};
use crate::offline::dataset::cameras::placing::Placed;
use crate::offline::dataset::{CameraOptions, Clock, DatasetError};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Returns whether a folder has poses and cameras. Poses alone may belong to a COLMAP model (LLFF).
pub(crate) fn is_there(folder: &Path) -> bool {
    folder.join(POSES).is_file() && (!super::colmap::is_there(folder) || has_cameras(folder))
}

/// Returns whether a folder has videos or folders of frames with the names of cameras.
pub(crate) fn has_cameras(folder: &Path) -> bool {
    cameras(folder).is_ok_and(|cameras| !cameras.is_empty())
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions, mut videos: Videos<'_>) -> Result<Undivided, DatasetError> {
    let source = folder.join(POSES);
    let rows = poses_bounds::read(&source)?;
    let names: Vec<String> = cameras(folder)?.into_iter().collect();
    check_count(rows.len(), &names).map_err(|reason| DatasetError::Unusable { path: source.clone(), reason })?;
    let mut frames = Vec::new();
    for camera in &names {
        frames.push(frames_of(folder, camera, &mut videos)?);
    }
    let parts = rows.into_iter().zip(names).zip(standing::timed(frames)).enumerate();
    let cameras: Vec<Standing> = parts.map(|(index, ((row, name), shots))| row.with(name, index, shots)).collect();
    let splits = standing::splits(&cameras, |camera| camera.index == 0);
    let Placed { views, origin, notes } = standing::views(folder, &source, cameras, options)?;
    Ok(Undivided { source, views, splits: Some(splits), clock: Clock::NUMBERED, points: None, notes, origin })
}

/// Checks that each row has a camera.
fn check_count(rows: usize, cameras: &[String]) -> Result<(), String> {
    if cameras.len() == rows {
        return Ok(());
    }
    let names: Vec<&str> = cameras.iter().take(4).map(String::as_str).collect();
    Err(format!(
        "it has {rows} cameras, and {} videos camNN.mp4 or folders camNN of frames lie beside it ({}, ...): they must \
         go with the rows",
        cameras.len(),
        names.join(", ")
    ))
}

/// Returns the names of the cameras, sorted.
fn cameras(folder: &Path) -> Result<BTreeSet<String>, DatasetError> {
    let mut names = BTreeSet::new();
    for path in entries(folder)? {
        let is_video = is_video(&path);
        let stem = if is_video { path.file_stem() } else { path.file_name() };
        names.extend(stem.and_then(|stem| stem.to_str()).filter(|_| is_video || path.is_dir()).map(str::to_owned));
    }
    for inside in ["frames", "images"] {
        let folders = entries(&folder.join(inside))?.into_iter().filter(|path| path.is_dir());
        names.extend(folders.filter_map(|path| Some(path.file_name()?.to_str()?.to_owned())));
    }
    let is_camera = |name: &String| {
        name.strip_prefix("cam").is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit()))
    };
    names.retain(is_camera);
    Ok(names)
}

/// Returns the frames of a camera. A video that is not decoded is its only frame.
fn frames_of(folder: &Path, camera: &str, videos: &mut Videos<'_>) -> Result<Vec<PathBuf>, DatasetError> {
    let [own, frames, common] = ["", "frames", "images"].map(|inside| folder.join(inside).join(camera));
    for place in [own.clone(), own.join("images"), frames, common] {
        let found = images(&place)?;
        if !found.is_empty() {
            return Ok(found);
        }
    }
    let of_camera = |path: &PathBuf| path.file_stem().is_some_and(|stem| stem == camera) && is_video(path);
    let Some(video) = entries(folder)?.into_iter().find(of_camera) else {
        let reason = "no images and no video of this camera: put its frames there".to_owned();
        return Err(DatasetError::Unusable { path: own, reason });
    };
    match videos {
        Videos::Decode(progress) => video::frames(folder, &video, camera, &mut **progress),
        Videos::Leave => Ok(video::decoded(folder, camera)?.unwrap_or_else(|| vec![video])),
    }
}
