//! Temporary files beside the files that they will replace.
//!
//! In: a folder. Out: an empty file in it, which is locked until its run ends. Temporary files of killed runs are not locked, and are
//! removed.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;
use tempfile::NamedTempFile;

/// Prefix and suffix of the names of temporary files.
const PREFIX: &str = ".gs4d-";
const SUFFIX: &str = ".part";

/// Creates a temporary file, which is removed when it is dropped unless it has replaced another file.
///
/// # Errors
/// A folder that cannot be written to.
pub(super) fn create(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    #[cfg(unix)]
    {
        // Permissions of a new file, by the umask; the default of temporary files allows the owner only.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let part = builder.tempfile_in(folder)?;
        match part.as_file().try_lock() {
            // Another run has locked the file first, and removes it.
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !part.path().exists() => {}
            // Where files cannot be locked, none are removed either.
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(part),
        }
    }
}

/// Removes the temporary files of killed runs. Files that cannot be opened are kept.
pub(super) fn remove_stale(folder: &Path) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_killed_runs_are_removed_and_no_others() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let live = create(folder.path()).expect("the folder can be written to");
        let names = [".gs4d-killed.part", ".gs4d-other", "other.part", "scene.gs4d"];
        let paths = names.map(|name| folder.path().join(name));
        paths.iter().for_each(|path| fs::write(path, b"some bytes").expect("the folder can be written to"));
        remove_stale(folder.path());
        assert!(live.path().exists(), "the file of a run that has not ended is kept");
        assert!(!paths[0].exists(), "the file of a killed run is removed");
        assert!(paths[1..].iter().all(|path| path.exists()), "files of other names are kept");
        let path = live.path().to_owned();
        drop(live);
        assert!(!path.exists(), "a temporary file is removed when it is dropped");
    }
}
