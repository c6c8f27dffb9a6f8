//! Scenes for tests of the packed form.
//!
//! In: a number of Gaussians, degrees of their harmonics. Out: a scene to pack, settings for packing, a view for
//! comparisons.

use bevy_gs4d::offline::compress::{CompressSettings, Quality};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{RuntimeScene, TemporalFilter};
use bevy_gs4d::view::{Background, Camera, RasterFov, View};
use glam::{UVec2, Vec3};

/// A black background.
pub const BLACK: Background = Background::Color([0.0; 3]);

/// Returns a synthetic scene with a support filter of nine segments. Every 17th Gaussian is at rest and active at all
/// times.
pub fn scene(count: usize, degree: u32, degree_t: u32) -> RuntimeScene {
    let settings = SynthSettings { count, degree, degree_t, ..SynthSettings::default() };
    let mut scene = synthesize(&settings).into_runtime().expect("synthetic scenes are valid");
    let sliced = scene.form.as_sliced_mut().expect("the scene is sliced");
    for gaussian in sliced.gaussians.iter_mut().step_by(17) {
        gaussian.sigma_t = f32::INFINITY;
        gaussian.velocity = [0.0; 3];
    }
    let filter =
        TemporalFilter::support(scene.iter(), scene.trained_with.time_interval, scene.trained_with.marginal_cutoff, 9);
    scene.filter = Some(filter);
    scene
}

/// Returns a view of the scene at a time from 0 to 1.
pub fn view(time: f32) -> View {
    let eye = Vec3::new(1.9, -1.2, 1.1);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.9, UVec2::new(120, 90)).view(time, RasterFov::Reference)
}

/// Returns settings with balanced geometry and color codebooks of the given sizes.
pub fn settings(codebooks: &[usize]) -> CompressSettings {
    CompressSettings { codebooks: codebooks.to_vec(), ..CompressSettings::from(Quality::Balanced) }
}
