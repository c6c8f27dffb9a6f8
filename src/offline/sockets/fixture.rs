//! A body that moves, for tests.
//!
//! In: the time at which its Gaussians end. Out: a capture of it, and where each of its points is.

use crate::gaussian::{Gaussian, Harmonics};
use crate::scene::random::Random;
use crate::scene::{GaussianScene, RuntimeScene};
use glam::{DQuat, DVec3, Vec3};

/// The angular velocity of the body: three quarters of a turn.
pub(super) const TURN: DVec3 = DVec3::new(0.9, -1.1, 4.5);
/// The velocity of its center.
const DRIFT: DVec3 = DVec3::new(1.5, 0.4, -0.3);

/// Returns where a point of the body is at a time.
pub(super) fn place(point: DVec3, time: f64) -> DVec3 {
    DRIFT * time + DQuat::from_scaled_axis(TURN * time) * point
}

/// Returns a body of radius 0.5 whose Gaussians live for a part of the time and succeed each other; of those whose own
/// times are below `end`.
pub(super) fn body(end: f64) -> GaussianScene {
    let mut random = Random::new(7);
    let mut gaussians = Vec::new();
    for _ in 0..300 {
        let [x, y, z] = [(); 3].map(|()| f64::from(random.in_range(-1.0, 1.0)));
        let point = DVec3::new(x, y, z).normalize_or_zero() * 0.5 * f64::from(random.unit()).cbrt();
        let phase = f64::from(random.unit());
        for generation in 0..22 {
            let time = 0.06 * (f64::from(generation) + phase) - 0.2;
            let mean = place(point, time);
            let velocity = DRIFT + TURN.cross(mean - DRIFT * time);
            let gaussian = gaussian(mean.as_vec3(), time as f32, velocity.as_vec3(), 0.05);
            gaussians.extend((time < end).then_some(gaussian));
        }
    }
    scene(gaussians)
}

/// Returns a small round Gaussian.
pub(super) fn gaussian(mean: Vec3, mean_t: f32, velocity: Vec3, sigma_t: f32) -> Gaussian {
    Gaussian {
        mean: mean.to_array(),
        mean_t,
        velocity: velocity.to_array(),
        sigma_t,
        covariance: [1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3],
        opacity: 0.8,
        padding: 0.0,
    }
}

/// Returns a capture of gray Gaussians.
pub(super) fn scene(gaussians: Vec<Gaussian>) -> GaussianScene {
    let values = vec![0.0; 3 * gaussians.len()];
    colored(gaussians, values)
}

/// Returns a capture of Gaussians with these colors, three spherical harmonics of degree 0 each.
pub(super) fn colored(gaussians: Vec<Gaussian>, values: Vec<f32>) -> GaussianScene {
    RuntimeScene::sliced(gaussians, Harmonics { coefficients: 1, values, ..Harmonics::default() }).into()
}
