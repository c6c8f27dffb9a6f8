//! The folder of intermediate results, from which interrupted work resumes.
//!
//! In: a [`Key`] of everything that a result depends on, and the result as bytes. Out: the same bytes; `None`, so that
//! the stage runs again, if the key is another or the bytes are damaged. One run at a time works in a folder, or any
//! number of runs of single stages, of which one at a time works on a stage.

use super::StoreError;
use crate::codec::{CodecError, files_of};
use crate::offline::dataset::{Correction, TrainingView};
use crate::offline::work::node::node;
use crate::offline::work::{FileError, Progress, proceed, temporary_file, unfinished, write_beside};
use rayon::prelude::*;
use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// The ending of the folder of intermediate results of a bake, after the name of the package.
pub(crate) const BAKE_FOLDER: &str = ".bake";
/// The endings of all folders of intermediate results: those of a bake and of fine-tuning.
pub(crate) const WORK_ENDINGS: [&str; 2] = [BAKE_FOLDER, ".tune"];

/// The extension of the folder of chunk files that a bake writes beside its package.
pub(crate) const CHUNKS: &str = "stream";

/// Returns the path of the folder of intermediate results beside an output.
pub(crate) fn folder_beside(out: &Path, ending: &str) -> PathBuf {
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(ending);
    out.with_file_name(name)
}

/// First bytes of every stored result.
const MAGIC: [u8; 4] = *b"GS4W";
/// Version of the stored results: other versions count as absent.
const VERSION: u32 = 2;
/// Bytes of a hash.
const HASH: usize = 32;
/// Bytes of the header: magic, version, key, hash of the body.
const HEAD: usize = 8 + 2 * HASH;

/// Name of the file that is locked while a run works in the folder.
const LOCK: &str = "lock";
/// Most attempts to lock it while runs that end remove it.
const ATTEMPTS: usize = 100;
/// Time between two attempts to lock it beside other runs.
const PAUSE: Duration = Duration::from_millis(2);
/// Time between two checks whether another run still works on a stage.
const WAIT: Duration = Duration::from_millis(20);
/// Images that are hashed between two reports of progress.
const AT_ONCE: usize = 256;

/// The identity of everything that a result depends on: a BLAKE3 hash of the contents of files, results and settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key([u8; HASH]);

impl Key {
    /// Returns the key of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// Returns the key of the contents of these files, in this order.
    ///
    /// # Errors
    /// The first file that cannot be read, by name.
    pub fn of_files(paths: &[&Path]) -> Result<Self, StoreError> {
        let hashes: Vec<Self> = paths.par_iter().map(|path| Self::of_file(path)).collect::<Result<_, _>>()?;
        Ok(hashes.into_iter().fold(Self::of(b"files"), Self::with))
    }

    /// Returns the key of the contents of a capture: of all files that it is read from.
    ///
    /// # Errors
    /// The first file that cannot be read, by name.
    pub fn of_scene(path: &Path) -> Result<Self, StoreError> {
        let files = files_of(path);
        Self::of_files(&files.iter().map(PathBuf::as_path).collect::<Vec<_>>())
    }

    /// Returns the key of the contents of the images and masks of these views; the absence of a file counts too. Begins
    /// the task "hashing images".
    ///
    /// # Errors
    /// The first existing file that cannot be read, by name; an interruption.
    pub fn of_images(views: &[TrainingView], progress: &mut dyn Progress) -> Result<Self, StoreError> {
        let paths: Vec<&Path> = views
            .iter()
            .flat_map(|view| [Some(&view.image), view.mask.as_ref()])
            .flatten()
            .map(PathBuf::as_path)
            .collect();
        let hash = |path: &&Path| if path.is_file() { Self::of_file(path) } else { Ok(Self::of(b"missing")) };
        let mut hashes = Vec::new();
        progress.begin("hashing images", paths.len());
        for some in paths.chunks(AT_ONCE) {
            proceed(progress)?;
            hashes.extend(some.par_iter().map(hash).collect::<Result<Vec<Self>, StoreError>>()?);
            some.iter().for_each(|_| progress.advance());
        }
        progress.finish();
        let corrected =
            views.iter().map(|view| view.correction).filter(|correction| *correction != Correction::default());
        let corrected = corrected.map(|correction| Self::of(format!("{correction:?}").as_bytes()));
        Ok(hashes.into_iter().chain(corrected).fold(Self::of(b"images"), Self::with))
    }

