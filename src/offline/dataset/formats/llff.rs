//! LLFF: `poses_bounds.npy` with pictures in `images/` or `frames/`.
//!
//! In: a folder. Out: the views of its pictures. There are three kinds of folders:
//!
//! * one picture for each row, in the order of their names: pictures of a scene at rest, at time 0, or frames of a
//!   camera that moves, at the times of their numbers. They are frames if their folder is `frames`, or if a folder
//!   that only datasets of moving scenes have lies beside it;
//! * `NAME_FRAME.png`: frames of as many cameras as the file has rows, by what stands before the number at the end;
//! * a folder of frames for each row.
//!
//! A COLMAP model beside the file is read instead of it, and folders and videos `camNN` are those of N3V.

use super::files::points_beside;
use super::numbered::{entries, images, is_image, number, times};
use super::poses_bounds::{self, POSES};
use super::standing::{self, Shot};
use super::undivided::Undivided;
use super::{colmap, n3v};
use crate::offline::dataset::cameras::placing::Placed;
use crate::offline::dataset::{CameraOptions, Clock, DatasetError};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The folders of pictures.
const FOLDERS: [&str; 2] = ["images", FRAMES];
/// The folder whose pictures are frames of a camera that moves.
const FRAMES: &str = "frames";
/// Folders that only datasets of moving scenes have, as NSFF writes them.
const OF_MOTION: [&str; 6] = ["mv_images", "motion_masks", "flow_i1", "flow_i2", "flow", "optical_flow"];

