//! Comparing a compressed scene with the original.
//!
//! In: the original scene, views, an [`Engine`]; then the compressed scene. Out: the squared error of each view.

use super::engine::Engine;
use super::memory_check::{BY_SIZE_OR_COUNT, Pictures};
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
    /// Pictures that do not fit the memory or the GPU, a failure of the engine.
    pub fn draw(
        engine: &mut Engine,
        scene: &RuntimeScene,
        views: Vec<View>,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        Pictures::originals(&views).require(engine.headless(), BY_SIZE_OR_COUNT)?;
        let mut pictures = Vec::with_capacity(views.len());
        draw_each(engine, scene, &views, progress, |picture| {
            pictures.push(picture);
            Ok(())
        })?;
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
        let mut errors = Vec::with_capacity(self.views.len());
        draw_each(engine, scene, &self.views, progress, |picture| {
            let original = &self.pictures[errors.len()];
            errors.push(SquaredError::of(&picture.clamped(), &original.clamped())?);
            Ok(())
        })?;
        Ok(errors)
    }
}

/// Draws the views one after the other, and calls `seen` with each picture.
fn draw_each(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[View],
    progress: &mut dyn Progress,
    mut seen: impl FnMut(Picture) -> Result<(), OfflineError>,
) -> Result<(), OfflineError> {
    let mut drawing = engine.drawing(scene, scene.trained_background())?;
    progress.begin("comparing", views.len());
    for view in views {
        proceed(progress)?;
        seen(drawing.draw(view)?)?;
        progress.advance();
    }
    progress.finish();
    Ok(())
}
