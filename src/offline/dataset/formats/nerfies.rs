//! Nerfies, `HyperNeRF` and `DyCheck`: a camera file for each picture.
//!
//! In: a folder with `dataset.json` (the names of the pictures: `ids`, `train_ids`, `val_ids`), `camera/ID.json` and
//! `rgb/1x/ID.png`, or pictures of a half, a quarter and so on of that size in `rgb/2x`, `rgb/4x`; possibly with
//! `scene.json` (center and scale), `metadata.json` (the number of the moment of each picture), `extra.json` (frames a
//! second) and `points.npy`. Out: the views of all pictures.
//!
//! Cameras and points are at (place − center) · scale. The moments are `time_id`, else `warp_id`. `val_ids` are the
//! test views, as in published figures.

use super::files::{OnDisk, is_plain, points_beside};
use super::numbered::{FRAME_RATE, entries, number};
use super::undivided::Undivided;
use super::{json, masks, npy};
use crate::codec::text::printable;
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::lens::{OriginalLens, check_skew, checked_size};
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::cameras::pose::pose;
use crate::offline::dataset::cloud_point::CloudPoint;
use crate::offline::dataset::{CameraOptions, Clock, DatasetError, FrameProblem, Split};
use crate::scene::Origin;
use glam::{DMat4, DVec2, UVec2};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The file that names the pictures.
const PICTURES: &str = "dataset.json";
/// The folder of camera files.
const CAMERAS: &str = "camera";
/// The file with center and scale.
const SCENE: &str = "scene.json";
/// The file with the moments of the pictures.
const METADATA: &str = "metadata.json";
/// The file with the frames a second.
const EXTRA: &str = "extra.json";
/// The file of points.
const POINTS: &str = "points.npy";
/// The entries of `metadata.json` that number moments, the first that is there.
const MOMENTS: [&str; 2] = ["time_id", "warp_id"];

/// The names of the pictures.
#[derive(Default, Deserialize)]
#[serde(default, expecting = "an object")]
struct Names {
    ids: Vec<Value>,
    train_ids: Vec<Value>,
    val_ids: Vec<Value>,
}

/// How places are normalized.
#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
struct Scene {
    center: [f64; 3],
    scale: f64,
}

/// A camera file.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct Entries {
    /// Rotation from the world to the camera, row by row, axes of OpenCV.
    orientation: [[f64; 3]; 3],
    position: [f64; 3],
    focal_length: f64,
    principal_point: [f64; 2],
    image_size: [f64; 2],
    skew: Option<f64>,
    pixel_aspect_ratio: Option<f64>,
    radial_distortion: Option<[f64; 3]>,
    /// The name of older files.
    tangential: Option<[f64; 2]>,
    tangential_distortion: Option<[f64; 2]>,
}

/// A picture with its split.
struct Picture {
    id: String,
    split: Option<Split>,
}

/// The camera of a picture.
struct Taken {
    size: UVec2,
    lens: OriginalLens,
    distortion: Distortion,
    world_to_camera: DMat4,
}

/// Returns whether a folder has names of pictures and camera files.
pub(crate) fn is_there(folder: &Path) -> bool {
    folder.join(PICTURES).is_file() && folder.join(CAMERAS).is_dir()
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let source = folder.join(PICTURES);
    let mut notes = Vec::new();
    let pictures = pictures(&source, &mut notes)?;
    let scene = Scene::beside(&source)?.unwrap_or_else(|| {
        notes.push(format!("it has no {SCENE}: places are those of the camera files"));
        Scene { center: [0.0; 3], scale: 1.0 }
    });
    let divisor = divisor(folder, &mut notes);
    let times = times(folder, &pictures, &mut notes)?;
    let (files, mut names, mut unplaced) = (OnDisk::default(), HashSet::new(), Vec::new());
    for (index, (Picture { id, .. }, time)) in pictures.iter().zip(times).enumerate() {
        let path = folder.join(CAMERAS).join(format!("{id}.json"));
        let failed = move |problem| DatasetError::Frame { path: path.clone(), frame: index, problem };
        let Taken { size, lens, distortion, world_to_camera } = taken(folder, id, &scene, divisor, &failed)?;
        let file = format!("{id}.png");
        let frame = Frame {
            name: output_name(&file, index, &mut names).ok_or_else(|| failed(FrameProblem::FileName(id.clone())))?,
            image: files.find(folder, format!("rgb/{divisor}x/{file}")),
            mask: masks::beside(folder, Path::new(&file)).map(|path| Mask { path, applied: false }),
            time,
            world_to_camera,
            lens,
            distortion,
        };
        unplaced.push(Unplaced { frame, original: size, failed });
    }
    let Placed { views, origin, notes: undone } = place(unplaced, options, true)?;
    notes.extend(files.note().into_iter().chain(undone));
    let splits = pictures.iter().any(|picture| picture.split.is_some());
    let splits = splits.then(|| pictures.iter().map(|picture| picture.split).collect());
    let points = Some(folder.join(POINTS)).filter(|points| points.is_file()).or_else(|| points_beside(folder));
    Ok(Undivided { source, views, splits, clock: Clock::NUMBERED, points, notes, origin })
}