    /// Returns the key of the names, cameras and times of these views, and of which have masks. It does not depend on the
    /// place of their folder.
    pub fn of_views(views: &[TrainingView]) -> Self {
        let of = |view: &TrainingView| {
            let TrainingView { name, camera, time, original, mask, .. } = view;
            Self::of(format!("{name} {camera:?} {time} {original:?} {}", mask.is_some()).as_bytes())
        };
        views.iter().map(of).fold(Self::of(b"views"), Self::with)
    }

    /// Returns the key of the contents of a file: that of its bytes.
    ///
    /// # Errors
    /// A file that cannot be read, by name.
    pub fn of_file(path: &Path) -> Result<Self, StoreError> {
        let mut hasher = blake3::Hasher::new();
        let hashed = File::open(path).and_then(|file| hasher.update_reader(file).map(|_| ()));
        hashed.map_err(|error| CodecError::at(path, error))?;
        Ok(Self(*hasher.finalize().as_bytes()))
    }

    /// Returns the hash.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Returns the key of this one and of `other`.
    pub fn with(self, other: Self) -> Self {
        Self::of(&[self.0, other.0].concat())
    }

    /// Returns the key of this one and of `settings`.
    pub fn and(self, settings: &str) -> Self {
        self.with(Self::of(settings.as_bytes()))
    }
}

/// The first 16 digits of the hash, for messages and for comparisons of files that nobody has forged.
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().take(8).try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The folder of intermediate results, for one run alone or for runs of single stages. Once the last clone is dropped,
/// another run can work in it; if nothing is stored, the folder is removed then.
#[derive(Debug, Clone)]
pub struct Store(Arc<Held>);

/// A folder in which no other run works, or runs of single stages alone.
#[derive(Debug)]
struct Held {
    folder: PathBuf,
    users: Users,
    /// The file [`LOCK`]; `None` once the folder is released.
    lock: Option<File>,
}

/// Who works in a folder, or on a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Users {
    One,
    Many,
}

impl Store {
    /// Returns the folder next to the package `out` with `ending` appended to its name (`OUT.bake`), created if it does
    /// not exist.
    ///
    /// # Errors
    /// Another run works in the folder, or it cannot be created.
    pub fn beside(out: &Path, ending: &str) -> Result<Self, StoreError> {
        Self::open(out, ending, Users::One)
    }

    /// Returns the folder as [`beside`](Self::beside), for a run of a single stage, beside others of that kind.
    ///
    /// # Errors
    /// A run that needs the folder alone works in it, or it cannot be created.
    pub(crate) fn shared(out: &Path, ending: &str) -> Result<Self, StoreError> {
        Self::open(out, ending, Users::Many)
    }

    fn open(out: &Path, ending: &str, users: Users) -> Result<Self, StoreError> {
        let folder = folder_beside(out, ending);
        let mut unfinished = unfinished::lock();
        match lock(&folder, users) {
            Ok(lock) => {
                if users == Users::One {
                    unfinished.add_file(&folder.join(LOCK));
                }
                unfinished.add_folder(&folder);
                drop(unfinished);
                temporary_file::remove_stale(&folder);
                Ok(Self(Arc::new(Held { folder, users, lock: Some(lock) })))
            }
            Err(error) => Err(CodecError::at(&folder, error).into()),
        }
    }

