//! The loss by pruning: PSNR on training views held out from scoring, and the smallest count within a loss.
//!
//! In: views with the pictures to compare them with ([`Evaluator`]), an [`Engine`] that draws them. Out: PSNR of a
//! pruned scene in dB; the smallest count within a loss, and every count tried ([`Trial`]).

use super::OfflineError;
use super::dataset::selection::to_draw;
use super::dataset::{DatasetError, TrainingView};
use super::engine::Engine;
use super::metrics::SquaredError;
use super::prune::{highest, select};
use crate::scene::{GaussianScene, RuntimeScene, TrainedWith};
use crate::view::{Background, Picture, View};
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

/// Views and the pictures to compare them with.
#[derive(Debug)]
pub struct Evaluator {
    views: Vec<View>,
    truth: Vec<Picture>,
    background: Background,
}

impl Evaluator {
    /// Returns an evaluator that compares with the images of these training views, over the color of `background`, or over the
    /// color of training if `background` has none.
    ///
    /// # Errors
    /// Images that are missing or cannot be decoded.
    pub fn by_images(
        views: &[TrainingView],
        trained_with: &TrainedWith,
        background: Background,
    ) -> Result<Self, DatasetError> {
        let behind = match background {
            Background::Color(color) => color,
            Background::None | Background::Environment => trained_with.background,
        };
        let load = |view: &TrainingView| view.load_covered().map(|image| image.over(Vec3::from(behind)));
        let truth = views.par_iter().map(load).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { views: to_draw(views, trained_with.optics()), truth, background })
    }

    /// Returns an evaluator that compares with the pictures of `scene` itself, for views without images.
    ///
    /// # Errors
    /// A failure of the engine.
    pub fn by_scene(
        engine: &mut Engine,
        scene: &RuntimeScene,
        views: &[TrainingView],
        background: Background,
    ) -> Result<Self, OfflineError> {
        let views = to_draw(views, scene.trained_with.optics());
        let mut drawing = engine.drawing(scene, background)?;
        let clamped = |view: &View| drawing.draw(view).map(|picture| picture.clamped());
        let truth = views.iter().map(clamped).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { views, truth, background })
    }

    /// Returns the number of views.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// Returns the PSNR of the squared error of all pixels, channels and views together, dB; pictures are clamped to 0..1. It is at
    /// most [`MAX_PSNR`](super::metrics::MAX_PSNR), and NaN without views.
    ///
    /// # Errors
    /// A failure of the engine, or a picture of another size.
    pub fn psnr(&self, engine: &mut Engine, scene: &RuntimeScene) -> Result<f64, OfflineError> {
        let mut drawing = engine.drawing(scene, self.background)?;
        let mut error = SquaredError::default();
        for (view, truth) in self.views.iter().zip(&self.truth) {
            error.add(&drawing.draw(view)?.clamped(), truth)?;
        }
        Ok(error.psnr())
    }

    /// Returns the [`psnr`](Self::psnr) of the `count` Gaussians of the highest scores. Pass the scene in the runtime
    /// form, because slicing takes time.
    ///
    /// # Errors
    /// A failure of the engine, a picture of another size, a Gaussian that cannot be drawn.
    ///
    /// # Panics
    /// If there are more scores than Gaussians.
    pub fn psnr_of_highest(
        &self,
        engine: &mut Engine,
        scene: &GaussianScene,
        scores: &[f32],
        count: usize,
    ) -> Result<f64, OfflineError> {
        self.psnr(engine, &select(scene, &highest(scores, count)).into_runtime()?)
    }
}

/// A count that was tried.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Trial {
    /// Number of Gaussians kept.
    pub count: usize,
    /// PSNR, dB.
    pub psnr: f64,
}

/// Returns the smallest count, up to `total`, whose PSNR is at or above `floor`, and every count tried, in order.
/// Bisects to within `tolerance`, or one Gaussian; `total` itself is assumed to reach `floor`.
///
/// # Errors
/// Those of `measure`, which returns the PSNR of a count.
pub fn smallest_count<E>(
    total: usize,
    tolerance: usize,
    floor: f64,
    mut measure: impl FnMut(usize) -> Result<f64, E>,
) -> Result<(usize, Vec<Trial>), E> {
    let (mut too_few, mut enough) = (0, total);
    let mut trials = Vec::new();
    while enough - too_few > tolerance.max(1) {
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
            let (found, trials) = smallest_count(1000, 2, 29.5, psnr).expect("cannot fail");
            assert!((wanted..=wanted + 2).contains(&found), "{found} for {wanted}");
            assert!(trials.len() <= 10, "bisection takes at most 10 trials: {trials:?}");
        }
        let (all, _) = smallest_count(1000, 2, 31.0, |_| Ok::<_, Infallible>(30.0)).expect("cannot fail");
        assert_eq!(all, 1000, "every Gaussian is needed");
    }
}
