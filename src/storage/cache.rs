//! The folder of copies.
//!
//! In: URLs, and the versions of what they lead to. Out: paths in the cache.
//!
//! | path in the cache | content |
//! |---|---|
//! | `objects/HASH/NAME` | an object, by its URL and version |
//! | `sets/HASH/..` | the objects of one input in the places that they have beside each other, links to the above where the disk has links |
//! | `outputs/HASH/..` | what a verb writes, by the URL of the output; the intermediate results of unfinished work stay here |
//!
//! Every file and every set is made under another name and renamed when it is complete. Nothing else depends on the cache: it may be removed
//! whenever no command runs.

use crate::offline::store::WORK_ENDINGS;
use std::env;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The variable that names the folder.
pub(super) const VARIABLE: &str = "GS4D_CACHE";
/// Number of hexadecimal digits of the names of folders.
const DIGITS: usize = 24;
/// The ending of captures that a bake trains from pictures, from which it resumes.
const TRAINED: &str = ".trained.gs4d";

/// The folder of copies.
#[derive(Debug, Clone)]
pub(super) struct Cache(PathBuf);

/// The folder of what a verb writes, locked.
pub(super) struct Staging {
    /// The folder.
    pub folder: PathBuf,
    _lock: File,
}

impl Cache {
    /// Returns the folder that `GS4D_CACHE` names; otherwise, `gs4d` in the user's folder for caches.
    ///
    /// # Errors
    /// No such folder is known.
    pub(super) fn of_user() -> Result<Self, String> {
        let variable = |name: &str| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let of_system = if cfg!(windows) {
            variable("LOCALAPPDATA")
        } else if cfg!(target_os = "macos") {
            variable("HOME").map(|home| home.join("Library/Caches"))
        } else {
            variable("XDG_CACHE_HOME").or_else(|| variable("HOME").map(|home| home.join(".cache")))
        };
        let folder = variable(VARIABLE).or_else(|| of_system.map(|folder| folder.join("gs4d")));
        let folder = folder.and_then(|folder| std::path::absolute(folder).ok());
        folder.map(Self).ok_or_else(|| format!("no folder for copies is known: set {VARIABLE} to one"))
    }

    /// Returns the folder.
    pub(super) fn folder(&self) -> &Path {
        &self.0
    }

    /// Returns the path of an object, in a folder that exists.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub(super) fn object(&self, url: &str, version: &str, name: &str) -> io::Result<PathBuf> {
        let folder = self.0.join("objects").join(hash(&[url, version]));
        fs::create_dir_all(&folder)?;
        Ok(folder.join(name))
    }

    /// Puts files, given with their paths beside each other, together in one folder. Returns the folder.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub(super) fn set(&self, files: &[(String, PathBuf)]) -> io::Result<PathBuf> {
        let names: Vec<_> = files.iter().map(|(relative, file)| format!("{relative}\n{}", file.display())).collect();
        let sets = self.0.join("sets");
        let folder = sets.join(hash(&names.iter().map(String::as_str).collect::<Vec<_>>()));
        if folder.is_dir() {
            return Ok(folder);
        }
        fs::create_dir_all(&sets)?;
        let new = tempfile::Builder::new().prefix(".gs4d-").tempdir_in(&sets)?;
        for (relative, file) in files {
            let path = new.path().join(relative);
            fs::create_dir_all(path.parent().unwrap_or(new.path()))?;
            if fs::hard_link(file, &path).is_err() {
                fs::copy(file, &path)?;
            }
        }
        match fs::rename(new.path(), &folder) {
            // Another run has made the same set at the same time.
            Err(_) if folder.is_dir() => Ok(folder),
            Err(error) => Err(error),
            Ok(()) => Ok(folder),
        }
    }

    /// Returns the folder of what is written for a URL, with nothing in it but what unfinished work resumes from.
    ///
    /// # Errors
    /// The folder cannot be made, or another run uses it.
    pub(super) fn staging(&self, url: &str) -> io::Result<Staging> {
        let folder = self.0.join("outputs").join(hash(&[url]));
        fs::create_dir_all(&folder)?;
        let lock = File::create(folder.with_extension("lock"))?;
        match lock.try_lock() {
            Err(TryLockError::WouldBlock) => {
                return Err(io::Error::new(
                    ErrorKind::ResourceBusy,
                    "another run of gs4d writes to it: wait until it has ended",
                ));
            }
            // Where files cannot be locked, runs are not kept apart.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        for entry in fs::read_dir(&folder)? {
            let entry = entry?;
            if is_work(&entry.file_name().to_string_lossy()) {
                continue;
            }
            match entry.file_type()?.is_dir() {
                true => fs::remove_dir_all(entry.path())?,
                false => fs::remove_file(entry.path())?,
            }
        }
        Ok(Staging { folder, _lock: lock })
    }
}

