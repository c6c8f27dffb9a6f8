//! Technicolor: `cameras_parameters.txt` with pictures `NAME_FRAME_CAMERA.png`.
//!
//! In: a folder. Out: the views of all cameras at all frames, 30 a second. After a line of names, the file has a line
//! for each camera: focal length, principal point (x, y), aspect ratio, skew, possibly two coefficients of distortion,
//! rotation (w, x, y, z) and translation from the world to the camera, with the axes of OpenCV. Pictures have the size
//! that they have on disk.
//!
//! The pictures lie in the folder, in `images/` or in `frames/`, and their names end in the numbers of the frame and of
//! the camera, from 0. Without any, each camera has a folder of frames or a video, which `footage` finds: `cam00`,
//! `camera_0` or `00`. Of sixteen cameras, number 10 is the test camera, as in published figures.

use super::files::{points_beside, utf8_or_latin1};
use super::footage::{self, Calibration, RigCamera};
use super::numbered::{FRAME_RATE, entries, is_image, is_video};
use super::standing::{self, Shot, Standing};
use super::undivided::Undivided;
use super::video::Videos;
use super::{limited, picture_size};
use crate::codec::text::without_mark;
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::lens::{OriginalLens, check_skew};
use crate::offline::dataset::cameras::placing::Placed;
use crate::offline::dataset::cameras::pose;
use crate::offline::dataset::{CameraOptions, Clock, DatasetError, Split, TrainingView};
use glam::{DMat4, DVec2, UVec2};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file of cameras.
const CAMERAS: &str = "cameras_parameters.txt";
/// Most bytes of the file.
const MAX_BYTES: u64 = 1 << 22;
/// Numbers of a line, without and with distortion.
const COLUMNS: [usize; 2] = [12, 14];
/// Largest error of the length of a quaternion.
const ROUNDED: f64 = 1e-2;
/// Folders in which pictures lie: that of the dataset, and these in it.
const PLACES: [&str; 3] = ["", "images", "frames"];
/// Words before the number in the name of the folder or the video of a camera.
const WORDS: [&str; 4] = ["", "cam", "camera", "view"];
/// A part of the names of pictures whose distortion has been undone.
const UNDISTORTED: &str = "undist";
/// The test camera, and the number of cameras with which it is that.
const TEST: (usize, usize) = (10, 16);
/// Share of a side of the picture that a principal point is at least away from its ends.
const CENTRAL: f64 = 0.25;
/// Most numbers of cameras that a sentence lists.
const LISTED: usize = 8;

/// A line of the file.
struct Line {
    focal: DVec2,
    center: DVec2,
    skew: f64,
    world_to_camera: DMat4,
}

/// The pictures of a camera by the numbers of the frames.
type Frames = BTreeMap<u64, PathBuf>;

/// Returns whether a folder has the file.
pub(crate) fn is_there(folder: &Path) -> bool {
    folder.join(CAMERAS).is_file()
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions, videos: Videos<'_>) -> Result<Undivided, DatasetError> {
    let source = folder.join(CAMERAS);
    let lines = lines(&source)?;
    for (frame, Line { focal, center, skew, .. }) in lines.iter().enumerate() {
        let failed = |problem| DatasetError::Frame { path: source.clone(), frame, problem };
        // The size of the pictures is not known yet: the center counts as the middle.
        check_skew(*skew, focal.y, center.y, 2.0 * center.y).map_err(failed)?;
    }
    let mut all = match pictures(folder, lines.len())? {
        Some(frames) => of_pictures(folder, source, &lines, frames, options)?,
        None => of_footage(folder, source, &lines, options, videos)?,
    };
    all.notes.extend(off_center(&lines, &all.views));
    Ok(all)
}

/// Reads the lines of the file.
fn lines(path: &Path) -> Result<Vec<Line>, DatasetError> {
    let bytes = limited::bytes(path, MAX_BYTES, "file of cameras")?;
    let text = utf8_or_latin1(without_mark(&bytes));
    let filled = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let mut lines = Vec::new();
    for (place, (number, text)) in filled.enumerate() {
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        let numbers = numbers.filter(|numbers| COLUMNS.contains(&numbers.len()));
        match numbers.map(|numbers| Line::of(&numbers)) {
            // The line of names.
            None if place == 0 => {}
            Some(Ok(line)) => lines.push(line),
            fault => {
                let form = || "must be the 12 numbers f cx cy aspect skew qw qx qy qz tx ty tz".to_owned();
                let reason = fault.and_then(Result::err).unwrap_or_else(form);
                return Err(unusable(path, format!("line {}: {reason}", number + 1)));
            }
        }
    }
    Ok(lines)
}

