//! Frames of videos, by the program `ffmpeg`, which the crate `ffmpeg-sidecar` starts.
//!
//! In: a dataset, a video in it. Out: its frames as PNG in `DATASET.frames/CAMERA/`, beside the dataset. The folder
//! appears whole: frames are written to a temporary folder, which is then renamed. Existing frames are used and never
//! overwritten. One process at a time decodes, and removes the temporary folders of killed processes.

use super::numbered::{all_entries, entries, images, is_video};
use crate::codec::text::printable;
use crate::offline::dataset::DatasetError;
use crate::offline::work::node::node;
use crate::offline::work::{Progress, proceed};
use ffmpeg_sidecar::command::FfmpegCommand;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use tempfile::TempDir;

/// The treatment of videos whose frames have not been decoded.
pub(crate) enum Videos<'a> {
    /// They are decoded.
    Decode(&'a mut dyn Progress),
    /// Each is the image of one view.
    Leave,
}

/// The program.
pub(crate) const PROGRAM: &str = "ffmpeg";
/// Ending of the name of the folder of decoded frames, after that of the dataset.
const FRAMES: &str = ".frames";
/// Folder of videos in a dataset.
pub(crate) const VIDEOS: &str = "videos";
/// Prefix of the names of temporary folders.
const PREFIX: &str = ".gs4d-";
/// File that is locked while a process decodes, so that all temporary folders are those of killed processes.
const LOCK: &str = ".lock";
/// Most bytes that are kept of the messages of the program.
const MOST_KEPT: usize = 2048;
/// Most characters of the messages that an error shows.
const MOST_SHOWN: usize = 240;

/// Returns the frames of a video, which are decoded if they are not there.
pub(crate) fn frames(
    folder: &Path,
    video: &Path,
    camera: &str,
    progress: &mut dyn Progress,
) -> Result<Vec<PathBuf>, DatasetError> {
    match decoded(folder, camera)? {
        Some(frames) => Ok(frames),
        None => Video { path: video, folder, camera, cache: &cache(folder)? }.decode(OsStr::new(PROGRAM), progress),
    }
}

/// Returns the frames of a video that have been decoded.
pub(crate) fn decoded(folder: &Path, camera: &str) -> Result<Option<Vec<PathBuf>>, DatasetError> {
    let found = images(&cache(folder)?.join(camera))?;
    Ok((!found.is_empty()).then_some(found))
}

/// Returns the folder of all decoded frames of a dataset if a path is that of a frame in it, and the dataset has the
/// video of its camera.
pub(crate) fn decoded_into(frame: &Path) -> Option<&Path> {
    let camera = frame.parent()?;
    let cache = camera.parent()?;
    let dataset = cache.with_file_name(cache.file_name()?.to_str()?.strip_suffix(FRAMES)?);
    let is_video = |path: &PathBuf| path.file_stem() == camera.file_name() && is_video(path);
    let inside = [dataset.clone(), dataset.join(VIDEOS)].map(|folder| entries(&folder).unwrap_or_default());
    inside.iter().flatten().any(is_video).then_some(cache)
}

/// Returns the folder of all decoded frames: `DATASET.frames`.
fn cache(folder: &Path) -> Result<PathBuf, DatasetError> {
    let failed = |reason| DatasetError::Read { path: folder.to_owned(), reason };
    let mut path = folder.canonicalize().map_err(failed)?.into_os_string();
    path.push(FRAMES);
    Ok(path.into())
}

/// The file that is locked while a process decodes. It is removed at the end, by the process that holds it.
struct Lock {
    file: File,
    path: PathBuf,
    /// Whether no other process decodes: false where files cannot be locked.
    is_held: bool,
}

impl Lock {
    /// Waits until no other process decodes.
    fn of(cache: &Path) -> io::Result<Self> {
        let path = cache.join(LOCK);
        loop {
            let file = File::create(&path)?;
            let is_held = file.lock().is_ok();
            let lock = Self { file, path: path.clone(), is_held };
            // The process before may have removed the file that this one waited for; another may have made a new one.
            if !is_held || lock.is_at_its_path() {
                return Ok(lock);
            }
        }
    }

