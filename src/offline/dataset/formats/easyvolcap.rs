//! `EasyVolcap`, `EasyMocap`, `ENeRF` and `SelfCap`: `intri.yml` and `extri.yml` with frames or a video of each camera.
//!
//! In: a folder with both files, in it or in `optimized/`. Out: the views of all cameras at all frames, which `footage`
//! finds as `images/CAMERA/` or `videos/CAMERA.mp4`.
//!
//! The files have for each of the cameras `names` the matrix `K_NAME`, the coefficients `D_NAME` or `dist_NAME`, the
//! size `W_NAME` and `H_NAME`, and, from the world to the camera, the rotation as a vector `R_NAME` or a matrix
//! `Rot_NAME` and the translation `T_NAME`. Principal points are counted from the corner of the picture, as
//! `EasyVolcap` does. `sync.json` has for each camera the seconds by which the times of its frames are too large.

use super::files::is_plain;
use super::footage::{self, Calibration, Clocks, RigCamera, listed};
use super::json;
use super::opencv_yaml::Storage;
use super::undivided::Undivided;
use super::video::Videos;
use crate::codec::text::printable;
use crate::offline::dataset::cameras::lens::checked_size;
use crate::offline::dataset::cameras::{opencv, pose};
use crate::offline::dataset::{CameraOptions, DatasetError, FrameProblem};
use glam::DMat4;
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The file of lenses.
const INTRI: &str = "intri.yml";
/// The file of poses.
const EXTRI: &str = "extri.yml";
/// The file of clocks.
const SYNC: &str = "sync.json";
/// A folder with better cameras than those of the folder of the dataset.
const OPTIMIZED: &str = "optimized";
/// Folders of frames and videos.
const FOOTAGE: [&str; 3] = ["images", "videos", "frames"];
/// The matrix that corrects no color.
const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
/// Frames a second of `SelfCap`, the only dataset with a file of clocks.
const SELFCAP: f64 = 60.0;

/// Returns whether a folder has lenses, and frames or videos.
pub(crate) fn is_there(folder: &Path) -> bool {
    calibration(folder).is_some() && FOOTAGE.iter().any(|inside| folder.join(inside).is_dir())
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions, videos: Videos<'_>) -> Result<Undivided, DatasetError> {
    let at = calibration(folder).unwrap_or_else(|| folder.to_owned());
    let (lenses, poses) = (Storage::read(&at.join(INTRI))?, Storage::read(&at.join(EXTRI))?);
    let names = names(&lenses)?;
    let cameras = names.iter().map(|name| camera(&lenses, &poses, name)).collect::<Result<Vec<_>, _>>()?;
    let mut notes = Vec::new();
    if at != folder && folder.join(INTRI).is_file() {
        notes.push(format!("its cameras are those in {OPTIMIZED}/, not those beside it"));
    }
    notes.extend(unused(&lenses, &poses, &names));
    let clocks = match [at, folder.to_owned()].map(|place| place.join(SYNC)).into_iter().find(|path| path.is_file()) {
        Some(path) => clocks(&path, &names, &mut notes)?,
        None => Clocks::default(),
    };
    let source = lenses.path().to_owned();
    footage::read_by(folder, Calibration { source, cameras, notes }, &clocks, options, videos)
}

/// Returns the folder of the lenses.
fn calibration(folder: &Path) -> Option<PathBuf> {
    [folder.join(OPTIMIZED), folder.to_owned()].into_iter().find(|place| place.join(INTRI).is_file())
}

/// Returns the names of the cameras, at least one.
fn names(lenses: &Storage) -> Result<Vec<String>, DatasetError> {
    let names = lenses.texts("names")?.unwrap_or_else(|| lenses.names_after("K_"));
    let unusable = |reason: String| DatasetError::Unusable { path: lenses.path().to_owned(), reason };
    if names.is_empty() {
        return Err(unusable("it has no cameras: write their names into the list names".to_owned()));
    }
    match names.iter().find(|name| !is_plain(name)) {
        Some(name) => {
            let shown = printable(name);
            Err(unusable(format!("the name {shown:?} of a camera is that of no folder: rename the camera")))
        }
        None => Ok(names),
    }
}

