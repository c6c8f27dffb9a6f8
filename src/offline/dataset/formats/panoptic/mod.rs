//! `PanopticSports`: recordings of the CMU Panoptic studio as prepared for Dynamic 3D Gaussians.
//!
//! In: a folder with `train_meta.json`, `test_meta.json` and the images that they name in `ims/`. Out: the views of all
//! cameras at all moments, and the file of points. Each file has, for each moment and each camera, the camera matrix
//! `k`, the matrix `w2c` from the world to the camera (OpenCV axes), and the name `fn` of the image, which is
//! `CAMERA/NUMBER.jpg`; `w` and `h` are the size of all pictures. Numbers count 30 frames a second.
//!
//! The pictures in `seg/` tell people and what they hold from the studio, which is to be seen, too: they are no
//! coverage. Masks are those in `masks/`.

mod points;

use super::files::{OnDisk, with_slashes};
use super::undivided::Undivided;
use super::{json, masks, moments};
use crate::codec::text::{is_obeyed, printable};
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::lens::{OriginalLens, checked_size};
use crate::offline::dataset::cameras::opencv;
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::cameras::pose::{pose, rows};
use crate::offline::dataset::{CameraOptions, Clock, DatasetError, FrameProblem, Split};
use glam::UVec2;
pub(crate) use points::points;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

/// The files of cameras and their splits.
const FILES: [(&str, Split); 2] = [("train_meta.json", Split::Train), ("test_meta.json", Split::Test)];
/// The folder of images.
const IMAGES: &str = "ims";
/// The folder of pictures that tell people from the studio.
const PEOPLE: &str = "seg";
/// The file of points.
const POINTS: &str = "init_pt_cld.npz";

/// The sentence about points.
const FIRST_MOMENT: &str = "its points are those of the first moment, and a training begins with them at any time";

/// The contents of a file.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct Meta {
    w: f64,
    h: f64,
    /// 3 x 3, for each camera of each moment, as the next two.
    k: Vec<Vec<Value>>,
    /// 4 x 4.
    w2c: Vec<Vec<Value>>,
    #[serde(rename = "fn")]
    names: Vec<Vec<String>>,
}

/// A file of cameras.
struct File {
    path: PathBuf,
    split: Split,
    size: UVec2,
    meta: Meta,
}

/// Returns whether a folder has a file of cameras.
pub(crate) fn is_there(folder: &Path) -> bool {
    FILES.iter().any(|(name, _)| folder.join(name).is_file())
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let there = FILES.into_iter().filter(|(name, _)| folder.join(name).is_file());
    let files: Vec<File> = there.map(|(name, split)| File::read(folder.join(name), split)).collect::<Result<_, _>>()?;
    let named: Vec<&[Vec<String>]> = files.iter().map(|file| &file.meta.names[..]).collect();
    let (times, counted) = moments::times(&named);
    let (on_disk, mut names, mut splits) = (OnDisk::default(), HashSet::new(), Vec::new());
    let mut unplaced = Vec::new();
    for (file, times) in files.iter().zip(times) {
        for (moment, time) in times.into_iter().enumerate() {
            for (camera, name) in file.meta.names[moment].iter().enumerate() {
                let failed = file.failed(name);
                let frame = file.frame(folder, (moment, camera), time, &on_disk, &mut names).map_err(&failed)?;
                unplaced.push(Unplaced { frame, original: file.size, failed });
                splits.push(Some(file.split));
            }
        }
    }
    let Placed { views, origin, notes: undone } = place(unplaced, options, true)?;
    let points = Some(folder.join(POINTS)).filter(|points| points.is_file());
    let known = [absent(folder), people(folder), points.as_ref().map(|_| FIRST_MOMENT.to_owned()), counted];
    let notes = known.into_iter().chain([on_disk.note()]).flatten().chain(undone).collect();
    let source = files.first().map_or_else(|| folder.join(FILES[0].0), |file| file.path.clone());
    Ok(Undivided { source, views, splits: Some(splits), clock: Clock::NUMBERED, points, notes, origin })
}

