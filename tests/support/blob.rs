//! Single Gaussians for tests.
//!
//! In: a mean, standard deviations, an opacity. Out: a Gaussian whose other fields tests may change.

use bevy_gs4d::gaussian::Gaussian;
use glam::Vec3;

/// Returns a Gaussian at rest that is active at all times, with standard deviations along the axes.
pub fn blob(mean: Vec3, deviation: Vec3, opacity: f32) -> Gaussian {
    let variance = deviation * deviation;
    Gaussian {
        mean: mean.to_array(),
        mean_t: 0.5,
        velocity: [0.0; 3],
        sigma_t: f32::INFINITY,
        covariance: [variance.x, 0.0, 0.0, variance.y, 0.0, variance.z],
        opacity,
        padding: 0.0,
    }
}
