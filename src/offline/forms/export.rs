//! Exported files on disk.
//!
//! In: an exporter, times, paths. Out: a file for each time, whole or not at all.

use super::FormError;
use crate::codec::export::exporter::Exporter;
use crate::offline::work::{Progress, proceed, write_beside};
use crate::scene::MAX_SEGMENTS;
use std::io;
use std::path::{Path, PathBuf};

/// A file to export: the Gaussians at one time, or all times.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shown {
    /// The file.
    pub path: PathBuf,
    /// The time that it shows, in the unit of the capture; for all times the first.
    pub time: f32,
}

/// Returns the frames of a capture that plays for `seconds`: the middle of the time for which each is shown. A still
/// has one.
///
/// # Errors
/// More frames than a sequence can have when it is read again.
pub(crate) fn frame_times([first, last]: [f32; 2], seconds: f32, fps: f32) -> Result<Vec<f32>, String> {
    let count = (f64::from(seconds) * f64::from(fps)).round().max(1.0);
    if count > f64::from(MAX_SEGMENTS) {
        return Err(format!(
            "{seconds} seconds at {fps} frames a second are {count} files, and a sequence has at most {MAX_SEGMENTS}"
        ));
    }
    let [first, last] = [first, last].map(f64::from);
    let time = |frame: u32| (first + (last - first) * (f64::from(frame) + 0.5) / count) as f32;
    Ok((0..count as u32).map(time).collect())
}

/// Returns the path of a frame in a folder.
pub(crate) fn frame_path(folder: &Path, frame: usize, extension: &str) -> PathBuf {
    folder.join(format!("frame_{frame:05}.{extension}"))
}

/// Returns a file of the folder that is a frame, but none of these: a player would show it after them. `None` if there
/// is no such file.
pub(crate) fn other_frame(folder: &Path, frames: &[Shown], extension: &str) -> Option<PathBuf> {
    let is_frame = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let number = name.strip_prefix("frame_").and_then(|rest| rest.strip_suffix(extension)?.strip_suffix('.'));
        number.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let mut there = folder.read_dir().ok()?.flatten().map(|entry| entry.path()).filter(is_frame);
    there.find(|path| !frames.iter().any(|frame| frame.path == *path))
}

/// Writes the files in order. Returns the number of Gaussians of each. Begins the task "exporting".
///
/// # Errors
/// A file that cannot be written, an interruption.
pub(crate) fn write_files(
    exporter: &Exporter,
    files: &[Shown],
    progress: &mut dyn Progress,
) -> Result<Vec<usize>, FormError> {
    progress.begin("exporting", files.len());
    let mut counts = Vec::with_capacity(files.len());
    for Shown { path, time } in files {
        proceed(progress)?;
        write_beside(path, |file| {
            counts.push(exporter.write(*time, file)?);
            Ok::<(), io::Error>(())
        })?;
        progress.advance();
    }
    progress.finish();
    Ok(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_show_the_middle_of_their_time() {
        assert_eq!(frame_times([1.0, 3.0], 2.0, 2.0), Ok(vec![1.25, 1.75, 2.25, 2.75]), "four frames in two seconds");
        assert_eq!(frame_times([0.0, 1.0], 0.0, 30.0), Ok(vec![0.5]), "a still has one frame");
        assert!(frame_times([0.0, 1.0], 1e4, 30.0).is_err_and(|reason| reason.contains("65535")), "too many files");
    }

    #[test]
    fn frames_of_a_longer_sequence_are_found() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |frame| frame_path(folder.path(), frame, "ply");
        let frames: Vec<Shown> = (0..2).map(|frame| Shown { path: path(frame), time: 0.0 }).collect();
        for name in ["frame_00000.ply", "frame_00001.ply", "frame_notes.ply", "frame_00002.splat", "cfg_args"] {
            std::fs::write(folder.path().join(name), b"").expect("the folder can be written to");
        }
        assert_eq!(other_frame(folder.path(), &frames, "ply"), None, "its own frames, and files that are none");
        std::fs::write(path(2), b"").expect("the folder can be written to");
        assert_eq!(other_frame(folder.path(), &frames, "ply"), Some(path(2)), "a frame after the last");
    }
}
