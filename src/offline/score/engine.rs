//! The interface of the engines that score views, and the CPU engine.
//!
//! In: a scene and a view. Out: a [`ViewScore`], or a [`ScoreError`].

use super::reference::{ViewScore, Want, score};
use super::variant::Variant;
use crate::scene::RuntimeScene;
use crate::view::{Background, View};
use std::error::Error;

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

/// The message of work that the user has interrupted.
pub(in crate::offline) const INTERRUPTED: &str = "interrupted";

/// Why there are no scores.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// No view was given.
    #[error("there are no training views to score with: pass a dataset whose transforms_train.json lists some")]
    NoViews,
    /// No Gaussian contributes to any view, as with views of another scene.
    #[error(
        "no Gaussian contributes to any training view: does this data belong to the checkpoint? (its cameras look elsewhere, or its \
         times lie outside the time interval)"
    )]
    NothingContributes,
    /// The variant needs scales, which a sliced scene does not have.
    #[error(
        "the score `{variant}` needs the volume of the Gaussians, which the runtime form no longer tells: score the checkpoint, or choose \
         one of {}",
        Variant::ALL.into_iter().filter(|v| !v.needs_volume()).map(Variant::name).collect::<Vec<_>>().join(", ")
    )]
    NoVolume {
        /// The requested variant.
        variant: Variant,
    },
    /// The user has asked the work to end.
    #[error("{INTERRUPTED}")]
    Interrupted,
    /// The engine failed.
    #[error("{0}")]
    Engine(#[source] Box<dyn Error + Send + Sync>),
}