impl Line {
    /// Reads the 12 or 14 numbers of a line.
    fn of(numbers: &[f64]) -> Result<Self, String> {
        let (&[focal, x, y, aspect, skew], rest) = numbers.split_first_chunk::<5>().ok_or("it is too short")?;
        let (distortion, &[w, qx, qy, qz, tx, ty, tz]) = rest.split_last_chunk::<7>().ok_or("it is too short")?;
        if distortion.iter().any(|value| *value != 0.0) {
            let reason = "its pictures are distorted, by a formula that is not known: take the undistorted pictures, \
                          and their cameras_parameters.txt with 12 numbers a line";
            return Err(reason.to_owned());
        }
        let rotation = [w, qx, qy, qz];
        let length = rotation.iter().map(|value| value * value).sum::<f64>().sqrt();
        let is_unit = (length - 1.0).abs() <= ROUNDED;
        if !is_unit {
            return Err(format!(
                "the quaternion qw qx qy qz has the length {length}, not 1: write the columns in order"
            ));
        }
        let world_to_camera = pose::of_rotation(rotation, [tx, ty, tz]).map_err(|problem| problem.to_string())?;
        Ok(Self { focal: DVec2::new(focal, aspect * focal), center: DVec2::new(x, y), skew, world_to_camera })
    }

    fn lens(&self) -> OriginalLens {
        OriginalLens::Intrinsics { focal: self.focal, center: self.center }
    }
}

/// Returns the pictures of each camera, whose names end in the numbers of the frame and of the camera; `None` if there
/// are none.
///
/// # Errors
/// A camera that is not in the file, two pictures of one camera and one frame.
fn pictures(folder: &Path, cameras: usize) -> Result<Option<BTreeMap<usize, Frames>>, DatasetError> {
    for place in PLACES {
        let mut found: Vec<(u64, usize, PathBuf)> = Vec::new();
        for path in entries(&folder.join(place))?.into_iter().filter(|path| is_image(path) && path.is_file()) {
            found.extend(numbers(&path).map(|(frame, camera)| (frame, camera, path)));
        }
        let is_undistorted = |(_, _, path): &(u64, usize, PathBuf)| {
            path.file_name().is_some_and(|name| name.to_string_lossy().to_lowercase().contains(UNDISTORTED))
        };
        if found.iter().any(is_undistorted) {
            found.retain(is_undistorted);
        }
        if !found.is_empty() {
            return sorted(found, cameras).map(Some);
        }
    }
    Ok(None)
}

/// Sorts pictures by camera and frame. Cameras are counted from 1 if the last one is the number of cameras.
fn sorted(found: Vec<(u64, usize, PathBuf)>, cameras: usize) -> Result<BTreeMap<usize, Frames>, DatasetError> {
    let first = first_camera(found.iter().map(|(_, camera, _)| *camera), cameras);
    let mut sorted: BTreeMap<usize, Frames> = BTreeMap::new();
    for (frame, camera, path) in found {
        let camera = camera - first;
        if camera >= cameras {
            let reason = format!(
                "it is a picture of camera {}, and {CAMERAS} has the cameras 0 to {}: remove it, or add the camera",
                camera + first,
                cameras.saturating_sub(1)
            );
            return Err(unusable(&path, reason));
        }
        if let Some(other) = sorted.entry(camera).or_default().insert(frame, path.clone()) {
            let reason = format!("it has the camera and the frame of {}: remove one of them", other.display());
            return Err(unusable(&path, reason));
        }
    }
    Ok(sorted)
}

/// Returns the number of the first camera: 1 if the last number is that of cameras and 0 is not there, else 0.
fn first_camera(numbers: impl Iterator<Item = usize>, cameras: usize) -> usize {
    let (least, most) = numbers.fold((usize::MAX, 0), |(least, most), number| (least.min(number), most.max(number)));
    usize::from(least >= 1 && most == cameras)
}

/// Returns the numbers of the frame and of the camera at the end of the name of a picture.
fn numbers(path: &Path) -> Option<(u64, usize)> {
    let (rest, camera) = path.file_stem()?.to_str()?.rsplit_once('_')?;
    let frame = rest.rsplit_once('_').map_or(rest, |(_, frame)| frame);
    let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if is_number(frame) && is_number(camera) { Some((frame.parse().ok()?, camera.parse().ok()?)) } else { None }
}

