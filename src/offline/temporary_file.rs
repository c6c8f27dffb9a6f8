//! Temporary files beside those that they will replace.
//!
//! In: a folder. Out: an empty file in it, which is locked for as long as its run lives. Those of runs that were killed are not locked any
//! more, by which they are found and removed.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;
use tempfile::NamedTempFile;

/// What their names begin and end with.
const PREFIX: &str = ".gs4d-";
const SUFFIX: &str = ".part";

/// Creates a temporary file, which is removed when it is dropped unless it has taken the place of another.
///
/// # Errors
/// A folder that cannot be written to.
pub(super) fn create(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    #[cfg(unix)]
    {
        // Permissions as of any new file, by the umask; those of temporary files allow the owner only.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let part = builder.tempfile_in(folder)?;
        match part.as_file().try_lock() {
            // Another run was quicker to lock it, and removes it.
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !part.path().exists() => {}
            // Where files cannot be locked, none are removed either.
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(part),
        }
    }
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

    #[test]
    fn files_of_killed_runs_are_removed_and_no_others() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let live = create(folder.path()).expect("the folder can be written to");
        let names = [".gs4d-killed.part", ".gs4d-other", "other.part", "scene.gs4d"];
        let paths = names.map(|name| folder.path().join(name));
        paths.iter().for_each(|path| fs::write(path, b"some bytes").expect("the folder can be written to"));
        remove_stale(folder.path());
        assert!(live.path().exists(), "one that is being written stays");
        assert!(!paths[0].exists(), "one that nobody writes is removed");
        assert!(paths[1..].iter().all(|path| path.exists()), "files of other names stay");
        let path = live.path().to_owned();
        drop(live);
        assert!(!path.exists(), "it goes with its owner");
    }
}
