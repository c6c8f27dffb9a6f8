//! The interface of the engines that score views, and the CPU engine.
//!
//! In: a scene. Out: a [`ScoreEngine`], which returns a [`ViewScore`] for each view.

use super::ScoreError;
use super::reference::{ViewScore, Want, score};
use crate::scene::RuntimeScene;
use crate::view::{Background, View};

/// Scores views of a scene: the CPU reference or the GPU.
pub trait ScoreEngine {
    /// Scores one view. The vectors of the result have the order of the scene.
    ///
    /// # Errors
    /// [`ScoreError::Engine`].
    fn score(&mut self, view: &View, want: Want) -> Result<ViewScore, ScoreError>;
}

/// The CPU reference.
#[derive(Debug)]
pub struct CpuEngine<'a> {
    /// The scene to score.
    pub scene: &'a RuntimeScene,
    /// The background behind the scene.
    pub background: Background,
}

impl ScoreEngine for CpuEngine<'_> {
    fn score(&mut self, view: &View, want: Want) -> Result<ViewScore, ScoreError> {
        Ok(score(self.scene, view, self.background, want))
    }
}