/// Returns the views of cameras whose pictures have been found.
fn of_pictures(
    folder: &Path,
    source: PathBuf,
    lines: &[Line],
    mut frames: BTreeMap<usize, Frames>,
    options: &CameraOptions,
) -> Result<Undivided, DatasetError> {
    let first = frames.values().filter_map(|frames| frames.keys().next()).copied().min().unwrap_or(0);
    let (mut cameras, mut missing) = (Vec::new(), Vec::new());
    for (index, line) in lines.iter().enumerate() {
        let Some(frames) = frames.remove(&index) else {
            missing.push(index.to_string());
            continue;
        };
        let size = size(&source, &frames, options)?;
        let shot = |(frame, image): (u64, PathBuf)| Shot { image, time: (frame - first) as f64 / FRAME_RATE };
        cameras.push(Standing {
            name: String::new(),
            index,
            shots: frames.into_iter().map(shot).collect(),
            size,
            world_to_camera: line.world_to_camera,
            lens: line.lens(),
            distortion: Distortion::default(),
        });
    }
    let mut notes = Vec::new();
    if !missing.is_empty() {
        let more = if missing.len() > LISTED { ", ..." } else { "" };
        let listed = missing[..missing.len().min(LISTED)].join(", ");
        notes.push(format!("cameras without pictures are left out: {} (number {listed}{more})", missing.len()));
    }
    let (test, count) = TEST;
    let has_test = lines.len() == count && cameras.iter().any(|camera| camera.index == test);
    let splits = has_test.then(|| standing::splits(&cameras, |camera| camera.index == test));
    notes.extend(has_test.then(test_note));
    let Placed { views, origin, notes: undone } = standing::views(folder, &source, cameras, options)?;
    notes.extend(undone);
    Ok(Undivided { source, views, splits, clock: Clock::NUMBERED, points: points_beside(folder), notes, origin })
}

/// Returns the size of the first picture of a camera.
fn size(source: &Path, frames: &Frames, options: &CameraOptions) -> Result<UVec2, DatasetError> {
    let first = frames.values().next();
    let found = first.map(|image| picture_size::of_image(image, options)).transpose()?.flatten();
    found.or(options.size).ok_or_else(|| DatasetError::SizeUnknown { path: source.to_owned() })
}

fn test_note() -> String {
    format!("camera {} is the test camera, as in published figures of {} cameras", TEST.0, TEST.1)
}

/// Returns the views of cameras with a folder of frames or a video each.
fn of_footage(
    folder: &Path,
    source: PathBuf,
    lines: &[Line],
    options: &CameraOptions,
    videos: Videos<'_>,
) -> Result<Undivided, DatasetError> {
    let names = names(folder, lines.len())?;
    let camera = |(index, line): (usize, &Line)| RigCamera {
        name: names.get(&index).cloned().unwrap_or_else(|| format!("cam{index:02}")),
        size: None,
        world_to_camera: line.world_to_camera,
        lens: line.lens(),
        distortion: Distortion::default(),
    };
    let cameras: Vec<RigCamera> = lines.iter().enumerate().map(camera).collect();
    let (test, count) = TEST;
    let calibration = Calibration { source, cameras, notes: Vec::new() };
    let (mut all, of_views) = footage::read_with_cameras(folder, calibration, options, videos)?;
    if lines.len() == count && of_views.contains(&test) {
        let split = |camera: &usize| Some(if *camera == test { Split::Test } else { Split::Train });
        all.splits = Some(of_views.iter().map(split).collect());
        all.notes.push(test_note());
    }
    Ok(all)
}

/// Returns the names of folders and videos by the numbers of their cameras.
fn names(folder: &Path, cameras: usize) -> Result<BTreeMap<usize, String>, DatasetError> {
    let mut found = BTreeMap::new();
    for place in PLACES {
        for path in entries(&folder.join(place))?.into_iter().filter(|path| path.is_dir() || is_video(path)) {
            let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
            let name = name.and_then(|name| name.to_str()).unwrap_or_default();
            let word = name.trim_end_matches(|c: char| c.is_ascii_digit());
            let is_camera = WORDS.contains(&&*word.trim_end_matches(['_', '-', ' ']).to_lowercase());
            if let (true, Ok(number)) = (is_camera, name[word.len()..].parse::<usize>()) {
                found.entry(number).or_insert_with(|| name.to_owned());
            }
        }
    }
    let first = first_camera(found.keys().copied(), cameras);
    Ok(found.into_iter().map(|(number, name)| (number - first, name)).collect())
}

/// Returns a sentence if principal points are far from the centers of the pictures, as of pictures that were scaled.
fn off_center(lines: &[Line], views: &[TrainingView]) -> Option<String> {
    let size = views.first()?.original;
    let share = |line: &Line| line.center / size.as_dvec2();
    let is_central = |line: &Line| {
        let share = share(line);
        share.min_element() >= CENTRAL && share.max_element() <= 1.0 - CENTRAL
    };
    let DVec2 { x, y } = lines.iter().find(|line| !is_central(line))?.center;
    Some(format!(
        "a principal point is at {x}, {y} in pictures of {} x {} pixels, far from their center: if the pictures were \
         scaled, scale f, cx and cy of {CAMERAS}, too",
        size.x, size.y
    ))
}

fn unusable(path: &Path, reason: String) -> DatasetError {
    DatasetError::Unusable { path: path.to_owned(), reason }
}
