//! Scenes whose colors do not matter.
//!
//! In: Gaussians. Out: a scene of them, gray.

use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::scene::RuntimeScene;

/// Returns a scene of gray Gaussians.
pub fn scene(gaussians: &[Gaussian]) -> RuntimeScene {
    let harmonics = Harmonics { coefficients: 1, values: vec![0.0; gaussians.len() * 3], ..Harmonics::default() };
    RuntimeScene::sliced(gaussians.to_vec(), harmonics)
}
