//! What training cameras see of each Gaussian.
//!
//! In: a capture, its training views. Out: [`Seen`]: the number of cameras in whose pictures each Gaussian is large,
//! and its distance from the nearest that shows it. What hangs before one camera is small in the pictures of those on
//! the other side; the sizes are those by which training removes floaters.

use super::error::SeenError;
use crate::gaussian::Gaussian;
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::camera_numbers;
use crate::offline::train::reference::floaters::LARGE;
use crate::offline::train::reference::pinhole::Pinhole;
use crate::offline::work::{Progress, proceed};
use crate::scene::GaussianScene;
use crate::scene::edit::Seen;
use crate::scene::edit::apply::{largest_deviation, life};
use crate::view::{Optics, RasterFov};
use rayon::prelude::*;

/// Number of Gaussians of a step of the progress.
const CHUNK: usize = 1 << 14;

/// Returns what the cameras of these views see of the Gaussians of a capture, whose origin is that of the views. A
/// camera counts once, also with many views: it sees a Gaussian if one of its pictures shows the mean of the Gaussian,
/// at a time at which it is drawn, and two standard deviations are larger than five pixels there. Begins the task
/// "looking".
///
/// # Errors
/// Parts of the capture that do not fit together, a Gaussian in the trained form that cannot be drawn, an interruption.
pub fn seen_by(scene: &GaussianScene, views: &[TrainingView], progress: &mut dyn Progress) -> Result<Seen, SeenError> {
    scene.check().map_err(SeenError::Scene)?;
    let gaussians = scene.gaussians()?;
    let cameras = cameras(scene, views);
    progress.begin("looking", gaussians.len().div_ceil(CHUNK));
    let mut seen = Seen::default();
    for (chunk, some) in gaussians.chunks(CHUNK).enumerate() {
        proceed(progress)?;
        let one = |(at, gaussian): (usize, &Gaussian)| look(scene, chunk * CHUNK + at, gaussian, &cameras);
        let found: Vec<(u32, f32)> = some.par_iter().enumerate().map(one).collect();
        seen.cameras.extend(found.iter().map(|(cameras, _)| cameras));
        seen.nearest.extend(found.iter().map(|(_, nearest)| nearest));
        progress.advance();
    }
    progress.finish();
    Ok(seen)
}

/// Returns the views of each camera: their projections and times.
fn cameras(scene: &GaussianScene, views: &[TrainingView]) -> Vec<Vec<(Pinhole, f32)>> {
    let optics = Optics { raster_fov: RasterFov::Corrected, ..scene.trained_with.optics() };
    let mut cameras: Vec<Vec<(Pinhole, f32)>> = Vec::new();
    for (view, number) in views.iter().zip(camera_numbers(views)) {
        let number = number as usize;
        if cameras.len() <= number {
            cameras.resize_with(number + 1, Vec::new);
        }
        cameras[number].push((Pinhole::of(&view.camera.view(view.time, optics)), view.time));
    }
    cameras
}

/// Returns the number of cameras that see a Gaussian, and the distance of the nearest that shows it.
fn look(scene: &GaussianScene, index: usize, gaussian: &Gaussian, cameras: &[Vec<(Pinhole, f32)>]) -> (u32, f32) {
    let [first, last] = life(index, gaussian, &scene.trained_with, scene.filter.as_ref());
    let size = 2.0 * largest_deviation(gaussian);
    let (mut count, mut nearest) = (0, f32::INFINITY);
    for views in cameras {
        let mut is_seen = false;
        for (lens, time) in views.iter().filter(|(_, time)| (first..=last).contains(&f64::from(*time))) {
            let place = gaussian.mean_at(*time);
            if lens.pixel_of(place).is_some() {
                nearest = nearest.min(lens.origin.distance(place));
                is_seen |= size > LARGE * lens.pixel_size(place);
            }
        }
        count += u32::from(is_seen);
    }
    (count, nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::offline::work::NoProgress;
    use crate::scene::RuntimeScene;
    use crate::view::Camera;
    use glam::{UVec2, Vec3};
    use std::f32::consts::TAU;

    /// Returns views at two times of six cameras on a circle of four units, which look at the origin.
    fn views() -> Vec<TrainingView> {
        let view = |index: usize| {
            let angle = (index / 2) as f32 * TAU / 6.0;
            let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 0.0);
            TrainingView {
                name: index.to_string(),
                camera: Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 1.2, UVec2::new(320, 240)),
                time: if index.is_multiple_of(2) { 0.25 } else { 0.75 },
                original: UVec2::new(320, 240),
                image: "none.png".into(),
                mask: None,
                correction: Default::default(),
            }
        };
        (0..12).map(view).collect()
    }

    fn gaussian(mean: Vec3, deviation: f32, sigma_t: f32) -> Gaussian {
        let variance = deviation * deviation;
        Gaussian {
            mean: mean.to_array(),
            mean_t: 0.25,
            velocity: [0.0; 3],
            sigma_t,
            covariance: [variance, 0.0, 0.0, variance, 0.0, variance],
            opacity: 0.5,
            padding: 0.0,
        }
    }

    #[test]
    fn a_camera_counts_once_and_only_while_the_gaussian_lives() {
        let close = Vec3::new(3.5, 0.02, 0.0);
        let gaussians = vec![
            // In the middle, and large: all six see it, at four units.
            gaussian(Vec3::ZERO, 0.2, f32::INFINITY),
            // Close before one camera, and small for the others.
            gaussian(close, 0.02, f32::INFINITY),
            // So small that none sees it, but in their pictures.
            gaussian(close, 0.0001, f32::INFINITY),
            // It lives between the two times.
            Gaussian { mean_t: 0.5, ..gaussian(close, 0.02, 0.01) },
            // High above all.
            gaussian(Vec3::Z * 100.0, 0.2, f32::INFINITY),
        ];
        let count = gaussians.len();
        let harmonics = Harmonics { coefficients: 1, values: vec![0.5; count * 3], ..Harmonics::default() };
        let scene = GaussianScene::from(RuntimeScene::sliced(gaussians, harmonics));
        let seen = seen_by(&scene, &views(), &mut NoProgress).expect("all can be drawn");
        assert_eq!(seen.cameras, [6, 1, 0, 0, 0], "numbers of cameras");
        let near = [4.0, 0.5, 0.5, f32::INFINITY, f32::INFINITY];
        for (index, (found, expected)) in seen.nearest.iter().zip(near).enumerate() {
            assert!(*found == expected || (found - expected).abs() < 1e-2, "{index}: {found} is {expected}");
        }
        let unseen = seen_by(&scene, &[], &mut NoProgress).expect("all can be drawn");
        assert_eq!(unseen.cameras, [0; 5], "no cameras");
    }
}
