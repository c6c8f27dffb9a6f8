//! Frames of videos, by the program `ffmpeg`.
//!
//! In: a dataset, a video in it. Out: its frames as PNG in `DATASET.frames/CAMERA/`, beside the dataset. The folder appears whole: frames are written
//! to a temporary folder, which is then renamed. Frames that are there are used and never overwritten.

use super::DatasetError;
use super::numbered::images;
use std::ffi::OsStr;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The program.
const PROGRAM: &str = "ffmpeg";
/// Most characters of the program's message in an error.
const MESSAGE: usize = 400;

/// Returns the frames of a video, which are decoded if they are not there.
pub(super) fn frames(folder: &Path, video: &Path, camera: &str) -> Result<Vec<PathBuf>, DatasetError> {
    match decoded(folder, camera)? {
        Some(frames) => Ok(frames),
        None => decode(OsStr::new(PROGRAM), video, &cache(folder)?, camera, folder),
    }
}

/// Returns the frames of a video that have been decoded.
pub(super) fn decoded(folder: &Path, camera: &str) -> Result<Option<Vec<PathBuf>>, DatasetError> {
    let found = images(&cache(folder)?.join(camera))?;
    Ok((!found.is_empty()).then_some(found))
}

/// Returns the folder of all decoded frames: `DATASET.frames`.
fn cache(folder: &Path) -> Result<PathBuf, DatasetError> {
    let failed = |reason| DatasetError::Read { path: folder.to_owned(), reason };
    let mut path = folder.canonicalize().map_err(failed)?.into_os_string();
    path.push(".frames");
    Ok(path.into())
}

fn decode(
    program: &OsStr,
    video: &Path,
    cache: &Path,
    camera: &str,
    folder: &Path,
) -> Result<Vec<PathBuf>, DatasetError> {
    let unusable = |reason: String| DatasetError::Unusable { path: video.to_owned(), reason };
    let unwritable = |error: std::io::Error| {
        let reason =
            format!("its frames cannot be written to {}: {error}; {}", cache.display(), by_hand(folder, camera));
        unusable(reason)
    };
    fs::create_dir_all(cache).map_err(unwritable)?;
    let temporary = tempfile::tempdir_in(cache).map_err(unwritable)?;
    // The protocol is named, since a path may contain a colon.
    let mut input = OsStr::new("file:").to_owned();
    input.push(video);
    let mut command = Command::new(program);
    command.args(["-nostdin", "-v", "error", "-i"]).arg(input);
    command.args(["-start_number", "0"]).arg(temporary.path().join("%05d.png"));
    let run = command.stdin(Stdio::null()).stdout(Stdio::null()).output().map_err(|error| match error.kind() {
        ErrorKind::NotFound => unusable(format!(
            "videos are read by ffmpeg, which is not installed: apt install ffmpeg (Linux), brew install ffmpeg (macOS) or winget install \
             ffmpeg (Windows); or, on another machine, {}",
            by_hand(folder, camera)
        )),
        _ => unusable(format!("ffmpeg cannot be started: {error}; {}", by_hand(folder, camera))),
    })?;
    let found = images(temporary.path())?;
    if !run.status.success() || found.is_empty() {
        let message = String::from_utf8_lossy(&run.stderr);
        let message: String = message.trim().chars().take(MESSAGE).collect();
        let message = crate::codec::text::printable(&message);
        return Err(unusable(format!(
            "ffmpeg cannot read it ({message}): copy it again, or {}",
            by_hand(folder, camera)
        )));
    }
    let place = cache.join(camera);
    fs::rename(temporary.path(), &place).map_err(unwritable)?;
    images(&place)
}

/// Returns the line that makes the frames by hand.
fn by_hand(folder: &Path, camera: &str) -> String {
    let shown = folder.display();
    format!(
        "make the frames by hand: mkdir -p {shown}/frames/{camera} && ffmpeg -i {shown}/{camera}.mp4 -start_number 0 \
         {shown}/frames/{camera}/%05d.png"
    )
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// Writes a program that takes the place of ffmpeg.
    fn program(folder: &Path, script: &str) -> PathBuf {
        let path = folder.join("program");
        fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("the folder can be written to");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("the program can be made executable");
        path
    }

    fn decoded_by(program: &Path, folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
        let data = folder.join("data");
        decode(program.as_os_str(), &data.join("cam00.mp4"), &folder.join("data.frames"), "cam00", &data)
    }

    #[test]
    fn frames_appear_whole_beside_the_dataset() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let script = "for last; do :; done; d=$(dirname \"$last\"); echo a > $d/00000.png; echo b > $d/00001.png";
        let found = decoded_by(&program(folder.path(), script), folder.path()).expect("the program writes frames");
        let expected = ["00000.png", "00001.png"].map(|name| folder.path().join("data.frames/cam00").join(name));
        assert_eq!(found, expected, "the frames lie beside the dataset");
        let left = fs::read_dir(folder.path().join("data.frames")).expect("the folder is there").count();
        assert_eq!(left, 1, "no temporary folder is left");
    }

    #[test]
    fn a_missing_program_is_an_error_with_both_remedies() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = decoded_by(&folder.path().join("nothing"), folder.path()).expect_err("no program").to_string();
        for part in ["cam00.mp4", "apt install ffmpeg", "frames/cam00/%05d.png"] {
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }

    #[test]
    fn a_video_that_cannot_be_read_leaves_no_frames() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let script = "for last; do :; done; echo a > $(dirname \"$last\")/00000.png; echo broken >&2; exit 1";
        let error = decoded_by(&program(folder.path(), script), folder.path()).expect_err("it fails").to_string();
        assert!(error.contains("broken"), "the message of the program is shown: {error}");
        let left = fs::read_dir(folder.path().join("data.frames")).expect("the folder is there").count();
        assert_eq!(left, 0, "the frames of a run that fails are removed");
    }
}