impl Staging {
    /// Returns the files that a verb has written, by their paths in the folder with `/` between parts, sorted.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub(super) fn files(&self) -> io::Result<Vec<String>> {
        let (mut files, mut folders) = (Vec::new(), vec![String::new()]);
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(self.folder.join(&folder))? {
                let entry = entry?;
                let name = entry.file_name().to_string_lossy().into_owned();
                let path = if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
                let is_folder = entry.file_type()?.is_dir();
                if is_folder && !is_work_folder(&name) {
                    folders.push(path);
                } else if !is_folder && !name.starts_with('.') {
                    files.push(path);
                }
            }
        }
        files.sort();
        Ok(files)
    }
}

/// Returns whether unfinished work resumes from what has this name.
fn is_work(name: &str) -> bool {
    is_work_folder(name) || name.ends_with(TRAINED)
}

fn is_work_folder(name: &str) -> bool {
    WORK_ENDINGS.iter().any(|ending| name.ends_with(ending))
}

/// Returns the name of a folder for texts.
fn hash(texts: &[&str]) -> String {
    let mut hasher = blake3::Hasher::new();
    for text in texts {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    }
    hasher.finalize().to_hex().chars().take(DIGITS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn staging_keeps_only_what_work_resumes_from_and_uploads_only_results() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let cache = Cache(folder.path().to_owned());
        let staging = cache.staging("s3://b/out.gs4d").expect("the folder can be made").folder;
        fs::create_dir_all(staging.join("out.gs4d.bake")).expect("the folder can be written to");
        for name in ["out.gs4d", "out.trained.gs4d", "out.gs4d.bake/score"] {
            fs::write(staging.join(name), "bytes").expect("the folder can be written to");
        }
        let again = cache.staging("s3://b/out.gs4d").expect("nobody else writes to it");
        assert!(!staging.join("out.gs4d").exists(), "an output of an earlier run is removed");
        assert!(staging.join("out.gs4d.bake/score").exists(), "intermediate results are kept");
        fs::create_dir_all(staging.join("frames/a")).expect("the folder can be written to");
        fs::write(staging.join("frames/a/1.png"), "bytes").expect("the folder can be written to");
        let files = again.files().expect("the folder can be read");
        assert_eq!(files, ["frames/a/1.png", "out.trained.gs4d"], "results alone");
        let other = cache.staging("s3://b/out.gs4d").err().map(|error| error.to_string()).unwrap_or_default();
        assert!(other.contains("another run"), "one run at a time: {other:?}");
    }

    #[test]
    fn a_set_has_its_files_beside_each_other() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let cache = Cache(folder.path().to_owned());
        let file = |name: &str, text: &str| {
            let path = cache.object(name, "1", name).expect("the folder can be made");
            fs::write(&path, text).expect("the folder can be written to");
            path
        };
        let files = [("data/a".to_owned(), file("a", "1")), ("data/b/c".to_owned(), file("c", "2"))];
        let set = cache.set(&files).expect("the folder can be made");
        assert_eq!(fs::read_to_string(set.join("data/b/c")).ok().as_deref(), Some("2"), "in its folder");
        assert_eq!(cache.set(&files).ok(), Some(set), "the same files are the same set");
        assert_ne!(cache.set(&files[..1]).ok(), cache.set(&files).ok(), "others are another");
    }
}