/// Reads `points.npy`, whose places are normalized as those of the cameras by the file beside it.
///
/// # Errors
/// A file that cannot be read, or is no array of places.
pub(crate) fn points(path: &Path, origin: &Origin) -> Result<Vec<CloudPoint>, DatasetError> {
    let bytes = fs::read(path).map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })?;
    let places = npy::rows::<3>(&bytes, POINTS).map_err(|reason| unusable(path, reason))?;
    let scene = Scene::beside(path)?.unwrap_or(Scene { center: [0.0; 3], scale: 1.0 });
    let point = |place| CloudPoint::counted_from(origin, scene.normalized(place), None, None);
    Ok(places.into_iter().map(point).collect())
}

impl Scene {
    /// Reads the file in the folder of another file; `None` if it is not there.
    fn beside(file: &Path) -> Result<Option<Self>, DatasetError> {
        let path = file.with_file_name(SCENE);
        if !path.is_file() {
            return Ok(None);
        }
        let scene: Self = parsed(&path)?;
        if scene.scale > 0.0 {
            return Ok(Some(scene));
        }
        Err(unusable(&path, format!("its scale is {}, and must be above 0: correct it", scene.scale)))
    }

    fn normalized(&self, place: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| (place[axis] - self.center[axis]) * self.scale)
    }
}

/// Returns the pictures that are used: those of `val_ids` and `train_ids`, or all if one of these lists is empty.
fn pictures(source: &Path, notes: &mut Vec<String>) -> Result<Vec<Picture>, DatasetError> {
    let Names { ids, train_ids, val_ids } = parsed(source)?;
    let named = |ids: &[Value]| -> Result<Vec<String>, DatasetError> {
        ids.iter().map(|id| name(id).map_err(|reason| unusable(source, reason))).collect()
    };
    let [all, train, val] = [named(&ids)?, named(&train_ids)?, named(&val_ids)?];
    let listed: Vec<(String, Option<Split>)> = if !train.is_empty() && !val.is_empty() {
        notes.push(format!("its {} val_ids are the test views, as in published figures", val.len()));
        let used: HashSet<&String> = val.iter().chain(&train).collect();
        let unused = all.iter().filter(|id| !used.contains(id)).count();
        let sentence = || format!("pictures that are neither in train_ids nor in val_ids are left out: {unused}");
        notes.extend((unused > 0).then(sentence));
        let of = |ids: Vec<String>, split| ids.into_iter().map(move |id| (id, Some(split)));
        of(val, Split::Test).chain(of(train, Split::Train)).collect()
    } else {
        let longest = [all, train, val].into_iter().reduce(|a, b| if b.len() > a.len() { b } else { a });
        longest.unwrap_or_default().into_iter().map(|id| (id, None)).collect()
    };
    let (listings, mut seen) = (listed.len(), HashSet::new());
    let new = listed.into_iter().filter(|(id, _)| seen.insert(id.clone()));
    let pictures: Vec<Picture> = new.map(|(id, split)| Picture { id, split }).collect();
    let repeated = listings - pictures.len();
    if repeated > 0 {
        notes.push(format!(
            "pictures that are listed twice are used once, for the test if val_ids has them: {repeated}"
        ));
    }
    Ok(pictures)
}

/// Returns the name of a picture, which may be a number.
fn name(id: &Value) -> Result<String, String> {
    let name = match id {
        Value::String(name) => Some(name.clone()),
        Value::Number(number) => number.as_u64().map(|number| number.to_string()),
        _ => None,
    };
    name.filter(|name| is_plain(name)).ok_or_else(|| {
        let shown = printable(&id.to_string());
        format!("{shown} is no name of a picture, which has neither folders nor control characters: correct it")
    })
}

/// Returns the divisor of the size of the pictures, the smallest of the folders in `rgb`.
fn divisor(folder: &Path, notes: &mut Vec<String>) -> u32 {
    let folders = entries(&folder.join("rgb")).unwrap_or_default();
    let divisor = |path: &PathBuf| {
        let name = path.file_name()?.to_str()?.strip_suffix('x')?;
        name.parse().ok().filter(|divisor: &u32| *divisor > 0 && path.is_dir() && divisor.to_string() == name)
    };
    let smallest = folders.iter().filter_map(divisor).min().unwrap_or(1);
    if smallest > 1 {
        notes.push(format!("the pictures are those of rgb/{smallest}x, since rgb/1x is not there"));
    }
    smallest
}

