//! The files and folders that must not outlive unfinished work.
//!
//! In: temporary files and work folders as they are created, outputs as they are complete. Out: a process that can exit
//! at any moment ([`abandon`]): unfinished files are removed, no further file becomes an output, and the existing
//! results are listed ([`Existing`]). A change on disk and the matching change of the list are made under one lock. The
//! list is empty until [`keep`] is called.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two attempts to take the lock.
const ATTEMPT: Duration = Duration::from_millis(1);

static LIST: Mutex<List> = Mutex::new(List(None));

/// Number of devices and pipes that are being written. A write to a pipe may wait for its reader forever.
static STREAMS: AtomicUsize = AtomicUsize::new(0);

/// The list; `None` until the program keeps it.
pub(crate) struct List(Option<Kept>);

#[derive(Default)]
struct Kept {
    /// Temporary files, and the lock files of work folders.
    files: BTreeSet<PathBuf>,
    /// Folders of intermediate results. They are removed if they are empty.
    folders: BTreeSet<PathBuf>,
    /// Files that are complete.
    outputs: BTreeSet<PathBuf>,
}

/// The results of the work so far.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Existing {
    /// The outputs that are complete.
    pub outputs: Vec<PathBuf>,
    /// Whether there are intermediate results, from which the same command resumes.
    pub resumes: bool,
}

/// Begins to keep the list: from now on the process may call [`abandon`].
pub(crate) fn keep() {
    lock().0.get_or_insert_default();
}

/// Returns the list, locked. While it is locked, [`abandon`] waits, so that the process does not exit.
pub(crate) fn lock() -> MutexGuard<'static, List> {
    LIST.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the results so far.
pub(crate) fn existing() -> Existing {
    lock().existing()
}

/// Removes all unfinished files and returns the results so far. From then on no temporary file is created, and none
/// becomes an output: threads that try wait until the process ends. Returns `None` and removes nothing if the list
/// stays locked for longer than `patience`.
pub(crate) fn abandon(patience: Duration) -> Option<Existing> {
    let start = Instant::now();
    let list = loop {
        match LIST.try_lock() {
            Ok(list) => break list,
            Err(TryLockError::Poisoned(poisoned)) => break poisoned.into_inner(),
            Err(TryLockError::WouldBlock) if start.elapsed() < patience => thread::sleep(ATTEMPT),
            Err(TryLockError::WouldBlock) => return None,
        }
    };
    list.remove();
    let existing = list.existing();
    // The list stays locked.
    std::mem::forget(list);
    Some(existing)
}

/// Returns whether a device or a pipe is being written.
pub(crate) fn is_streaming() -> bool {
    STREAMS.load(Ordering::SeqCst) > 0
}

/// A device or a pipe is being written until this is dropped.
pub(crate) struct Streaming(());

impl Streaming {
    /// Begins to write a device or a pipe.
    pub(crate) fn begin() -> Self {
        STREAMS.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for Streaming {
    fn drop(&mut self) {
        STREAMS.fetch_sub(1, Ordering::SeqCst);
    }
}

impl List {
    /// Adds a temporary file or a lock file.
    pub(crate) fn add_file(&mut self, path: &Path) {
        if let Some(kept) = &mut self.0 {
            kept.files.insert(path.to_owned());
        }
    }

    /// Takes out a file that has been removed or has become an output.
    pub(crate) fn take_file(&mut self, path: &Path) {
        if let Some(kept) = &mut self.0 {
            kept.files.remove(path);
        }
    }

    /// Adds a folder of intermediate results.
    pub(crate) fn add_folder(&mut self, path: &Path) {
        if let Some(kept) = &mut self.0 {
            kept.folders.insert(path.to_owned());
        }
    }

    /// Adds an output that is complete.
    pub(crate) fn add_output(&mut self, path: &Path) {
        if let Some(kept) = &mut self.0 {
            kept.outputs.insert(path.to_owned());
        }
    }

    fn remove(&self) {
        let Some(kept) = &self.0 else { return };
        // A file that cannot be removed is left.
        kept.files.iter().for_each(|path| drop(fs::remove_file(path)));
        // `remove_dir` does not remove a folder that has contents.
        kept.folders.iter().for_each(|path| drop(fs::remove_dir(path)));
    }

    fn existing(&self) -> Existing {
        let Some(Kept { folders, outputs, .. }) = &self.0 else { return Existing::default() };
        let is_output = |path: &&PathBuf| path.is_file() && !folders.iter().any(|folder| path.starts_with(folder));
        Existing {
            outputs: outputs.iter().filter(is_output).cloned().collect(),
            resumes: folders.iter().any(|folder| folder.is_dir()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unfinished_files_are_removed_and_complete_ones_are_listed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        let (begun, done, gone) = (path("begun"), path("done"), path("gone"));
        let [empty, work] = ["empty", "work"].map(path);
        let stored = work.join("stored");
        [&empty, &work].iter().for_each(|folder| fs::create_dir(folder).expect("the folder can be written to"));
        let files = [&begun, &done, &stored];
        files.iter().for_each(|file| fs::write(file, "bytes").expect("the folder can be written to"));
        let mut list = List(None);
        list.add_file(&begun);
        list.remove();
        assert!(begun.exists() && list.existing() == Existing::default(), "a list that is not kept is empty");
        list.0 = Some(Kept::default());
        files.iter().for_each(|file| list.add_file(file));
        [&done, &stored].iter().for_each(|file| list.take_file(file));
        [&done, &stored, &gone].iter().for_each(|file| list.add_output(file));
        list.add_folder(&empty);
        list.remove();
        assert!(!begun.exists() && !empty.exists(), "an unfinished file and an empty work folder are removed");
        assert!(done.exists() && stored.exists(), "complete files stay");
        assert!(!list.existing().resumes, "a removed folder has no results");
        list.add_folder(&work);
        list.remove();
        let expected = Existing { outputs: vec![done], resumes: true };
        assert_eq!(list.existing(), expected, "the output that exists, and the results in the work folder");
    }
}
