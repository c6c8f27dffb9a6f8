//! Comparing a compressed scene with the original.
//!
//! In: the original scene, views, an [`Engine`]; then the compressed scene. Out: the squared error of each view.

use super::engine::Engine;
use super::metrics::SquaredError;
use super::{OfflineError, Progress, proceed};
use crate::scene::RuntimeScene;
use crate::view::{Picture, View};

/// Views of the original, drawn before it is compressed.
#[derive(Debug, Clone)]
pub struct Originals {
    views: Vec<View>,
    pictures: Vec<Picture>,
}

impl Originals {
    /// Draws the views over the background that the scene was trained with. Begins the task "comparing".
    ///
    /// # Errors
    /// A failure of the engine.
    pub fn draw(
        engine: &mut Engine,
        scene: &RuntimeScene,
        views: Vec<View>,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        let pictures = pictures(engine, scene, &views, progress)?;
        Ok(Self { views, pictures })
    }

    /// Returns the squared error of each view of `scene` against the original; pictures are clamped to 0..1. Begins the task
    /// "comparing".
    ///
    /// # Errors
    /// A failure of the engine.
    pub fn errors(
        &self,
        engine: &mut Engine,
        scene: &RuntimeScene,
        progress: &mut dyn Progress,
    ) -> Result<Vec<SquaredError>, OfflineError> {
        let found = pictures(engine, scene, &self.views, progress)?;
        let error = |(a, b): (&Picture, &Picture)| Ok(SquaredError::of(&a.clamped(), &b.clamped())?);
        found.iter().zip(&self.pictures).map(error).collect()
    }
}

fn pictures(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[View],
    progress: &mut dyn Progress,
) -> Result<Vec<Picture>, OfflineError> {
    let mut drawing = engine.drawing(scene, scene.trained_background())?;
    progress.begin("comparing", views.len());
    let mut pictures = Vec::with_capacity(views.len());
    for view in views {
        proceed(progress)?;
        pictures.push(drawing.draw(view)?);
        progress.advance();
    }
    progress.finish();
    Ok(pictures)
}