    /// Waits until no other run works on a stage.
    ///
    /// # Errors
    /// The folder cannot be written to, an interruption.
    pub(crate) fn reserve(&self, stage: &str, progress: &mut dyn Progress) -> Result<Reserved, StoreError> {
        let path = self.folder().join(format!("{stage}.{LOCK}"));
        let mut waits = false;
        loop {
            if let Some(file) = lock_file(&path, Users::One).map_err(|error| FileError::at(&path, error))? {
                return Ok(Reserved { path, file: Some(file) });
            }
            if !waits {
                progress.note(&format!("{stage}: another run works on it: waiting for its result"));
                waits = true;
            }
            proceed(progress)?;
            thread::sleep(WAIT);
        }
    }

    /// Returns the path of the folder.
    pub fn folder(&self) -> &Path {
        &self.0.folder
    }

    /// Returns a stored result; `None` if there is none, or if it is damaged or has another key.
    pub fn load(&self, name: &str, key: Key) -> Option<Vec<u8>> {
        let bytes = fs::read(self.folder().join(name)).ok()?;
        let (head, body) = bytes.split_at_checked(HEAD)?;
        (head == self::head(key, body)).then(|| body.to_vec())
    }

    /// Stores a result, whole or not at all.
    ///
    /// # Errors
    /// A folder that cannot be written to, a full disk.
    pub fn store(&self, name: &str, key: Key, body: &[u8]) -> Result<(), StoreError> {
        write_beside(&self.folder().join(name), |file| {
            file.write_all(&head(key, body))?;
            file.write_all(body)
        })?;
        Ok(())
    }

    /// Writes a file that is no result and is never removed: `STEM.EXTENSION` in the folder, or the first of
    /// `STEM-2.EXTENSION` and so on that does not exist or has these bytes already. Returns its path.
    ///
    /// # Errors
    /// A folder that cannot be written to, a full disk.
    pub(crate) fn keep_aside(&self, stem: &str, extension: &str, bytes: &[u8]) -> Result<PathBuf, StoreError> {
        let mut path = self.folder().join(format!("{stem}.{extension}"));
        for number in 2_u64.. {
            if !path.exists() || fs::read(&path).is_ok_and(|before| before == bytes) {
                break;
            }
            path = self.folder().join(format!("{stem}-{number}.{extension}"));
        }
        write_beside(&path, |file| file.write_all(bytes))?;
        Ok(path)
    }

    /// Removes the stored results. The folder stays if it has other files.
    ///
    /// # Errors
    /// The folder cannot be listed, or a file in it not removed.
    pub fn remove(self) -> Result<(), StoreError> {
        let removed = fs::read_dir(self.folder()).and_then(|entries| {
            let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<Vec<_>>>()?;
            paths.iter().filter(|path| is_stored(path)).try_for_each(fs::remove_file)
        });
        removed.map_err(|error| CodecError::at(self.folder(), error))?;
        Ok(())
    }
}

/// A stage on which no other run works.
#[derive(Debug)]
pub(crate) struct Reserved {
    path: PathBuf,
    file: Option<File>,
}

impl Drop for Reserved {
    fn drop(&mut self) {
        // A run that waits notices that the file has been removed, and makes another.
        let _ = fs::remove_file(&self.path);
        drop(self.file.take());
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        if self.users == Users::Many && self.lock.as_ref().is_none_or(|file| file.try_lock().is_err()) {
            // Another run still works in the folder.
            return;
        }
        // A run that begins at this moment makes another lock file: the folder is then not empty, and stays.
        let mut unfinished = unfinished::lock();
        unfinished.take_file(&self.folder.join(LOCK));
        let _ = fs::remove_file(self.folder.join(LOCK));
        drop(self.lock.take());
        // `remove_dir` does not remove a folder that has contents.
        let _ = fs::remove_dir(&self.folder);
    }
}

/// Makes the folder, and locks it against other runs.
fn lock(folder: &Path, users: Users) -> io::Result<File> {
    let path = folder.join(LOCK);
    for _ in 0..ATTEMPTS {
        fs::create_dir_all(folder)?;
        match lock_file(&path, users) {
            // A run that has just ended removed the folder.
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error),
            Ok(Some(file)) => return Ok(file),
            // Runs of single stages that end lock the file for a moment.
            Ok(None) if users == Users::Many => thread::sleep(PAUSE),
            Ok(None) => break,
        }
    }
    let message = "another run of gs4d works in this folder: wait until it has ended, or write to another OUT";
    Err(io::Error::new(ErrorKind::ResourceBusy, message))
}

