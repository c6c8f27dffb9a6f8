//! Scenes of thin and of huge Gaussians, and the pictures in which they are difficult.
//!
//! In: a seed. Out: slivers (two long axes) and needles (one long axis) in random directions, Gaussians with variances
//! near the limits of single precision, and views of wide and of small pictures.

use crate::support::blob::blob;
use crate::support::random::Random;
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Camera, RasterFov, View};
use glam::{Mat3, Quat, UVec2, Vec3};

/// Returns a scene of Gaussians whose longest axis is 10² to 10⁵ times as long as the shortest.
pub fn thin_scene(seed: u64, count: usize) -> RuntimeScene {
    let mut random = Random::new(seed);
    let mut unit = move || random.below(1 << 20) as f32 / (1u32 << 20) as f32;
    let mut gaussians = Vec::new();
    let mut values = Vec::new();
    for index in 0..count {
        let direction = Quat::from_xyzw(unit() - 0.5, unit() - 0.5, unit() - 0.5, unit() - 0.5).normalize();
        let long = 0.02 * 100f32.powf(unit());
        let short = long / 100f32 / 1000f32.powf(unit());
        let middle = if index % 2 == 0 { short } else { long * unit() };
        let scaled = Mat3::from_quat(direction) * Mat3::from_diagonal(Vec3::new(long, middle, short));
        let covariance = scaled * scaled.transpose();
        let mean = Vec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
        gaussians.push(with_covariance(blob(mean, Vec3::ONE, 0.05 + 0.9 * unit()), covariance));
        values.extend([unit(), unit(), unit()].map(|color| (color - 0.5) * 3.0));
    }
    of_gaussians(gaussians, values)
}

/// Returns a scene of round Gaussians with standard deviations from 10⁶ to 10¹⁹, and one of ordinary size.
pub fn huge_scene() -> RuntimeScene {
    let huge = (6..=19).map(|power| {
        let mean = Vec3::new(0.01 * power as f32, 0.5, 0.1);
        with_covariance(blob(mean, Vec3::ONE, 0.3), Mat3::from_diagonal(Vec3::splat(10f32.powi(2 * power))))
    });
    let mut gaussians: Vec<Gaussian> = huge.collect();
    gaussians.push(blob(Vec3::ZERO, Vec3::splat(0.2), 0.8));
    let values = (0..gaussians.len() * 3).map(|i| (i * 7 % 5) as f32 / 5.0).collect();
    of_gaussians(gaussians, values)
}

fn with_covariance(gaussian: Gaussian, covariance: Mat3) -> Gaussian {
    let [xx, xy, xz, _, yy, yz, _, _, zz] = covariance.to_cols_array();
    Gaussian { covariance: [xx, xy, xz, yy, yz, zz], ..gaussian }
}

fn of_gaussians(gaussians: Vec<Gaussian>, values: Vec<f32>) -> RuntimeScene {
    RuntimeScene::sliced(gaussians, Harmonics { coefficients: 1, degree: 0, degree_t: 0, values })
}

/// Returns views of pictures that are small, of odd size, and very wide.
pub fn views() -> Vec<View> {
    let view = |size: UVec2, fov_x| {
        let eye = Vec3::new(1.5, -3.0, 0.7);
        Camera::look_at(eye, Vec3::ZERO, Vec3::Z, fov_x, size).view(0.5, RasterFov::Corrected)
    };
    vec![view(UVec2::new(64, 64), 0.8), view(UVec2::new(333, 77), 1.2), view(UVec2::new(4096, 8), 1.4)]
}