    /// Returns whether the file is the one at the path; true on systems where files have no numbers.
    fn is_at_its_path(&self) -> bool {
        let [own, there] =
            [self.file.metadata(), self.path.metadata()].map(|metadata| metadata.ok().as_ref().map(node));
        own == there
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Where files have no numbers, a process that waits for this file could not tell that it is removed.
        let has_number = self.file.metadata().ok().as_ref().and_then(node).is_some();
        if !self.is_held || has_number && self.is_at_its_path() {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// A video of a dataset.
struct Video<'a> {
    path: &'a Path,
    /// The folder of the dataset.
    folder: &'a Path,
    /// Name of the camera.
    camera: &'a str,
    /// The folder of all decoded frames.
    cache: &'a Path,
}

impl Video<'_> {
    /// Decodes the frames, unless another process has decoded them in the meantime. Returns their paths.
    fn decode(&self, program: &OsStr, progress: &mut dyn Progress) -> Result<Vec<PathBuf>, DatasetError> {
        let unwritable = |error: io::Error| self.unwritable(&error);
        fs::create_dir_all(self.cache).map_err(unwritable)?;
        let lock = Lock::of(self.cache).map_err(unwritable)?;
        // Where files cannot be locked, no temporary folder is known to be stale.
        if lock.is_held {
            remove_stale(self.cache)?;
        }
        proceed(progress)?;
        let place = self.cache.join(self.camera);
        let found = images(&place)?;
        if !found.is_empty() {
            return Ok(found);
        }
        let temporary = temporary_folder(self.cache).map_err(unwritable)?;
        let command = self.command(program, temporary.path())?;
        progress.note(&format!("decoding {} to {}, once", self.path.display(), place.display()));
        let (status, messages) = self.run(command)?;
        proceed(progress)?;
        let count = images(temporary.path())?.len();
        self.check(status, count, &messages)?;
        if !messages.is_empty() {
            let video = self.path.display();
            progress.note(&format!("note: {video}: ffmpeg found {count} frames, and errors: {messages}"));
        }
        fs::rename(temporary.path(), &place).map_err(unwritable)?;
        images(&place)
    }

    /// Returns the command that writes the frames to a folder.
    fn command(&self, program: &OsStr, folder: &Path) -> Result<FfmpegCommand, DatasetError> {
        let path = std::path::absolute(self.path);
        // The protocol is named, since a path may contain a colon.
        let mut input = OsStr::new("file:").to_owned();
        input.push(path.map_err(|reason| DatasetError::Read { path: self.path.to_owned(), reason })?);
        let mut command = FfmpegCommand::new_with_path(program);
        command
            .args(["-hide_banner", "-nostdin", "-v", "error"])
            .input(input)
            .args(["-start_number", "0"])
            .output("%05d.png");
        // The program runs inside the folder, whose path may contain a percent sign.
        command.as_inner_mut().current_dir(folder);
        Ok(command)
    }

    /// Runs the program to its end. Returns its exit status and its last messages.
    fn run(&self, mut command: FfmpegCommand) -> Result<(ExitStatus, String), DatasetError> {
        let mut child = command.spawn().map_err(|error| match error.kind() {
            ErrorKind::NotFound => self.unusable(format!(
                "videos are read by ffmpeg, which is not installed: apt install ffmpeg (Linux), brew install ffmpeg \
                 (macOS) or winget install ffmpeg (Windows); or, on another machine, {}",
                self.by_hand()
            )),
            _ => self.unusable(format!("ffmpeg cannot be started: {error}; {}", self.by_hand())),
        })?;
        drop(child.take_stdin());
        drop(child.take_stdout());
        let messages = child.take_stderr().map_or(String::new(), last_lines);
        let status = child.wait().map_err(|error| self.unwritable(&error))?;
        Ok((status, messages))
    }

    /// Checks how the program ended, and the number of frames that it has written.
    fn check(&self, status: ExitStatus, count: usize, messages: &str) -> Result<(), DatasetError> {
        if status.code().is_none() {
            return Err(self.unusable("ffmpeg was ended by a signal: run the command again".to_owned()));
        }
        let reason = match (status.success(), messages) {
            (true, _) if count > 0 => return Ok(()),
            (true, "") => "it finds no picture in it".to_owned(),
            (false, "") => format!("it ends without a word, {status}"),
            (_, messages) => messages.to_owned(),
        };
        Err(self.unusable(format!("ffmpeg cannot read it ({reason}): copy it again, or {}", self.by_hand())))
    }

    fn unusable(&self, reason: String) -> DatasetError {
        DatasetError::Unusable { path: self.path.to_owned(), reason }
    }

    fn unwritable(&self, error: &io::Error) -> DatasetError {
        let (cache, by_hand) = (self.cache.display(), self.by_hand());
        self.unusable(format!("its frames cannot be written to {cache}: {error}; {by_hand}"))
    }

    /// Returns a sentence with the command that makes the frames by hand.
    fn by_hand(&self) -> String {
        let (folder, video, camera) = (self.folder.display(), self.path.display(), self.camera);
        let frames = format!("{folder}/frames/{camera}");
        format!(
            "make the frames by hand: mkdir -p \"{frames}\" && ffmpeg -i \"{video}\" -start_number 0 \
             \"{frames}/%05d.png\""
        )
    }
}

/// Removes the temporary folders of killed processes. A folder that cannot be removed is left: a program whose parent
/// was killed may still write to it.
fn remove_stale(cache: &Path) -> Result<(), DatasetError> {
    let is_temporary =
        |path: &PathBuf| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(PREFIX.as_bytes()));
    for path in all_entries(cache)?.into_iter().filter(is_temporary) {
        let _ = fs::remove_dir_all(path);
    }
    Ok(())
}

