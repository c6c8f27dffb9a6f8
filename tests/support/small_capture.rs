//! Small captures for tests that run a command many times.
//!
//! In: numbers of Gaussians and of times. Out: a [`Capture`].

use crate::support::capture::Capture;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};

/// Returns `count` synthetic Gaussians with colors of degree 1, and their pictures of 32x32 pixels by four training
/// cameras at `times` times.
pub fn small_capture(count: usize, times: usize) -> Capture {
    let scene = synthesize(&SynthSettings { count, degree: 1, ..SynthSettings::default() });
    Capture::new(scene, Vec3::ZERO, 4, times, UVec2::splat(32), true)
}