/// Returns a camera.
fn camera(lenses: &Storage, poses: &Storage, name: &str) -> Result<RigCamera, DatasetError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |problem: FrameProblem| DatasetError::Unusable {
            path: path.clone(),
            reason: format!("camera {}: {problem}", printable(name)),
        }
    };
    let of_lens = failed(lenses.path());
    let coefficients = match lenses.numbers(&format!("D_{name}"))? {
        Some(coefficients) => coefficients,
        None => lenses.numbers(&format!("dist_{name}"))?.unwrap_or_default(),
    };
    Ok(RigCamera {
        name: name.to_owned(),
        size: size(lenses, name)?.map(|[width, height]| checked_size(width, height)).transpose().map_err(&of_lens)?,
        world_to_camera: world_to_camera(poses, name, failed(poses.path()))?,
        lens: opencv::lens(&lenses.exactly(&format!("K_{name}"))?).map_err(&of_lens)?,
        distortion: opencv::distortion(&coefficients).map_err(&of_lens)?,
    })
}

/// Returns width and height of the pictures, if both are there.
fn size(lenses: &Storage, name: &str) -> Result<Option<[f64; 2]>, DatasetError> {
    let [width, height] = ["W", "H"].map(|side| lenses.number(&format!("{side}_{name}")));
    // Sizes that are not known are -1 or 0.
    let sides = width?.zip(height?).map(|(width, height)| [width, height]);
    Ok(sides.filter(|sides| sides.iter().all(|side| *side > 0.0)))
}

/// Returns the world-to-camera matrix of a camera.
///
/// # Errors
/// A rotation or a translation that is missing; a vector and a matrix that are different rotations.
fn world_to_camera(
    poses: &Storage,
    name: &str,
    failed: impl Fn(FrameProblem) -> DatasetError,
) -> Result<DMat4, DatasetError> {
    let translation = poses.exactly::<3>(&format!("T_{name}"))?;
    let mut found = Vec::new();
    for entry in [format!("R_{name}"), format!("Rot_{name}")] {
        let Some(numbers) = poses.numbers(&entry)? else { continue };
        found.push(match numbers[..] {
            [x, y, z] => opencv::pose_of_vector([x, y, z], translation).map_err(&failed)?,
            _ => opencv::pose_of_rows(&poses.exactly(&entry)?, translation).map_err(&failed)?,
        });
    }
    match found[..] {
        [] => Err(poses.missing(&format!("R_{name} and no Rot_{name}"))),
        // Their translations are the same.
        [first, second] if !first.abs_diff_eq(second, pose::ROUNDED) => {
            let shown = printable(name);
            let reason = format!("R_{shown} and Rot_{shown} are different rotations: remove the wrong one");
            Err(DatasetError::Unusable { path: poses.path().to_owned(), reason })
        }
        [first, ..] => Ok(first),
    }
}

/// Returns sentences about entries that are not used.
fn unused(lenses: &Storage, poses: &Storage, names: &[String]) -> Vec<String> {
    let with = |storage: &Storage, entry: &str, without: &[f64]| {
        let differs = |name: &&String| {
            let entry = format!("{entry}_{name}");
            let number = storage.number(&entry).ok().flatten().map(|number| vec![number]);
            let numbers = number.or_else(|| storage.numbers(&entry).ok().flatten()).unwrap_or_default();
            numbers != without && numbers.iter().any(|number| *number != 0.0)
        };
        listed(names.iter().filter(differs).cloned())
    };
    let sentences = [
        ("corrections of color (ccm) are not made", with(lenses, "ccm", &IDENTITY)),
        ("the distortion rdist is taken as undone already", with(lenses, "rdist", &[])),
        ("the times t of cameras are not used, but the numbers of frames", with(poses, "t", &[])),
    ];
    let said = sentences.into_iter().filter(|(_, names)| !names.is_empty());
    said.map(|(sentence, names)| format!("{sentence}: {names}")).collect()
}

/// Reads the file of clocks.
///
/// # Errors
/// A file that is no JSON, or has no offset of a camera.
fn clocks(path: &Path, names: &[String], notes: &mut Vec<String>) -> Result<Clocks, DatasetError> {
    let json = json::read(path)?;
    let mut late = HashMap::new();
    for name in names {
        let seconds = json.get(name).and_then(Value::as_f64).ok_or_else(|| {
            let reason = format!(
                "it has no offset in seconds of camera {}: add it, or remove the file if the cameras are synchronized",
                printable(name)
            );
            DatasetError::Unusable { path: path.to_owned(), reason }
        })?;
        late.insert(name.clone(), seconds);
    }
    let ends = |pick: fn(f64, f64) -> f64| late.values().copied().reduce(pick).unwrap_or(0.0);
    notes.push(format!(
        "{SYNC} moves the clocks of cameras against each other by up to {:.3} s; frames have the rate of a video of \
         their name, else that of SelfCap, {SELFCAP} a second",
        ends(f64::max) - ends(f64::min)
    ));
    Ok(Clocks { rate: Some(SELFCAP), late })
}
