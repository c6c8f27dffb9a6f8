//! The package that is rewritten while training goes on.
//!
//! In: a path, scenes. Out: the package of the latest scene, replaced whole. A scene is written in the background;
//! while one is being written, others are left out.

use crate::codec::CodecError;
use crate::codec::package::WriteSettings;
use crate::offline::train::error::TrainError;
use crate::offline::work::{FileError, save};
use crate::scene::GaussianScene;
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};

/// The zstd level: the package is soon replaced.
const LEVEL: i32 = 1;

/// Returns the scene with the parameters that were found just now.
pub(crate) type Scene<'a> = &'a dyn Fn() -> Result<GaussianScene, TrainError>;

/// Writes one package again and again.
pub(crate) struct Writer {
    path: PathBuf,
    running: Option<JoinHandle<Result<(), CodecError>>>,
}

impl Writer {
    /// Returns a writer of the package at this path.
    pub(crate) fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), running: None }
    }

    /// Begins to write a scene, unless another is still being written.
    ///
    /// # Errors
    /// The previous scene could not be written, or this one cannot be read from the GPU.
    pub(crate) fn write(&mut self, scene: Scene<'_>) -> Result<(), TrainError> {
        if self.running.as_ref().is_some_and(|running| !running.is_finished()) {
            return Ok(());
        }
        self.wait()?;
        let (path, scene) = (self.path.clone(), scene()?);
        let work = move || save(&path, &scene, &WriteSettings { level: LEVEL });
        let running = thread::Builder::new().name("package".to_owned()).spawn(work);
        self.running = Some(running.map_err(|error| FileError::at(&self.path, error))?);
        Ok(())
    }

    /// Waits for the last scene.
    ///
    /// # Errors
    /// It could not be written.
    pub(crate) fn finish(mut self) -> Result<(), TrainError> {
        self.wait()
    }

    fn wait(&mut self) -> Result<(), TrainError> {
        match self.running.take().map(JoinHandle::join) {
            Some(Ok(written)) => Ok(written?),
            Some(Err(_)) => Err(TrainError::WriterPanicked),
            None => Ok(()),
        }
    }
}