/// Creates a temporary folder for the frames of a video.
fn temporary_folder(cache: &Path) -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX);
    #[cfg(unix)]
    {
        // Permissions of a new folder, by the umask; the default of temporary folders allows the owner only.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o777));
    }
    builder.tempdir_in(cache)
}

/// Reads all messages of the program. Returns the last of them, in one line.
pub(crate) fn last_lines(mut messages: impl Read) -> String {
    let (mut kept, mut more) = (Vec::new(), [0; 4096]);
    while let Ok(count @ 1..) = messages.read(&mut more) {
        kept.extend_from_slice(&more[..count]);
        kept.drain(..kept.len().saturating_sub(MOST_KEPT));
    }
    let line = String::from_utf8_lossy(&kept).trim().lines().collect::<Vec<_>>().join("; ");
    let skipped = line.chars().count().saturating_sub(MOST_SHOWN);
    printable(&line.chars().skip(skipped).collect::<String>())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
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
        let cache = folder.join("data.frames");
        let video = Video { path: &data.join("cam00.mp4"), folder: &data, camera: "cam00", cache: &cache };
        video.decode(program.as_os_str(), &mut NoProgress)
    }

    /// Returns all names in the folder of frames.
    fn names(folder: &Path) -> Vec<String> {
        let paths = all_entries(&folder.join("data.frames")).expect("the folder can be read");
        paths.iter().filter_map(|path| path.file_name()?.to_str()).map(str::to_owned).collect()
    }

    /// Writes two frames with the names of the last argument.
    const FRAMES: &str = "for last; do :; done; echo a > $(printf $last 0); echo b > $(printf $last 1)";

    #[test]
    fn frames_appear_whole_beside_the_dataset() {
        let temporary = tempfile::tempdir().expect("a temporary folder");
        // For ffmpeg, %d in a path would be the number of the frame.
        let folder = temporary.path().join("100%d");
        let killed = folder.join("data.frames/.gs4d-killed");
        fs::create_dir_all(&killed).expect("the folder can be made");
        fs::write(killed.join("00000.png"), b"").expect("the folder can be written to");
        let found = decoded_by(&program(&folder, FRAMES), &folder).expect("the program writes frames");
        let expected = ["00000.png", "00001.png"].map(|name| folder.join("data.frames/cam00").join(name));
        assert_eq!(found, expected, "the frames lie beside the dataset");
        assert_eq!(
            names(&folder),
            ["cam00"],
            "no temporary folder is left, of this run or of a killed run, and no locked file"
        );
        let mode = |path: &Path| fs::metadata(path).expect("the folder exists").permissions().mode();
        assert_eq!(
            mode(&folder.join("data.frames/cam00")),
            mode(&folder.join("data.frames")),
            "others may read the frames, by the umask"
        );
        let again = decoded_by(&folder.join("nothing"), &folder).expect("no program is needed");
        assert_eq!(again, expected, "existing frames are used");
    }

    #[test]
    fn concurrent_runs_decode_a_video_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let count = folder.path().join("count");
        let script = format!("echo run >> {}; sleep 0.2; {FRAMES}", count.display());
        let program = program(folder.path(), &script);
        let counts = std::thread::scope(|scope| {
            let run = || decoded_by(&program, folder.path()).expect("the program writes frames").len();
            [scope.spawn(run), scope.spawn(run)].map(|thread| thread.join().expect("no panic"))
        });
        assert_eq!(counts, [2, 2], "both runs have the frames");
        assert_eq!(
            fs::read_to_string(&count).expect("the program has run"),
            "run\n",
            "the second run waits for the first"
        );
    }

    #[test]
    fn a_missing_program_is_an_error_with_both_remedies() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = decoded_by(&folder.path().join("nothing"), folder.path()).expect_err("no program").to_string();
        for part in ["cam00.mp4", "apt install ffmpeg", "data/frames/cam00/%05d.png\""] {
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }

    #[test]
    fn many_messages_are_read_to_their_end() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let script = format!("i=0; while [ $i -lt 30000 ]; do echo error $i >&2; i=$((i+1)); done; {FRAMES}");
        let found = decoded_by(&program(folder.path(), &script), folder.path()).expect("the program writes frames");
        assert_eq!(found.len(), 2, "errors do not matter if there are frames");
        let kept = last_lines(&b"first\n".iter().copied().cycle().take(9000).chain(*b"last\n").collect::<Vec<_>>()[..]);
        assert!(kept.len() < 300 && kept.ends_with("; last"), "one line of bounded length: {kept}");
    }

    #[test]
    fn a_video_is_not_blamed_for_a_signal_that_ends_the_program() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = decoded_by(&program(folder.path(), "kill -9 $$"), folder.path()).expect_err("killed").to_string();
        assert!(error.contains("ended by a signal") && !error.contains("copy it again"), "{error}");
    }

    #[test]
    fn a_video_that_cannot_be_read_leaves_no_frames() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let script = "echo a > 00000.png; echo broken >&2; echo twice >&2; exit 1";
        let error = decoded_by(&program(folder.path(), script), folder.path()).expect_err("it fails").to_string();
        assert!(error.contains("(broken; twice)"), "the lines of the program are shown: {error}");
        assert_eq!(names(folder.path()), [""; 0], "the frames of a run that fails are removed");
    }

    #[test]
    fn a_program_that_fails_without_a_message_has_a_reason() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (script, reason) in [("exit 3", "ends without a word, exit status: 3"), ("exit 0", "finds no picture")] {
            let error = decoded_by(&program(folder.path(), script), folder.path()).expect_err(script).to_string();
            assert!(error.contains(reason), "{script}, {reason}: {error}");
        }
    }

    #[test]
    fn decoded_frames_are_those_beside_a_dataset_with_their_video() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let cache = folder.path().join("data.frames");
        fs::create_dir(folder.path().join("data")).expect("the folder can be made");
        assert_eq!(decoded_into(&cache.join("cam00/00000.png")), None, "a folder of somebody else");
        fs::write(folder.path().join("data/cam00.mp4"), b"").expect("the folder can be written to");
        assert_eq!(decoded_into(&cache.join("cam00/00000.png")), Some(&*cache), "a frame of the video");
        assert_eq!(decoded_into(&cache.join("cam01/00000.png")), None, "no video of this camera");
        fs::create_dir(folder.path().join("data/videos")).expect("the folder can be made");
        fs::write(folder.path().join("data/videos/cam01.mov"), b"").expect("the folder can be written to");
        assert_eq!(decoded_into(&cache.join("cam01/00000.png")), Some(&*cache), "a frame of a video in videos/");
        assert_eq!(decoded_into(&folder.path().join("data/cam00/00000.png")), None, "a frame of the dataset");
    }
}
