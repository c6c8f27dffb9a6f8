//! What a training is asked for where its caller chooses nothing.
//!
//! In: the training views of a dataset. Out: [`Usual`]: the number of Gaussians and of steps, and whether real cameras
//! may have filmed it.
//!
//! A *rig* is several cameras that stand still and see the same moments, without masks. Its pictures differ in exposure
//! and white balance, and its moments share what stands. Other opaque pictures show surroundings, of which each moment
//! may show others. All other datasets, such as a camera that moves around an object on a background that is left out,
//! are trained as in the paper.

use super::error::TrainError;
use super::every_view::every_view;
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::{distinct_cameras, moments};
use crate::offline::dataset::splits::SplitOptions;
use crate::offline::picture_file;
use crate::offline::work::Progress;
use std::path::Path;

/// Fewest cameras and moments of a rig.
const CAMERAS: usize = 3;
const MOMENTS: usize = 3;
/// Pixels for each Gaussian: of the cameras of a rig at one moment; of one other opaque picture for each moment.
const PIXELS: usize = 32;
/// Steps of a rig: its held-out cameras do not gain from more.
const STEPS: usize = 10_000;
/// Steps of fine-tuning of a rig, and rounds of pruning: its held-out cameras lose with more.
const FINE_TUNING: usize = 500;
const ROUNDS: usize = 1;
/// Evaluations without an improvement after which training on opaque pictures that are not of a rig ends: their
/// held-out views lose with more steps.
const PATIENCE: usize = 5;
/// Fewest and most Gaussians of a rig and of other opaque pictures.
const GAUSSIANS: [usize; 2] = [60_000, 400_000];

/// The usual choices for a dataset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Usual {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Number of steps.
    pub steps: usize,
    /// Evaluations on validation views without an improvement after which training, or fine-tuning, ends; `None`: all
    /// steps are made.
    pub patience: Option<usize>,
    /// Rounds of pruning in a bake.
    pub rounds: usize,
    /// Steps of fine-tuning after them.
    pub fine_tuning: usize,
    /// Whether the dataset is that of a rig, for which exposures are trained.
    pub is_rig: bool,
}

impl Usual {
    /// The usual choices for pictures of an object without its surroundings.
    pub const PLAIN: Self =
        Self { gaussians: 60_000, steps: 20_000, patience: None, rounds: 4, fine_tuning: 5_000, is_rig: false };

    /// Returns the usual choices for these training views.
    pub fn of(views: &[TrainingView]) -> Self {
        let (cameras, moments) = (distinct_cameras(views), moments(views));
        // Sparse views of many moments are of cameras that move.
        let is_dense = 2 * views.len() >= cameras.len() * moments;
        if views.iter().any(|view| view.mask.is_some()) {
            return Self::PLAIN;
        }
        let pixels: usize = cameras.iter().map(|camera| camera.size.x as usize * camera.size.y as usize).sum();
        let [fewest, most] = GAUSSIANS;
        let of = |pixels: usize| (pixels / PIXELS).clamp(fewest, most);
        if cameras.len() >= CAMERAS && moments >= MOMENTS && is_dense {
            let (rounds, fine_tuning) = (ROUNDS, FINE_TUNING);
            return Self { gaussians: of(pixels), steps: STEPS, rounds, fine_tuning, is_rig: true, ..Self::PLAIN };
        }
        // A picture that cannot be read is told when it is loaded.
        let is_opaque = views.first().is_some_and(|view| picture_file::has_alpha(&view.image).is_ok_and(|has| !has));
        let gaussians = of(pixels / cameras.len().max(1) * moments);
        if is_opaque { Self { gaussians, patience: Some(PATIENCE), ..Self::PLAIN } } else { Self::PLAIN }
    }

    /// Returns the usual choices for the dataset in a folder.
    ///
    /// # Errors
    /// Views that cannot be used.
    pub fn read(data: &Path, options: &SplitOptions, progress: &mut dyn Progress) -> Result<Self, TrainError> {
        Ok(Self::of(&every_view(data, options, progress)?.views))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Camera;
    use glam::{UVec2, Vec3};

    /// Returns the views of so many cameras at so many moments; `every`: each camera sees one moment of so many.
    fn views(cameras: usize, moments: usize, every: usize) -> Vec<TrainingView> {
        let view = |camera: usize, moment: usize| {
            let eye = Vec3::new(1.0 + camera as f32, 2.0, 0.0);
            let at = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, UVec2::new(640, 360));
            let (name, image) = (format!("{camera}-{moment}"), "none.png".into());
            let time = moment as f32;
            TrainingView {
                name,
                camera: at,
                time,
                original: at.size,
                image,
                mask: None,
                correction: Default::default(),
            }
        };
        let sees = move |camera: usize, moment: usize| (camera + moment).is_multiple_of(every);
        let all = (0..cameras).flat_map(|camera| (0..moments).map(move |moment| (camera, moment)));
        all.filter(|&(camera, moment)| sees(camera, moment)).map(|(camera, moment)| view(camera, moment)).collect()
    }

    #[test]
    fn opaque_pictures_have_more_gaussians_for_more_moments() {
        let folder = tempfile::tempdir().expect("a folder");
        let gaussians = |cameras: usize, every: usize, picture: image::DynamicImage| {
            let path = folder.path().join("0.png");
            picture.save(&path).expect("a picture");
            let mut views = views(cameras, cameras.max(every), every);
            views.iter_mut().for_each(|view| view.image.clone_from(&path));
            Usual::of(&views)
        };
        let (opaque, clear) = (image::DynamicImage::new_rgb8(2, 2), image::DynamicImage::new_rgba8(2, 2));
        let each = 640 * 360 / 32;
        let expected = |gaussians: usize| Usual { gaussians, patience: Some(5), ..Usual::PLAIN };
        assert_eq!(gaussians(12, 12, opaque.clone()), expected(12 * each), "each camera sees its own moment");
        assert_eq!(gaussians(12, 12, clear), Usual::PLAIN, "an object without its surroundings");
        assert_eq!(gaussians(500, 500, opaque), expected(400_000), "at most");
    }

    #[test]
    fn cameras_that_see_the_same_moments_are_a_rig() {
        let rig = Usual::of(&views(27, 30, 1));
        assert_eq!((rig.gaussians, rig.is_rig), (27 * 640 * 360 / 32, true), "by the pixels of a moment");
        assert_eq!(Usual::of(&views(4, 10, 1)).gaussians, 60_000, "at least as many as usual");
        let mut clocks = views(6, 30, 1);
        clocks.iter_mut().enumerate().for_each(|(index, view)| view.time += 0.13 * (index / 30) as f32);
        assert!(Usual::of(&clocks).is_rig, "clocks that differ by parts of a frame");
        for (cameras, moments, every) in [(2, 30, 1), (71, 1, 1), (30, 30, 30)] {
            assert_eq!(
                Usual::of(&views(cameras, moments, every)),
                Usual::PLAIN,
                "{cameras} cameras, {moments} moments"
            );
        }
    }
}
