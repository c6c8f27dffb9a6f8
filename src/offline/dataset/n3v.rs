//! N3V: `poses_bounds.npy` with a video or a folder of frames for each camera.
//!
//! In: a folder. Out: the views of all cameras at all frames, 30 a second; the first camera is the test camera.
//!
//! `camNN.mp4` and folders `camNN`, sorted by name, go with the rows. The frames of a camera are the images in `camNN/`, `camNN/images/`,
//! `frames/camNN/` or `images/camNN/`; without any, those of its video.

use super::distortion::Distortion;
use super::frame::{Frame, Mask, output_name};
use super::lens::{OriginalLens, checked_size};
use super::numbered::{entries, images, is_video, number, times};
use super::placing::{Placed, Unplaced, place};
use super::pose::pose;
use super::undivided::Undivided;
use super::video::Videos;
use super::{CameraOptions, Clock, DatasetError, FrameProblem, Split, masks, npy, video};
use glam::{DMat4, DVec2, UVec2};
use std::collections::{BTreeSet, HashSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Name of the file of poses.
pub(super) const POSES: &str = "poses_bounds.npy";
/// Numbers of a row: 3 x 5 for the pose and the lens, the nearest and the farthest depth.
const COLUMNS: usize = 17;
/// Most bytes of the file.
const MAX_BYTES: u64 = 1 << 24;

/// A row of the file.
struct Row {
    world_to_camera: DMat4,
    size: UVec2,
    lens: OriginalLens,
}

/// Returns whether a folder has poses and cameras. Poses alone may belong to a COLMAP model (LLFF).
pub(super) fn is_there(folder: &Path) -> bool {
    folder.join(POSES).is_file()
        && (!super::colmap::is_there(folder) || cameras(folder).is_ok_and(|cameras| !cameras.is_empty()))
}

/// Reads the views of a folder.
pub(super) fn read(folder: &Path, options: &CameraOptions, mut videos: Videos<'_>) -> Result<Undivided, DatasetError> {
    let source = folder.join(POSES);
    let unusable = |reason: String| DatasetError::Unusable { path: source.clone(), reason };
    let failed = |frame: usize| {
        let path = source.clone();
        move |problem| DatasetError::Frame { path: path.clone(), frame, problem }
    };
    let rows = npy::rows::<COLUMNS>(&bytes(&source)?).map_err(unusable)?;
    let rows: Vec<Row> = rows
        .iter()
        .enumerate()
        .map(|(row, values)| self::row(values).map_err(failed(row)))
        .collect::<Result<_, _>>()?;
    let cameras: Vec<String> = cameras(folder)?.into_iter().collect();
    if cameras.len() != rows.len() {
        let names: Vec<&str> = cameras.iter().take(4).map(String::as_str).collect();
        return Err(unusable(format!(
            "it has {} cameras, and {} videos camNN.mp4 or folders camNN of frames lie beside it ({}, ...): they must go with the rows",
            rows.len(),
            cameras.len(),
            names.join(", ")
        )));
    }
    let mut frames = Vec::new();
    for camera in &cameras {
        frames.push(frames_of(folder, camera, &mut videos)?);
    }
    let decoded = frames.iter().flatten().filter(|frame| !is_video(frame));
    let first = decoded.filter_map(|frame| number(frame)).min().unwrap_or(0);
    let (mut names, mut unplaced, mut splits) = (HashSet::new(), Vec::new(), Vec::new());
    for (index, ((row, camera), frames)) in rows.iter().zip(&cameras).zip(&frames).enumerate() {
        let is_left = frames.iter().any(|frame| is_video(frame));
        let times = if is_left { vec![0.0] } else { times(frames, first) };
        for (frame, time) in frames.iter().zip(times) {
            let file = frame.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let label = format!("{camera}_{file}");
            let name = output_name(&label, unplaced.len(), &mut names)
                .ok_or_else(|| failed(index)(FrameProblem::FileName(label.clone())))?;
            let mask = masks::beside(folder, &Path::new(camera).join(file)).map(|path| Mask { path, applied: false });
            let frame = Frame {
                name,
                image: frame.clone(),
                mask,
                time,
                world_to_camera: row.world_to_camera,
                lens: row.lens,
                distortion: Distortion::default(),
            };
            unplaced.push(Unplaced { frame, original: row.size, failed: failed(index) });
            splits.push(Some(if index == 0 { Split::Test } else { Split::Train }));
        }
    }
    let Placed { views, origin, notes } = place(unplaced, options, true)?;
    Ok(Undivided { source, views, splits: Some(splits), clock: Clock::NUMBERED, points: None, notes, origin })
}

fn bytes(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes));
    read.map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })?;
    if bytes.len() as u64 > MAX_BYTES {
        let reason = format!("more than {MAX_BYTES} bytes are no poses of cameras");
        return Err(DatasetError::Unusable { path: path.to_owned(), reason });
    }
    Ok(bytes)
}

/// Returns the camera of a row. The columns of the rotation point down, right and backwards; the last one has height, width and focal length.
fn row(values: &[f64; COLUMNS]) -> Result<Row, FrameProblem> {
    let column = |column: usize| [0, 1, 2].map(|row: usize| values[5 * row + column]);
    let [down, right, backwards, position, [height, width, focal]] = [0, 1, 2, 3, 4].map(column);
    let mut rows = [[0.0; 4], [0.0; 4], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
    for (axis, row) in rows.iter_mut().take(3).enumerate() {
        *row = [right[axis], down[axis], -backwards[axis], position[axis]];
    }
    let size = checked_size(width, height)?;
    let lens = OriginalLens::Intrinsics { focal: DVec2::splat(focal), center: size.as_dvec2() / 2.0 };
    Ok(Row { world_to_camera: pose(&rows)?.inverse(), size, lens })
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
