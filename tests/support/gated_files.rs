//! An asset source in memory, whose files a test lets through, fails and counts.
//!
//! In: the contents of files by their names. Out: the asset source `gated`. A read of a file that is not let through
//! waits without blocking a thread, so that any number of reads may wait.

use bevy::asset::io::memory::{Dir, MemoryAssetReader};
use bevy::asset::io::{AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader};
use bevy::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::future::poll_fn;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Poll, Waker};

/// The files of the asset source. At first none of them is let through.
#[derive(Clone)]
pub struct GatedFiles {
    files: MemoryAssetReader,
    gate: Arc<Mutex<Gate>>,
}

#[derive(Default)]
struct Gate {
    /// Whether every file is let through.
    is_open: bool,
    /// The files that are let through.
    let_through: BTreeSet<String>,
    /// The files whose next read fails.
    failing: BTreeSet<String>,
    /// The files whose reads all fail.
    broken: BTreeSet<String>,
    /// Number of reads of each file, those that wait or have failed included.
    reads: BTreeMap<String, usize>,
    /// The reads that wait.
    waiting: Vec<Waker>,
}

impl GatedFiles {
    pub fn new(files: &BTreeMap<String, Vec<u8>>) -> Self {
        let root = Dir::default();
        for (name, bytes) in files {
            root.insert_asset(Path::new(name), bytes.clone());
        }
        Self { files: MemoryAssetReader { root }, gate: Arc::default() }
    }

    /// Adds the asset source to an app that has no `AssetPlugin` yet.
    pub fn add_to(&self, app: &mut App) {
        let source = self.clone();
        app.register_asset_source("gated", AssetSourceBuilder::new(move || Box::new(source.clone())));
    }

    /// Lets some files through, now and later.
    pub fn let_through(&self, names: impl IntoIterator<Item = String>) {
        self.change(|gate| gate.let_through.extend(names));
    }

    /// Lets all files through, now and later.
    pub fn open(&self) {
        self.change(|gate| gate.is_open = true);
    }

    /// Makes the next read of each of these files fail, once it is let through.
    pub fn fail_once(&self, names: impl IntoIterator<Item = String>) {
        self.change(|gate| gate.failing.extend(names));
    }

    /// Makes every read of each of these files fail, once it is let through.
    pub fn fail(&self, names: impl IntoIterator<Item = String>) {
        self.change(|gate| gate.broken.extend(names));
    }

    /// Returns the number of reads of each file that has been asked for.
    pub fn reads(&self) -> BTreeMap<String, usize> {
        self.gate().reads.clone()
    }

    fn change(&self, change: impl FnOnce(&mut Gate)) {
        let mut gate = self.gate();
        change(&mut gate);
        gate.waiting.drain(..).for_each(Waker::wake);
    }

    fn gate(&self) -> MutexGuard<'_, Gate> {
        self.gate.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl AssetReader for GatedFiles {
    async fn read<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        let name = path.to_string_lossy().into_owned();
        *self.gate().reads.entry(name.clone()).or_default() += 1;
        let let_through = poll_fn(|context| {
            let mut gate = self.gate();
            if gate.is_open || gate.let_through.contains(&name) {
                return Poll::Ready(());
            }
            gate.waiting.push(context.waker().clone());
            Poll::Pending
        });
        let_through.await;
        let fails = {
            let mut gate = self.gate();
            gate.failing.remove(&name) || gate.broken.contains(&name)
        };
        if fails {
            return Err(AssetReaderError::NotFound(path.to_owned()));
        }
        self.files.read(path).await
    }

    async fn read_meta<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        self.files.read_meta(path).await
    }

    async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
        self.files.read_directory(path).await
    }

    async fn is_directory<'a>(&'a self, path: &'a Path) -> Result<bool, AssetReaderError> {
        self.files.is_directory(path).await
    }
}