/// Returns the times of the pictures, seconds. The first moment is time 0.
fn times(folder: &Path, pictures: &[Picture], notes: &mut Vec<String>) -> Result<Vec<f64>, DatasetError> {
    let path = folder.join(METADATA);
    let moments = if path.is_file() {
        let metadata = json::read(&path)?;
        pictures.iter().map(|Picture { id, .. }| moment(&path, &metadata, id)).collect::<Result<Vec<f64>, _>>()?
    } else {
        notes.push(format!("it has no {METADATA}: the numbers at the end of the names are those of moments"));
        pictures.iter().map(|Picture { id, .. }| number(Path::new(id)).unwrap_or(0) as f64).collect()
    };
    let rate = rate(folder, notes)?;
    let first = moments.iter().copied().fold(f64::INFINITY, f64::min);
    Ok(moments.into_iter().map(|moment| (moment - first) / rate).collect())
}

/// Returns the number of the moment of a picture.
fn moment(path: &Path, metadata: &Value, id: &str) -> Result<f64, DatasetError> {
    let entries = metadata.get(id);
    let numbers = entries.and_then(|entries| MOMENTS.into_iter().find_map(|name| entries.get(name)?.as_f64()));
    numbers.ok_or_else(|| {
        let reason = format!("it has no number warp_id for {}: add it", printable(id));
        unusable(path, reason)
    })
}

/// Returns the frames a second.
fn rate(folder: &Path, notes: &mut Vec<String>) -> Result<f64, DatasetError> {
    let path = folder.join(EXTRA);
    let rate =
        if path.is_file() { json::read(&path)?.get("fps").cloned().filter(|rate| !rate.is_null()) } else { None };
    match rate.map(|rate| rate.as_f64().filter(|rate| *rate > 0.0).ok_or(rate)) {
        Some(Ok(rate)) => Ok(rate),
        Some(Err(value)) => {
            let shown = printable(&value.to_string());
            Err(unusable(&path, format!("its fps is {shown}, and must be a number above 0: correct it")))
        }
        None => {
            let reason = format!("moments count at 30 a second: {EXTRA} with {{\"fps\": 15}} states another rate");
            notes.push(reason);
            Ok(FRAME_RATE)
        }
    }
}

/// Reads the camera of a picture whose sides are divided by a number.
fn taken(
    folder: &Path,
    id: &str,
    scene: &Scene,
    divisor: u32,
    failed: &impl Fn(FrameProblem) -> DatasetError,
) -> Result<Taken, DatasetError> {
    let path = folder.join(CAMERAS).join(format!("{id}.json"));
    if !path.is_file() {
        let reason = format!("no such file, and {PICTURES} names it: put it there, or remove the name");
        return Err(unusable(&path, reason));
    }
    let entries = Entries::deserialize(&json::read(&path)?).map_err(FrameProblem::Malformed).map_err(failed)?;
    entries.taken(scene, f64::from(divisor)).map_err(failed)
}

impl Entries {
    /// Returns the camera of a picture whose sides are divided by a number.
    fn taken(&self, scene: &Scene, divisor: f64) -> Result<Taken, FrameProblem> {
        let [width, height] = self.image_size;
        checked_size(width, height)?;
        let size = [width, height].map(|side| (side / divisor).round_ties_even());
        let focal = DVec2::new(1.0, self.pixel_aspect_ratio.unwrap_or(1.0)) * self.focal_length;
        let center = DVec2::from(self.principal_point);
        check_skew(self.skew.unwrap_or(0.0), focal.y, center.y, height)?;
        let [k1, k2, k3] = self.radial_distortion.unwrap_or_default();
        Ok(Taken {
            size: checked_size(size[0], size[1])?,
            lens: OriginalLens::Intrinsics { focal: focal / divisor, center: center / divisor },
            distortion: Distortion {
                radial: [k1, k2, k3, 0.0],
                tangential: self.tangential.or(self.tangential_distortion).unwrap_or_default(),
                ..Distortion::default()
            },
            world_to_camera: self.world_to_camera(scene)?,
        })
    }

    /// Returns the pose in normalized places.
    fn world_to_camera(&self, scene: &Scene) -> Result<DMat4, FrameProblem> {
        let position = scene.normalized(self.position);
        let mut rows = DMat4::IDENTITY.to_cols_array_2d();
        for (row, axis) in rows.iter_mut().zip(self.orientation) {
            let along: f64 = axis.iter().zip(position).map(|(a, b)| a * b).sum();
            *row = [axis[0], axis[1], axis[2], -along];
        }
        pose(&rows)
    }
}

/// Reads a file of JSON as a type.
fn parsed<T: DeserializeOwned>(path: &Path) -> Result<T, DatasetError> {
    serde_json::from_value(json::read(path)?).map_err(|reason| DatasetError::Json { path: path.to_owned(), reason })
}

fn unusable(path: &Path, reason: String) -> DatasetError {
    DatasetError::Unusable { path: path.to_owned(), reason }
}
