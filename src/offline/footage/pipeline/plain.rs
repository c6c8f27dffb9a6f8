//! Folders of footage: whether their cameras are known, and whether they are ready to be trained on.
//!
//! In: a folder. Out: the names of its videos and folders of frames; the dataset that a bake or a training makes of it
//! first.

use crate::offline::dataset::formats::files::points_beside;
use crate::offline::dataset::formats::footage;
use crate::offline::dataset::formats::numbered::is_video;
use crate::offline::dataset::{Dataset, DatasetError};
use std::path::Path;

/// Returns the names of the videos and the folders of frames in a folder.
///
/// # Errors
/// Two videos or two folders of one name, a folder that cannot be listed.
pub(super) fn names(folder: &Path) -> Result<Vec<String>, DatasetError> {
    Ok(footage::found(folder)?.into_iter().map(|(name, _)| name).collect())
}

/// Returns the names of the videos and the folders of frames of footage whose cameras are not known; `None` for a
/// dataset, and for a folder without footage.
pub(crate) fn uncalibrated(folder: &Path) -> Option<Vec<String>> {
    let names = if Dataset::format(folder).is_some() { Vec::new() } else { names(folder).unwrap_or_default() };
    Some(names).filter(|names| !names.is_empty())
}

/// Returns whether a folder is made into a dataset before a capture is trained on it: footage whose cameras are not
/// known, and videos beside a calibration without points.
pub(crate) fn is_raw(folder: &Path) -> bool {
    let has_videos = || footage::found(folder).is_ok_and(|found| found.iter().any(|(_, path)| is_video(path)));
    let has_no_points = || Dataset::format(folder).is_some() && points_beside(folder).is_none();
    uncalibrated(folder).is_some() || has_no_points() && has_videos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn footage_is_told_from_datasets() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        assert_eq!((uncalibrated(folder.path()), is_raw(folder.path())), (None, false), "an empty folder");
        fs::create_dir(at("left")).expect("the folder can be made");
        fs::write(at("left/1.png"), b"").expect("the folder can be written to");
        fs::write(at("right.mp4"), b"").expect("the folder can be written to");
        let names = ["left", "right"].map(str::to_owned).to_vec();
        assert_eq!((uncalibrated(folder.path()), is_raw(folder.path())), (Some(names), true), "no cameras");
        fs::write(at("Calib.toml"), b"").expect("the folder can be written to");
        assert_eq!((uncalibrated(folder.path()), is_raw(folder.path())), (None, true), "videos beside a calibration");
        fs::write(at("points3d.ply"), b"").expect("the folder can be written to");
        assert!(!is_raw(folder.path()), "a dataset with points");
    }
}
