//! Frames of a camera: image files whose names end in a number.
//!
//! In: a folder. Out: its images in the order of their numbers, and the times of numbered frames, at 30 frames a
//! second.

use crate::codec::hidden::is_hidden;
use crate::offline::dataset::DatasetError;
use std::fs;
use std::path::{Path, PathBuf};

/// Frames a second of numbered frames, as in N3V.
pub(crate) const FRAME_RATE: f64 = 30.0;

/// Extensions of images.
pub(crate) const IMAGE_EXTENSIONS: [&str; 4] = ["png", "jpg", "jpeg", "exr"];

/// Returns whether a path ends in the extension of an image.
pub(crate) fn is_image(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    IMAGE_EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// Returns the images of a folder by number, then by name; none if there is no such folder.
pub(crate) fn images(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut images: Vec<PathBuf> =
        entries(folder)?.into_iter().filter(|path| is_image(path) && path.is_file()).collect();
    images.sort_by_cached_key(|path| (number(path), path.clone()));
    Ok(images)
}

/// Returns the paths in a folder, sorted, without hidden files and those of systems; none if there is no such folder.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut paths = all_entries(folder)?;
    paths.retain(|path| !path.file_name().is_some_and(is_hidden));
    Ok(paths)
}

/// Returns all paths in a folder, sorted; none if there is no such folder.
pub(crate) fn all_entries(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let failed = |reason| DatasetError::Read { path: folder.to_owned(), reason };
    let paths = fs::read_dir(folder).map_err(failed)?.map(|entry| entry.map(|entry| entry.path()));
    let mut paths: Vec<PathBuf> = paths.collect::<Result<_, _>>().map_err(failed)?;
    paths.sort();
    Ok(paths)
}

/// Returns the number at the end of a path's stem.
pub(crate) fn number(path: &Path) -> Option<u64> {
    let stem = path.file_stem()?.to_str()?;
    let digits = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    stem[digits..].parse().ok()
}

/// Returns the time of each frame, seconds, at 30 frames a second: its number minus `first`, or its place in the list
/// if a frame has no number.
pub(crate) fn times(frames: &[PathBuf], first: u64) -> Vec<f64> {
    times_at(frames, first, FRAME_RATE)
}

/// Returns the times of frames as [`times`] does, at another rate, frames a second.
pub(crate) fn times_at(frames: &[PathBuf], first: u64, rate: f64) -> Vec<f64> {
    let offset = |frame: &PathBuf| number(frame).map(|number| number.saturating_sub(first));
    let offsets: Option<Vec<u64>> = frames.iter().map(offset).collect();
    let offsets = offsets.unwrap_or_else(|| (0..frames.len() as u64).collect());
    offsets.into_iter().map(|offset| offset as f64 / rate).collect()
}

/// Extensions of videos.
const VIDEOS: [&str; 5] = ["mp4", "mov", "mkv", "webm", "avi"];

/// Returns whether a path is that of a video.
pub(crate) fn is_video(path: &Path) -> bool {
    has_video_extension(path) && path.is_file()
}

/// Returns whether a path ends in the extension of a video.
pub(crate) fn has_video_extension(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    VIDEOS.iter().any(|known| extension.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_sorted_by_their_numbers() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["f10.png", "f9.png", "f2.JPG", "notes.txt", "._f9.png", ".f3.png"] {
            fs::write(folder.path().join(name), b"").expect("the folder can be written to");
        }
        let found = images(folder.path()).expect("the folder can be read");
        let names: Vec<_> = found.iter().filter_map(|path| path.file_name()?.to_str()).collect();
        assert_eq!(names, ["f2.JPG", "f9.png", "f10.png"], "by number, images alone, none that is hidden");
        assert_eq!(times(&found, 2), [0.0, 7.0 / 30.0, 8.0 / 30.0], "the first number is time 0");
        assert_eq!(times_at(&found, 2, 50.0), [0.0, 0.14, 0.16], "another rate");
        let unnumbered = [PathBuf::from("a.png"), PathBuf::from("b.png")];
        for first in [0, 7, u64::MAX] {
            assert_eq!(times(&unnumbered, first), [0.0, 1.0 / 30.0], "frames without numbers follow each other");
        }
        assert_eq!(number(Path::new("99999999999999999999999.png")), None, "a number beyond 64 bits is none");
    }
}