/// The pictures of a folder, by the rows.
enum Pictures {
    /// One for each row, in this folder.
    Single(&'static str, Vec<PathBuf>),
    /// The frames of a camera for each row. The name is empty if the names of the frames have it.
    Cameras(Vec<(String, Vec<PathBuf>)>),
}

/// Returns whether a folder has poses and pictures, and is neither of N3V nor of COLMAP.
pub(crate) fn is_there(folder: &Path) -> bool {
    let is_picture = |path: &PathBuf| is_image(path) || path.is_dir();
    let has_pictures =
        |inside: &str| entries(&folder.join(inside)).is_ok_and(|entries: Vec<PathBuf>| entries.iter().any(is_picture));
    folder.join(POSES).is_file()
        && FOLDERS.into_iter().any(has_pictures)
        && !colmap::is_there(folder)
        && !n3v::has_cameras(folder)
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let source = folder.join(POSES);
    let rows = poses_bounds::read(&source)?;
    let (mut notes, clock, cameras) = match pictures(folder, &source, rows.len())? {
        Pictures::Single(inside, files) => {
            let motion = motion(folder, inside).filter(|_| !options.is_static);
            let clock = if motion.is_some() { Clock::NUMBERED } else { Clock::default() };
            let notes = assumed(&files, motion.as_deref(), options.is_static);
            (notes, clock, single(files, motion.is_some()))
        }
        Pictures::Cameras(cameras) => {
            let (names, frames): (Vec<String>, Vec<Vec<PathBuf>>) = cameras.into_iter().unzip();
            (Vec::new(), Clock::NUMBERED, names.into_iter().zip(standing::timed(frames)).collect())
        }
    };
    let parts = rows.into_iter().zip(cameras).enumerate();
    let cameras = parts.map(|(index, (row, (name, shots)))| row.with(name, index, shots)).collect();
    let Placed { views, origin, notes: undone } = standing::views(folder, &source, cameras, options)?;
    notes.push(format!(
        "{POSES} has neither a principal point nor a distortion: the center of the picture and none are assumed"
    ));
    notes.extend(undone);
    Ok(Undivided { source, views, splits: None, clock, points: points_beside(folder), notes, origin })
}

/// Returns the only picture of each row, at the time of its number if the pictures are frames, else at time 0.
fn single(files: Vec<PathBuf>, are_frames: bool) -> Vec<(String, Vec<Shot>)> {
    let first = files.iter().filter_map(|file| number(file)).min().unwrap_or(0);
    let times = if are_frames { times(&files, first) } else { vec![0.0; files.len()] };
    files.into_iter().zip(times).map(|(image, time)| (String::new(), vec![Shot { image, time }])).collect()
}

/// Returns the reason why single pictures are frames of a moving scene, if they are.
fn motion(folder: &Path, inside: &str) -> Option<String> {
    if inside == FRAMES {
        return Some(format!("their folder is {FRAMES}"));
    }
    let found = OF_MOTION.into_iter().find(|name| folder.join(name).is_dir())?;
    Some(format!("the folder {found} lies beside them"))
}

/// Returns sentences about what is assumed of single pictures, which are frames for the reason `motion`.
fn assumed(files: &[PathBuf], motion: Option<&str>, is_static: bool) -> Vec<String> {
    let count = files.len();
    let kind = match motion {
        Some(reason) => format!(
            "its {count} pictures are read as frames of a camera that moves, 30 a second by their numbers, since \
             {reason}: --static reads them as pictures of a scene at rest"
        ),
        None => format!(
            "its {count} pictures are read as pictures of a scene at rest: if they are frames of a camera that moves, \
             name their folder {FRAMES}"
        ),
    };
    let is_in_order = files.is_sorted_by_key(|file| number(file));
    let order = (!is_in_order).then(|| {
        format!(
            "the rows of {POSES} go with the pictures in the order of their names as text, not of their numbers, as \
             LLFF writes them"
        )
    });
    Some(kind).filter(|_| !is_static).into_iter().chain(order).collect()
}

/// Returns the pictures that go with the rows.
///
/// # Errors
/// As many pictures, cameras or folders as rows are not there.
fn pictures(folder: &Path, source: &Path, rows: usize) -> Result<Pictures, DatasetError> {
    let mut found = Vec::new();
    for inside in FOLDERS {
        let place = folder.join(inside);
        let files: Vec<PathBuf> =
            entries(&place)?.into_iter().filter(|path| is_image(path) && path.is_file()).collect();
        let folders = folders(&place)?;
        let counts = [files.len(), folders.len()];
        if files.len() == rows {
            return Ok(Pictures::Single(inside, files));
        }
        for cameras in [by_name(files), folders] {
            if cameras.len() == rows {
                return Ok(Pictures::Cameras(cameras));
            }
        }
        if counts != [0, 0] {
            found.push(format!("{} pictures and {} folders of pictures in {inside}", counts[0], counts[1]));
        }
    }
    let reason = format!(
        "it has {rows} rows, and beside it are {}: each row needs its picture, in the order of their names, or the \
         frames of its camera; remove pictures that have no row",
        if found.is_empty() { "no pictures".to_owned() } else { found.join(", ") }
    );
    Err(DatasetError::Unusable { path: source.to_owned(), reason })
}

/// Returns the frames of each camera, by what stands in their names before the number at their end; none if a picture
/// has no number.
fn by_name(files: Vec<PathBuf>) -> Vec<(String, Vec<PathBuf>)> {
    let mut cameras: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for file in files {
        let stem = file.file_stem().and_then(|stem| stem.to_str()).filter(|_| number(&file).is_some());
        let Some(stem) = stem else { return Vec::new() };
        let camera = stem.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
        cameras.entry(camera).or_default().push(file);
    }
    let sorted = |mut frames: Vec<PathBuf>| {
        frames.sort_by_cached_key(|frame| number(frame));
        (String::new(), frames)
    };
    cameras.into_values().map(sorted).collect()
}

/// Returns the folders of frames inside of a folder, by name.
fn folders(place: &Path) -> Result<Vec<(String, Vec<PathBuf>)>, DatasetError> {
    let mut cameras = Vec::new();
    for path in entries(place)? {
        let frames = images(&path)?;
        let name = path.file_name().and_then(|name| name.to_str());
        if let Some(name) = name.filter(|_| !frames.is_empty()) {
            cameras.push((name.to_owned(), frames));
        }
    }
    Ok(cameras)
}
