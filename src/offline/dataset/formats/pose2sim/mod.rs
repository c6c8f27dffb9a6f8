//! Pose2Sim, Anipose and Qualisys: a calibration with a video, or a folder of frames, for each camera.
//!
//! In: a folder with `*.qca.txt` or `Calib*.toml`, also in a folder in it whose name has `calib`. Out: the views of all
//! cameras at all frames.
//!
//! A file of Qualisys is preferred to a TOML: Pose2Sim's conversion divides the distortion by 64.

mod qualisys;
mod toml;

use super::footage::{self, listed};
use super::numbered::entries;
use super::undivided::Undivided;
use super::video::Videos;
use crate::offline::dataset::{CameraOptions, DatasetError};
use std::path::{Path, PathBuf};

/// A part of the names of calibrations in TOML and of folders of calibrations, in small letters.
const NAME: &str = "calib";
/// The end of the names of Qualisys' calibrations, in small letters.
const QUALISYS: &str = ".qca.txt";

/// Returns whether a folder has a calibration.
pub(crate) fn is_there(folder: &Path) -> bool {
    !calibrations(folder).is_empty()
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions, videos: Videos<'_>) -> Result<Undivided, DatasetError> {
    let mut found = calibrations(folder).into_iter();
    let missing = || DatasetError::Unusable { path: folder.to_owned(), reason: "no calibration in it".to_owned() };
    let path = found.next().ok_or_else(missing)?;
    let mut calibration = if is_qualisys(&path) { qualisys::read(&path)? } else { toml::read(&path)? };
    let others = listed(found.map(|other| name_of(&other)));
    if !others.is_empty() {
        let used = listed(std::iter::once(name_of(&path)));
        calibration.notes.push(format!("its cameras are those of {used}; other calibrations are not read: {others}"));
    }
    footage::read(folder, calibration, options, videos)
}

/// Returns the calibrations of a folder: those of Qualisys first, each kind by place and name.
fn calibrations(folder: &Path) -> Vec<PathBuf> {
    let has_name = |path: &PathBuf| lower_name(path).contains(NAME);
    let inside = entries(folder).unwrap_or_default();
    let folders = inside.iter().filter(|path| has_name(path) && path.is_dir());
    let deeper: Vec<PathBuf> = folders.flat_map(|path| entries(path).unwrap_or_default()).collect();
    let is_toml = |path: &PathBuf| lower_name(path).starts_with(NAME) && lower_name(path).ends_with(".toml");
    let mut found: Vec<PathBuf> = inside.into_iter().chain(deeper).collect();
    found.retain(|path| (is_qualisys(path) || is_toml(path)) && path.is_file());
    found.sort_by_key(|path| !is_qualisys(path));
    found
}

fn is_qualisys(path: &Path) -> bool {
    lower_name(path).ends_with(QUALISYS)
}

/// Returns the name of a file in small letters.
fn lower_name(path: &Path) -> String {
    name_of(path).to_lowercase()
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
