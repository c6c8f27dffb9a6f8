//! What pruning costs: PSNR on training views held out from scoring, and the smallest count that a loss allows.
//!
//! In: views with the pictures they should show ([`Evaluator`]) and something that draws ([`Draw`]). Out: decibels of a pruned scene; the
//! smallest count within a loss, with every count tried.

use super::dataset::selection::to_draw;
use super::dataset::{DatasetError, ImageMode, TrainingView};
use super::metrics::{self, SizeMismatch};
use super::prune::{highest, select};
use crate::gaussian::InvalidGaussian;
use crate::reference;
use crate::scene::{GaussianScene, RuntimeScene, TrainedWith};
use crate::view::{Background, Picture, View};
use rayon::prelude::*;
use std::error::Error;

/// Something that draws views of a scene: the CPU twin or the GPU.
pub trait Draw {
    /// Draws the views in order and hands over each picture with its number.
    ///
    /// # Errors
    /// Whatever keeps it from drawing.
    fn draw(
        &mut self,
        scene: &RuntimeScene,
        views: &[View],
        background: Background,
        each: &mut dyn FnMut(usize, Picture),
    ) -> Result<(), Box<dyn Error + Send + Sync>>;
}

/// The CPU twin.
#[derive(Debug, Clone, Copy)]
pub struct CpuDraw;

impl Draw for CpuDraw {
    fn draw(
        &mut self,
        scene: &RuntimeScene,
        views: &[View],
        background: Background,
        each: &mut dyn FnMut(usize, Picture),
    ) -> Result<(), Box<dyn Error + Send + Sync>> {
        for (number, view) in views.iter().enumerate() {
            each(number, reference::render(scene, view, background).picture);
        }
        Ok(())
    }
}

/// Why a loss cannot be told.
#[derive(Debug, thiserror::Error)]
pub enum LossError {
    /// The images of the views cannot be used.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The scene cannot be drawn.
    #[error(transparent)]
    Invalid(#[from] InvalidGaussian),
    /// The engine failed.
    #[error("{0}")]
    Draw(#[source] Box<dyn Error + Send + Sync>),
    /// A picture has another size than the image it is compared with.
    #[error(transparent)]
    Size(#[from] SizeMismatch),
}

/// Views, and what they should show.
#[derive(Debug)]
pub struct Evaluator {
    views: Vec<View>,
    truth: Vec<Picture>,
    background: Background,
}

impl Evaluator {
    /// Compares with the images of these training views, as the original trains on them.
    ///
    /// # Errors
    /// Images that are missing or cannot be decoded.
    pub fn by_images(
        views: &[TrainingView],
        trained_with: &TrainedWith,
        background: Background,
    ) -> Result<Self, LossError> {
        let behind = match background {
            Background::Color(color) => color,
            Background::None | Background::Environment => trained_with.background,
        };
        let load = |view: &TrainingView| view.load_image(behind, ImageMode::Dataloader).map(|image| image.picture);
        let truth = views.par_iter().map(load).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { views: to_draw(views, trained_with.raster_fov), truth, background })
    }

    /// Compares with what the scene itself shows before it is pruned, where there are no images.
    ///
    /// # Errors
    /// The engine's.
    pub fn by_scene(
        views: &[TrainingView],
        scene: &RuntimeScene,
        background: Background,
        draw: &mut dyn Draw,
    ) -> Result<Self, LossError> {
        let views = to_draw(views, scene.trained_with.raster_fov);
        let mut truth = Vec::with_capacity(views.len());
        let keep = &mut |_: usize, picture: Picture| truth.push(picture.clamped());
        draw.draw(scene, &views, background, keep).map_err(LossError::Draw)?;
        Ok(Self { views, truth, background })
    }

    /// Number of views.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// Mean over the views of the mean PSNR of the three channels, dB; pictures are clamped to 0..1.
    ///
    /// # Errors
    /// The engine's, or a picture of the wrong size.
    pub fn psnr(&self, draw: &mut dyn Draw, scene: &RuntimeScene) -> Result<f64, LossError> {
        let mut results = Vec::with_capacity(self.views.len());
        let judge = &mut |number: usize, picture: Picture| {
            results.push(metrics::psnr(&picture.clamped(), &self.truth[number]));
        };
        draw.draw(scene, &self.views, self.background, judge).map_err(LossError::Draw)?;
        let total = results.into_iter().sum::<Result<f64, SizeMismatch>>()?;
        Ok(total / self.views.len() as f64)
    }

    /// As [`psnr`](Self::psnr), of the `count` Gaussians that score highest. Slicing takes time: give the runtime form.
    ///
    /// # Errors
    /// As [`psnr`](Self::psnr).
    pub fn psnr_of_highest(
        &self,
        draw: &mut dyn Draw,
        scene: &GaussianScene,
        scores: &[f32],
        count: usize,
    ) -> Result<f64, LossError> {
        self.psnr(draw, &select(scene, &highest(scores, count)).into_runtime()?)
    }
}

/// A count that was tried.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Trial {
    /// Number of Gaussians kept.
    pub count: usize,
    /// PSNR, dB.
    pub psnr: f64,
}

/// The smallest of `total` counts whose PSNR stays at or above `floor`, and every count tried, in order. Halves the range until it is
/// one fivehundredth of `total`; keeping everything is taken to be good enough.
///
/// # Errors
/// Those of `measure`, which tells the PSNR of a count.
pub fn smallest_count<E>(
    total: usize,
    floor: f64,
    mut measure: impl FnMut(usize) -> Result<f64, E>,
) -> Result<(usize, Vec<Trial>), E> {
    let (mut too_few, mut enough) = (0, total);
    let mut trials = Vec::new();
    while enough - too_few > (total / 500).max(1) {
        let count = too_few + (enough - too_few) / 2;
        let psnr = measure(count)?;
        trials.push(Trial { count, psnr });
        if psnr >= floor {
            enough = count;
        } else {
            too_few = count;
        }
    }
    Ok((enough, trials))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn the_search_ends_just_above_the_smallest_count() {
        for wanted in [1, 2, 37, 500, 801, 1000] {
            let psnr = |count: usize| Ok::<_, Infallible>(if count >= wanted { 30.0 } else { 29.0 });
            let (found, trials) = smallest_count(1000, 29.5, psnr).expect("cannot fail");
            assert!((wanted..=wanted + 2).contains(&found), "{found} for {wanted}");
            assert!(trials.len() <= 10, "few trials: {trials:?}");
        }
        let (all, _) = smallest_count(1000, 31.0, |_| Ok::<_, Infallible>(30.0)).expect("cannot fail");
        assert_eq!(all, 1000, "nothing can be spared");
    }
}
