//! A scene to score, prune and bake.
//!
//! In: a scene as read from a file. Out: the same scene, the form that is drawn, and the background ([`Subject`]).

use crate::offline::work::FileError;
use crate::scene::{GaussianScene, RuntimeScene};
use crate::view::Background;
use std::path::Path;

/// A scene as read from a file and in the form that is drawn.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The scene as read, in any form.
    pub scene: GaussianScene,
    /// The scene in the form that is drawn.
    pub runtime: RuntimeScene,
    /// The background.
    pub background: Background,
}

impl Subject {
    /// Slices a scene that was read from `path`. `background` (RGB, 0 to 1) replaces the background of training;
    /// `None` keeps it.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, with the path.
    pub fn new(path: &Path, scene: GaussianScene, background: Option<[f32; 3]>) -> Result<Self, FileError> {
        let runtime = scene.clone().into_runtime().map_err(|error| FileError::at(path, error))?;
        let background = background.map_or(runtime.trained_background(), Background::Color);
        Ok(Self { scene, runtime, background })
    }
}