/// Makes a file and locks it; `None` if another run has locked it.
fn lock_file(path: &Path, users: Users) -> io::Result<Option<File>> {
    for _ in 0..ATTEMPTS {
        let file = File::options().create(true).truncate(false).write(true).open(path)?;
        let locked = match users {
            Users::One => file.try_lock(),
            Users::Many => file.try_lock_shared(),
        };
        match locked {
            Err(TryLockError::WouldBlock) => return Ok(None),
            // A run that has just ended removed the file.
            Ok(()) if !is_at(&file, path) => {}
            // Where files cannot be locked, the user must not run two at a time.
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(Some(file)),
        }
    }
    Ok(None)
}

/// Returns whether an open file is the one at this path.
fn is_at(file: &File, path: &Path) -> bool {
    let (open, there) = (file.metadata().ok(), path.metadata().ok());
    there.is_some() && open.as_ref().and_then(node) == there.as_ref().and_then(node)
}

/// Returns whether a file is a stored result, or the lock of a stage whose run was killed.
fn is_stored(path: &Path) -> bool {
    if path.extension().is_some_and(|extension| extension == LOCK) {
        return path.is_file();
    }
    let mut start = [0; MAGIC.len()];
    let read = path.is_file() && File::open(path).and_then(|mut file| file.read_exact(&mut start)).is_ok();
    read && start == MAGIC
}

