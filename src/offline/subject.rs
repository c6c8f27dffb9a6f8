//! A scene to score, prune and bake.
//!
//! In: a scene as it was read. Out: the same scene, the form that is drawn, and the background to draw it over
//! ([`Subject`]).

use super::OfflineError;
use crate::scene::{GaussianScene, RuntimeScene};
use crate::view::Background;
use std::path::Path;

/// A scene as it was read and as it is drawn.
#[derive(Debug, Clone)]
pub struct Subject {
    /// As it was read, in any form.
    pub scene: GaussianScene,
    /// In the form that is drawn.
    pub runtime: RuntimeScene,
    /// The background it is drawn over.
    pub background: Background,
}

impl Subject {
    /// Slices a scene that was read from `path`. `background` (RGB, 0 to 1) replaces the one it was trained with;
    /// `None` keeps that.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn, with the path.
    pub fn new(path: &Path, scene: GaussianScene, background: Option<[f32; 3]>) -> Result<Self, OfflineError> {
        let runtime = scene.clone().into_runtime().map_err(|error| OfflineError::at(path, error))?;
        let background = background.map_or(runtime.trained_background(), Background::Color);
        Ok(Self { scene, runtime, background })
    }
}
