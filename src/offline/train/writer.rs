//! The package that is rewritten while training goes on.
//!
//! In: a path, scenes. Out: the package of the latest scene, replaced whole. A scene is written in the background; one that comes before
//! the last has been written is left out.

use crate::codec::CodecError;
use crate::codec::package::WriteSettings;
use crate::offline::fine_tune::Scene;
use crate::offline::{OfflineError, save};
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};

/// The zstd level: the package is soon replaced.
const LEVEL: i32 = 1;

/// Writes one package again and again.
pub(super) struct Writer {
    path: PathBuf,
    running: Option<JoinHandle<Result<(), CodecError>>>,
}

impl Writer {
    /// Returns a writer of the package at this path.
    pub(super) fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), running: None }
    }

    /// Begins to write a scene, unless another is still being written.
    ///
    /// # Errors
    /// The scene before could not be written, or this one cannot be read.
    pub(super) fn write(&mut self, scene: Scene<'_>) -> Result<(), OfflineError> {
        if self.running.as_ref().is_some_and(|running| !running.is_finished()) {
            return Ok(());
        }
        self.wait()?;
        let (path, scene) = (self.path.clone(), scene()?);
        let work = move || save(&path, &scene, &WriteSettings { level: LEVEL });
        let running = thread::Builder::new().name("package".to_owned()).spawn(work);
        self.running = Some(running.map_err(|error| OfflineError::at(&self.path, error))?);
        Ok(())
    }

    /// Waits for the last scene.
    ///
    /// # Errors
    /// It could not be written.
    pub(super) fn finish(mut self) -> Result<(), OfflineError> {
        self.wait()
    }

    fn wait(&mut self) -> Result<(), OfflineError> {
        match self.running.take().map(JoinHandle::join) {
            Some(Ok(written)) => Ok(written?),
            Some(Err(_)) => Err(OfflineError::WritersPanicked),
            None => Ok(()),
        }
    }
}