/// Returns a sentence about the file of a split that is not there.
fn absent(folder: &Path) -> Option<String> {
    let (name, split) = FILES.into_iter().find(|(name, _)| !folder.join(name).is_file())?;
    Some(format!("no {name} in it, so that it has no views of the split {split:?}"))
}

/// Returns a sentence about the pictures of people.
fn people(folder: &Path) -> Option<String> {
    folder.join(PEOPLE).is_dir().then(|| {
        format!(
            "{PEOPLE}/ tells people from what stands behind them, and is not used: whole pictures are trained on; to \
             train on the people alone, copy it to masks/"
        )
    })
}

impl File {
    fn read(path: PathBuf, split: Split) -> Result<Self, DatasetError> {
        let meta = Meta::deserialize(json::read(&path)?)
            .map_err(|reason| DatasetError::Json { path: path.clone(), reason })?;
        let unusable = |reason: String| DatasetError::Unusable { path: path.clone(), reason };
        meta.check().map_err(unusable)?;
        let size = checked_size(meta.w, meta.h).map_err(|problem| unusable(problem.to_string()))?;
        Ok(Self { path, split, size, meta })
    }

    /// Returns the error of a problem of an image.
    fn failed(&self, name: &str) -> impl Fn(FrameProblem) -> DatasetError {
        move |problem| {
            let reason = format!("image {}: {problem}", printable(name));
            DatasetError::Unusable { path: self.path.clone(), reason }
        }
    }

    /// Returns the frame of a camera at a moment.
    fn frame(
        &self,
        folder: &Path,
        (moment, camera): (usize, usize),
        time: f64,
        on_disk: &OnDisk,
        names: &mut HashSet<String>,
    ) -> Result<Frame, FrameProblem> {
        let name = &self.meta.names[moment][camera];
        let unnamed = || FrameProblem::FileName(name.clone());
        let file = with_slashes(name);
        let is_plain = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
        if name.contains(is_obeyed) || !Path::new(&*file).components().all(is_plain) {
            return Err(unnamed());
        }
        let label = file.strip_prefix("./").unwrap_or(&file).replace('/', "_");
        Ok(Frame {
            name: output_name(&label, names.len(), names).ok_or_else(unnamed)?,
            image: on_disk.find(folder, Path::new(IMAGES).join(&*file)),
            mask: masks::beside(folder, Path::new(&*file)).map(|path| Mask { path, applied: false }),
            time,
            world_to_camera: pose(&rows(&self.meta.w2c[moment][camera])?)?,
            lens: lens(&self.meta.k[moment][camera])?,
            distortion: Distortion::default(),
        })
    }
}

/// Returns the lens of a camera matrix.
fn lens(k: &Value) -> Result<OriginalLens, FrameProblem> {
    let is_no_matrix = |reason: serde_json::Error| {
        FrameProblem::Matrix(
            format!("k must be three rows of three numbers: {}", printable(&reason.to_string())).into(),
        )
    };
    let rows = <[[f64; 3]; 3]>::deserialize(k).map_err(is_no_matrix)?;
    opencv::lens(&std::array::from_fn(|index| rows[index / 3][index % 3]))
}

impl Meta {
    /// Checks that there is a matrix of each kind and a name for each camera of each moment.
    fn check(&self) -> Result<(), String> {
        let Self { k, w2c, names, .. } = self;
        let remedy = "write the file again with a k, a w2c and a fn for each camera of each moment";
        if k.len() != names.len() || w2c.len() != names.len() {
            let [k, w2c, names] = [k.len(), w2c.len(), names.len()];
            return Err(format!("it has {names} moments in fn, {k} in k and {w2c} in w2c: {remedy}"));
        }
        let counts = |moment: usize| [names[moment].len(), k[moment].len(), w2c[moment].len()];
        let is_uneven = |moment: &usize| counts(*moment).windows(2).any(|pair| pair[0] != pair[1]);
        let Some(moment) = (0..names.len()).find(is_uneven) else { return Ok(()) };
        let [names, k, w2c] = counts(moment);
        Err(format!("moment {moment} has {names} cameras in fn, {k} in k and {w2c} in w2c: {remedy}"))
    }
}
