//! What a training is asked for where its caller chooses nothing.
//!
//! In: the training views of a dataset. Out: [`Usual`]: the number of Gaussians and of steps, and whether real cameras
//! may have filmed it.
//!
//! A *rig* is several cameras that stand still and see the same moments, each with an image that covers all of its
//! pixels. Its pictures differ in exposure and white balance, and its moments share what stands. All other datasets, such
//! as a camera that moves around a synthetic scene, are trained as in the paper.

use super::error::TrainError;
use super::every_view::every_view;
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::{distinct_cameras, distinct_times};
use crate::offline::dataset::splits::SplitOptions;
use crate::offline::work::Progress;
use std::path::Path;

/// Fewest cameras and moments of a rig.
const CAMERAS: usize = 3;
const MOMENTS: usize = 3;
/// Pixels of the cameras at one moment for each Gaussian of a rig.
const PIXELS: usize = 32;
/// Steps of a rig: its held-out cameras do not gain from more.
const STEPS: usize = 10_000;
/// Fewest and most Gaussians of a rig.
const GAUSSIANS: [usize; 2] = [60_000, 400_000];

/// The usual choices for a dataset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Usual {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Number of steps.
    pub steps: usize,
    /// Whether the dataset is that of a rig, for which exposures are trained.
    pub is_rig: bool,
}

impl Usual {
    /// The usual choices for a dataset that is not of a rig.
    pub const PLAIN: Self = Self { gaussians: 60_000, steps: 20_000, is_rig: false };

    /// Returns the usual choices for these training views.
    pub fn of(views: &[TrainingView]) -> Self {
        let (cameras, moments) = (distinct_cameras(views), distinct_times(views));
        // Sparse views of many moments are of cameras that move.
        let is_dense = 2 * views.len() >= cameras.len() * moments;
        if cameras.len() < CAMERAS || moments < MOMENTS || !is_dense || views.iter().any(|view| view.mask.is_some()) {
            return Self::PLAIN;
        }
        let pixels: usize = cameras.iter().map(|camera| camera.size.x as usize * camera.size.y as usize).sum();
        let [fewest, most] = GAUSSIANS;
        Self { gaussians: (pixels / PIXELS).clamp(fewest, most), steps: STEPS, is_rig: true }
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
    fn cameras_that_see_the_same_moments_are_a_rig() {
        let rig = Usual::of(&views(27, 30, 1));
        assert_eq!((rig.gaussians, rig.is_rig), (27 * 640 * 360 / 32, true), "by the pixels of a moment");
        assert_eq!(Usual::of(&views(4, 10, 1)).gaussians, 60_000, "at least as many as usual");
        for (cameras, moments, every) in [(2, 30, 1), (71, 1, 1), (30, 30, 30)] {
            assert_eq!(
                Usual::of(&views(cameras, moments, every)),
                Usual::PLAIN,
                "{cameras} cameras, {moments} moments"
            );
        }
    }
}
