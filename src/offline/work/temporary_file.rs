//! Temporary files beside the files that they will replace.
//!
//! In: a folder. Out: an empty file in it, which is locked until its run ends, and which replaces an output when it is
//! complete. Temporary files of killed runs are not locked, and are removed.

use super::unfinished;
use crate::codec::CodecError;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Prefix and suffix of the names of temporary files.
const PREFIX: &str = ".gs4d-";
const SUFFIX: &str = ".part";

/// A temporary file. It is removed when it is dropped, and when the process ends, unless it has replaced its output.
pub(crate) struct Part {
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
pub(crate) fn create(target: PathBuf) -> io::Result<Part> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    #[cfg(unix)]
    {
        // Permissions of a new file, by the umask; the default of temporary files allows the owner only.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let mut unfinished = unfinished::lock();
        let part = builder.tempfile_in(folder_of(&target))?;
        match part.as_file().try_lock() {
            // Another run has locked the file first, and removes it.
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

/// Replaces outputs by complete files; each is given with the path of its output as the user has named it. Outputs
/// after the first belong to the first: they are removed before the first is replaced, so that they are never beside
/// another first output than their own, even if the process is killed. They are listed if the work is interrupted.
///
/// # Errors
/// The first output that cannot be replaced, by name.
pub(crate) fn replace(mut parts: Vec<(Part, PathBuf)>) -> Result<(), CodecError> {
    // Unlocked before the parts are dropped.
    let mut unfinished = unfinished::lock();
    let at = |path: &Path, error: io::Error| CodecError::at(path, error);
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

/// Removes the temporary files of killed runs. Files that cannot be opened are kept.
pub(crate) fn remove_stale(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for path in entries.flatten().map(|entry| entry.path()).filter(|path| is_part(path)) {
        // The lock is held until the file is removed, so that no other run begins to write to it.
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

/// Returns the folder of a file: the current folder for a bare name.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
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
        assert!(path.exists(), "the file of a run that has not ended is kept");
        assert!(!paths[0].exists(), "the file of a killed run is removed");
        assert!(paths[1..].iter().all(|path| path.exists()), "files of other names are kept");
        drop(live);
        assert!(!path.exists(), "a temporary file is removed when it is dropped");
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
