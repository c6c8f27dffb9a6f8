//! The folder of the dataset that footage becomes.
//!
//! In: the folder, and that of the footage. Out: a folder that holds nothing but results of this footage; folders in it
//! that appear whole or not at all; lists of their files, by which a later run knows that they are still there.

use crate::codec::text::printable;
use crate::offline::footage::FootageError;
use crate::offline::store::outputs::Files;
use crate::offline::work::save::resolved;
use crate::offline::work::{FileError, temporary_file, write_beside};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The file that tells a result from a folder of somebody else.
const MARK: &str = "footage.json";
/// Prefix of the names of temporary folders.
const PREFIX: &str = ".gs4d-";

/// The contents of the mark.
#[derive(Deserialize)]
struct Mark {
    /// The folder of the footage.
    footage: PathBuf,
}

/// The path of a file below a folder, with `/`, and its number of bytes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct Listed(String, u64);

/// Makes the folder of the dataset if it does not exist, and marks it as the result of this footage.
///
/// # Errors
/// A folder that cannot be written to, or that has other files than those of the dataset of this footage.
pub(super) fn claim(out: &Path, folder: &Path) -> Result<(), FootageError> {
    let (place, source) = (resolved(out), resolved(folder));
    if place.starts_with(&source) || source.starts_with(&place) {
        return Err(FootageError::Nested { out: out.to_owned(), folder: folder.to_owned() });
    }
    Files::default().writes_folder(out, []).check()?;
    let at = |error| FileError::at(out, error);
    fs::create_dir_all(out).map_err(at)?;
    let mark = out.join(MARK);
    match fs::read(&mark).ok().and_then(|bytes| serde_json::from_slice::<Mark>(&bytes).ok()) {
        Some(Mark { footage }) if footage == source => {}
        Some(Mark { footage }) => {
            let other = PathBuf::from(printable(&footage.to_string_lossy()));
            return Err(FootageError::OtherFootage { out: out.to_owned(), other });
        }
        None => {
            temporary_file::remove_stale(out);
            if fs::read_dir(out).map_err(at)?.next().is_some() {
                return Err(FootageError::Foreign { out: out.to_owned() });
            }
            let text = format!("{:#}\n", json!({ "footage": source }));
            write_beside(&mark, |file| file.write_all(text.as_bytes()))?;
        }
    }
    Ok(())
}

/// Removes the temporary files and folders of killed runs. No other run may work in the folder.
///
/// # Errors
/// A folder that cannot be removed.
pub(super) fn remove_unfinished(out: &Path) -> Result<(), FootageError> {
    temporary_file::remove_stale(out);
    let entries = fs::read_dir(out).map_err(|error| FileError::at(out, error))?;
    for path in entries.flatten().map(|entry| entry.path()) {
        let is_temporary = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(PREFIX.as_bytes()));
        if is_temporary && path.is_dir() {
            fs::remove_dir_all(&path).map_err(|error| FileError::at(&path, error))?;
        }
    }
    Ok(())
}

/// A folder of results that is being written. Unless it is finished, it is removed when it is dropped.
pub(super) struct Unfinished {
    temporary: TempDir,
    place: PathBuf,
}

impl Unfinished {
    /// Begins a folder of this name in the folder of the dataset.
    ///
    /// # Errors
    /// A folder that cannot be written to.
    pub(super) fn begin(out: &Path, name: &str) -> Result<Self, FootageError> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX);
        #[cfg(unix)]
        {
            // Permissions of a new folder, by the umask; the default of temporary folders allows the owner only.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o777));
        }
        let temporary = builder.tempdir_in(out).map_err(|error| FileError::at(out, error))?;
        Ok(Self { temporary, place: out.join(name) })
    }

    /// Returns the path of a file in the folder of one camera, which is made.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub(super) fn path(&self, camera: &str, file: &str) -> Result<PathBuf, FootageError> {
        let folder = self.temporary.path().join(camera);
        fs::create_dir_all(&folder).map_err(|error| FileError::at(&self.place, error))?;
        Ok(folder.join(file))
    }

    /// Puts the folder into the place of that of an earlier run. Returns its files.
    ///
    /// # Errors
    /// An earlier folder that cannot be removed.
    pub(super) fn finish(self) -> Result<Vec<Listed>, FootageError> {
        let at = |error| FileError::at(&self.place, error);
        if self.place.symlink_metadata().is_ok() {
            fs::remove_dir_all(&self.place).map_err(at)?;
        }
        fs::rename(self.temporary.path(), &self.place).map_err(at)?;
        Ok(listed(&self.place))
    }
}

/// Returns the files below a folder, sorted; none if it cannot be read.
pub(super) fn listed(folder: &Path) -> Vec<Listed> {
    let mut files = Vec::new();
    collect(folder, "", &mut files);
    files.sort();
    files
}

fn collect(folder: &Path, before: &str, files: &mut Vec<Listed>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), format!("{before}{}", entry.file_name().to_string_lossy()));
        match entry.metadata() {
            Ok(metadata) if metadata.is_dir() => collect(&path, &format!("{name}/"), files),
            Ok(metadata) => files.push(Listed(name, metadata.len())),
            Err(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_claimed_for_one_footage() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [footage, other, out] = ["footage", "other", "out"].map(|name| folder.path().join(name));
        [&footage, &other].iter().for_each(|folder| fs::create_dir(folder).expect("the folder can be made"));
        claim(&out, &footage).expect("a new folder");
        claim(&out, &footage).expect("the result of the same footage");
        fs::create_dir(out.join(".gs4d-killed")).expect("the folder can be made");
        remove_unfinished(&out).expect("the folder can be removed");
        assert!(!out.join(".gs4d-killed").exists(), "what a killed run left is removed");
        let message = claim(&out, &other).expect_err("another footage").to_string();
        assert!(message.contains("out") && message.contains("footage"), "both are named: {message}");
        fs::remove_file(out.join(MARK)).expect("the mark is there");
        fs::write(out.join("letter.txt"), b"dear").expect("the folder can be written to");
        let message = claim(&out, &footage).expect_err("files of somebody else").to_string();
        assert!(message.contains("name a new folder"), "the remedy: {message}");
        assert!(!out.join(MARK).exists(), "nothing is written to it");
        for nested in [footage.join("dataset"), folder.path().to_owned()] {
            assert!(matches!(claim(&nested, &footage), Err(FootageError::Nested { .. })), "{}", nested.display());
        }
    }

    #[test]
    fn a_folder_of_results_appears_whole() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str| {
            let unfinished = Unfinished::begin(folder.path(), "plates").expect("the folder can be written to");
            let path = unfinished.path("left", name).expect("the folder can be made");
            fs::write(path, b"bytes").expect("the folder can be written to");
            unfinished
        };
        drop(write("1.png"));
        assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0, "unfinished work leaves nothing");
        write("1.png").finish().expect("nothing is in the way");
        let files = write("2.png").finish().expect("the folder of the earlier run is replaced");
        assert_eq!(files, [Listed("left/2.png".to_owned(), 5)], "the new file alone");
        assert_eq!(listed(&folder.path().join("plates")), files, "found again");
    }
}