fn head(key: Key, body: &[u8]) -> [u8; HEAD] {
    let mut head = [0; HEAD];
    head[..4].copy_from_slice(&MAGIC);
    head[4..8].copy_from_slice(&VERSION.to_le_bytes());
    head[8..8 + HASH].copy_from_slice(&key.0);
    head[8 + HASH..].copy_from_slice(blake3::hash(body).as_bytes());
    head
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_is_loaded_only_with_its_key() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("scene.gs4d");
        fs::write(&out, b"input").expect("the folder can be written to");
        let inputs = Key::of_files(&[&out]).expect("the file is there");
        let work = Store::beside(&out, ".bake").expect("the folder can be made");
        let (settings, others) = (inputs.and("ratio 0.8"), inputs.and("ratio 0.5"));
        let stored = work.store("kept", settings, b"some bytes");
        stored.expect("the folder can be written to");
        assert_eq!(work.load("kept", settings).as_deref(), Some(b"some bytes".as_slice()), "the same inputs");
        assert_eq!(work.load("kept", others), None, "other settings");
        assert_eq!(work.load("filter", settings), None, "never stored");
        let path = work.folder().join("kept");
        let mut bytes = fs::read(&path).expect("stored");
        bytes[HEAD + 2] ^= 1;
        fs::write(&path, &bytes).expect("the folder can be written to");
        assert_eq!(work.load("kept", settings), None, "a changed byte");
        fs::write(&path, &bytes[..7]).expect("the folder can be written to");
        assert_eq!(work.load("kept", settings), None, "cut off");
        work.remove().expect("the folder can be removed");
        assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 1, "nothing stays behind");
    }

    #[test]
    fn only_stored_results_are_removed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("scene.gs4d");
        let work = Store::beside(&out, ".bake").expect("the folder can be made");
        let (path, foreign) = (work.folder().to_owned(), work.folder().join("notes.txt"));
        work.store("kept", Key::of(b"inputs"), b"some bytes").expect("the folder can be written to");
        fs::write(&foreign, b"mine").expect("the folder can be written to");
        work.remove().expect("the folder can be listed");
        let left: Vec<_> = fs::read_dir(&path).expect("the folder").flatten().map(|entry| entry.path()).collect();
        assert_eq!(left, [foreign], "the file of somebody else");
    }

    #[test]
    fn one_run_at_a_time_works_in_a_folder() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("scene.gs4d");
        let first = Store::beside(&out, ".bake").expect("the folder can be made");
        let message = Store::beside(&out, ".bake").expect_err("the first is still there").to_string();
        assert!(message.contains("scene.gs4d.bake: another run"), "folder and reason: {message}");
        let clone = first.clone();
        drop(first);
        Store::beside(&out, ".bake").expect_err("a clone of the first is still there");
        drop(clone);
        assert!(!folder.path().join("scene.gs4d.bake").exists(), "nothing was stored");
        Store::beside(&out, ".bake").expect("nobody works in it");
        fs::write(folder.path().join("file.bake"), b"mine").expect("the folder can be written to");
        Store::beside(&folder.path().join("file"), ".bake").expect_err("a file of that name");
    }

    #[test]
    fn runs_of_single_stages_share_a_folder_and_take_turns_at_a_stage() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (out, progress) = (folder.path().join("scene.gs4d"), &mut crate::offline::work::NoProgress);
        let open = || Store::shared(&out, ".bake").expect("shared runs do not exclude one another");
        let (first, second) = (open(), open());
        Store::beside(&out, ".bake").expect_err("a whole bake waits for runs of single stages");
        let reserved = first.reserve("mask", progress).expect("nobody works on the stage");
        second.reserve("score", progress).expect("nobody works on another stage");
        let waiting =
            thread::spawn(move || second.reserve("mask", &mut crate::offline::work::NoProgress).map(|_| second));
        thread::sleep(3 * WAIT);
        assert!(!waiting.is_finished(), "another run works on the stage");
        drop(reserved);
        let second = waiting.join().expect("the thread ends").expect("nobody works on the stage");
        drop(first);
        assert!(out.with_file_name("scene.gs4d.bake").exists(), "the second run works in the folder");
        drop(second);
        assert!(!out.with_file_name("scene.gs4d.bake").exists(), "the last run removes an empty folder");
        Store::beside(&out, ".bake").expect("nobody works in it");
    }

    #[test]
    fn the_key_of_a_capture_depends_on_the_files_that_it_names() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        let write = |name: &str, bytes: &str| fs::write(at(name), bytes).expect("the folder can be written to");
        let means = r#"{"mins": [0, 0, 0], "maxs": [1, 1, 1], "files": ["means_l.webp", "means_u.webp"]}"#;
        let others = ["scales", "quats", "sh0"].map(|name| {
            let codebook = vec!["0"; 256].join(", ");
            format!(r#""{name}": {{"codebook": [{codebook}], "files": ["{name}.webp"]}}"#)
        });
        let meta = format!(r#"{{"version": 2, "count": 1, "means": {means}, {}}}"#, others.join(", "));
        write("meta.json", &meta);
        for name in ["means_l", "means_u", "scales", "quats", "sh0", "another"] {
            write(&format!("{name}.webp"), name);
        }
        let keys = || [folder.path().to_owned(), at("meta.json")].map(|path| Key::of_scene(&path).expect("a capture"));
        let [of_folder, of_file] = keys();
        assert_eq!(of_folder, of_file, "the folder is that file");
        write("another.webp", "changed");
        assert_eq!(keys(), [of_file; 2], "a file that it does not name");
        write("means_l.webp", "changed");
        assert_ne!(keys()[0], of_file, "a texture");
        assert_ne!(keys()[1], of_file, "a texture");
    }

    #[test]
    fn keys_depend_on_every_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, bytes).expect("the folder can be written to");
            path
        };
        let (ab, c, a, bc) = (file("ab", b"ab"), file("c", b"c"), file("a", b"a"), file("bc", b"bc"));
        let of = |paths: &[&Path]| Key::of_files(paths).expect("the files are there");
        assert_ne!(of(&[&ab, &c]), of(&[&a, &bc]), "borders between files count");
        assert_ne!(of(&[&ab, &c]), of(&[&c, &ab]), "and so does their order");
        let gone = Key::of_files(&[&folder.path().join("gone")]).expect_err("not there").to_string();
        assert!(gone.contains("gone"), "the file is named: {gone}");
    }
}
