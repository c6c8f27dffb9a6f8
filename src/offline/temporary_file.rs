//! Temporary files beside those that they will replace.
//!
//! In: a folder. Out: an empty file in it, which is locked for as long as its run lives, and which replaces an output once it is complete.
//! Those of runs that were killed are not locked any more, by which they are found and removed.

use super::save::folder_of;
use super::unfinished;
use crate::codec::CodecError;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// What their names begin and end with.
const PREFIX: &str = ".gs4d-";
const SUFFIX: &str = ".part";

/// A temporary file. It is removed when it is dropped, and when the process leaves, unless it has replaced its output.
pub(super) struct Part {
    /// The open file.
    pub file: File,
    path: PathBuf,
    target: PathBuf,
    has_replaced: bool,
}

impl Drop for Part {
    fn drop(&mut self) {
        if !self.has_replaced {
            let mut unfinished = unfinished::lock();
            unfinished.take_file(&self.path);
            // A file that is left is removed by the next run.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Creates a temporary file that is to replace `target`, in the same folder.
///
/// # Errors
/// A folder that cannot be written to.
pub(super) fn create(target: PathBuf) -> io::Result<Part> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    #[cfg(unix)]
    {
        // Permissions as of any new file, by the umask; those of temporary files allow the owner only.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let mut unfinished = unfinished::lock();
        let part = builder.tempfile_in(folder_of(&target))?;
        match part.as_file().try_lock() {
            // Another run was quicker to lock it, and removes it.
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !part.path().exists() => {}
            // Where files cannot be locked, none are removed either.
            Ok(()) | Err(TryLockError::Error(_)) => {
                let (file, path) = part.keep().map_err(|failed| failed.error)?;
                unfinished.add_file(&path);
                return Ok(Part { file, path, target, has_replaced: false });
            }
        }
    }
}

/// Replaces outputs by complete files; each is given with the path that the user knows its output by. Outputs after the first belong to it: they
/// are removed before it is replaced, so that they are never beside another first output than their own, wherever the process is killed.
///
/// # Errors
/// The first output that cannot be replaced, by name.
pub(super) fn replace(mut parts: Vec<(Part, PathBuf)>) -> Result<(), CodecError> {
    // Unlocked before the parts are dropped.
    let mut unfinished = unfinished::lock();
    let at = |path: &Path, error: io::Error| CodecError { path: path.to_owned(), kind: error.into() };
    for (part, path) in parts.iter().skip(1) {
        match fs::remove_file(&part.target) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(at(path, error)),
            _ => {}
        }
    }
    for (part, path) in &mut parts {
        fs::rename(&part.path, &part.target).map_err(|error| at(path, error))?;
        part.has_replaced = true;
        unfinished.take_file(&part.path);
        unfinished.add_output(path);
    }
    Ok(())
}

/// Removes the temporary files of runs that were killed. What cannot be looked at stays.
pub(super) fn remove_stale(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for path in entries.flatten().map(|entry| entry.path()).filter(|path| is_part(path)) {
        // The lock is held until the file is gone, so that nobody begins to write to it.
        if let Ok(file) = File::options().write(true).open(&path)
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(&path);
        }
    }
}

fn is_part(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    let named = name.starts_with(PREFIX.as_bytes()) && name.ends_with(SUFFIX.as_bytes());
    named && path.symlink_metadata().is_ok_and(|metadata| metadata.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn files_of_killed_runs_are_removed_and_no_others() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let live = create(folder.path().join("live.gs4d")).expect("the folder can be written to");
        let names = [".gs4d-killed.part", ".gs4d-other", "other.part", "scene.gs4d"];
        let paths = names.map(|name| folder.path().join(name));
        paths.iter().for_each(|path| fs::write(path, b"some bytes").expect("the folder can be written to"));
        remove_stale(folder.path());
        let path = live.path.clone();
        assert!(path.exists(), "one that is being written stays");
        assert!(!paths[0].exists(), "one that nobody writes is removed");
        assert!(paths[1..].iter().all(|path| path.exists()), "files of other names stay");
        drop(live);
        assert!(!path.exists(), "it goes with its owner");
    }

    #[test]
    fn outputs_that_belong_together_are_replaced_together() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [package, report, other] = ["out.gs4d", "out.json", "out.html"].map(|name| folder.path().join(name));
        let parts = |text: &str| {
            let part = |path: &PathBuf| {
                let mut part = create(path.clone()).expect("the folder can be written to");
                part.file.write_all(text.as_bytes()).expect("the file can be written to");
                (part, path.clone())
            };
            [&package, &report, &other].map(part).into()
        };
        let texts = || [&package, &report, &other].map(|path| fs::read_to_string(path).ok());
        replace(parts("first")).expect("nothing is in the way");
        assert_eq!(
            texts(),
            [Some("first".to_owned()), Some("first".to_owned()), Some("first".to_owned())],
            "all are new"
        );
        fs::remove_file(&other).expect("the file exists");
        fs::create_dir(&other).expect("the folder can be written to");
        let error = replace(parts("second")).expect_err("a folder is in the way").to_string();
        assert!(error.contains("out.html"), "the error names the output: {error}");
        assert_eq!(texts(), [Some("first".to_owned()), None, None], "the old package is beside no report");
        assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 2, "no temporary file is left");
    }
}
