//! Reference pictures that several scenes are compared with.
//!
//! In: views, and their images or a scene that is drawn; then other scenes, such as pruned or compressed ones. Out: the
//! squared error of each view.

use super::MeasureError;
use super::evaluation::color_behind;
use super::metrics::{SizeMismatch, SquaredError};
use crate::offline::dataset::selection::to_draw;
use crate::offline::dataset::{DatasetError, TrainingView};
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::work::{NoProgress, Progress, proceed};
use crate::scene::{RuntimeScene, TrainedWith};
use crate::view::{Background, Picture, View};
use glam::Vec3;
use rayon::prelude::*;

/// Views and the pictures to compare them with.
#[derive(Debug, Clone)]
pub struct ReferencePictures {
    views: Vec<View>,
    pictures: Vec<Picture>,
    /// The background that the scenes are drawn over.
    background: Background,
}

impl ReferencePictures {
    /// Loads the images of these views, over the color of `background`: over black if it is [`Background::None`], and
    /// over the color of training in front of an environment map.
    ///
    /// # Errors
    /// Images that are missing or cannot be decoded.
    pub fn of_images(
        views: &[TrainingView],
        trained_with: &TrainedWith,
        background: Background,
    ) -> Result<Self, DatasetError> {
        let behind = Vec3::from(color_behind(background, trained_with));
        let load = |view: &TrainingView| view.load_covered().map(|image| image.over(behind));
        let pictures = views.par_iter().map(load).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { views: to_draw(views, trained_with.optics()), pictures, background })
    }

    /// Draws the views of a scene; pictures are clamped to 0..1. Begins the task "comparing".
    ///
    /// # Errors
    /// Pictures that do not fit the memory or the GPU, a failure of the engine.
    pub fn of_scene(
        engine: &mut Engine,
        scene: &RuntimeScene,
        views: Vec<View>,
        background: Background,
        progress: &mut dyn Progress,
    ) -> Result<Self, MeasureError> {
        Pictures::originals(&views).require(engine.headless(), Purpose::Verified)?;
        let pictures = draw_each(engine, scene, &views, background, progress, |_, picture| Ok(picture))?;
        Ok(Self { views, pictures, background })
    }

    /// Returns the number of views.
    pub fn count(&self) -> usize {
        self.views.len()
    }

    /// Returns the squared error of each view of `scene`; pictures are clamped to 0..1. Begins the task "comparing".
    ///
    /// # Errors
    /// A failure of the engine, a picture of another size.
    pub fn errors(
        &self,
        engine: &mut Engine,
        scene: &RuntimeScene,
        progress: &mut dyn Progress,
    ) -> Result<Vec<SquaredError>, MeasureError> {
        draw_each(engine, scene, &self.views, self.background, progress, |index, picture| {
            SquaredError::of(&picture, &self.pictures[index])
        })
    }

    /// Returns the PSNR of the squared error of all pixels, channels and views together, dB. It is at most
    /// [`MAX_PSNR`](super::MAX_PSNR), and NaN without views.
    ///
    /// # Errors
    /// As [`errors`](Self::errors).
    pub fn psnr(&self, engine: &mut Engine, scene: &RuntimeScene) -> Result<f64, MeasureError> {
        let errors = self.errors(engine, scene, &mut NoProgress)?;
        Ok(errors.into_iter().collect::<SquaredError>().psnr())
    }
}

/// Draws the views one after the other. Returns the results of `each`, which is called with the index of a view and its
/// picture, clamped to 0..1.
fn draw_each<T>(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[View],
    background: Background,
    progress: &mut dyn Progress,
    mut each: impl FnMut(usize, Picture) -> Result<T, SizeMismatch>,
) -> Result<Vec<T>, MeasureError> {
    let mut drawing = engine.drawing(scene, background)?;
    progress.begin("comparing", views.len());
    let mut results = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        proceed(progress)?;
        results.push(each(index, drawing.draw(view)?.clamped())?);
        progress.advance();
    }
    progress.finish();
    Ok(results)
}
