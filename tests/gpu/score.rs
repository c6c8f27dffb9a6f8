//! `score` on the GPU against its CPU reference.
//!
//! In: synthetic scenes. Out: proof that both return the same sums. Skipped where there is no GPU.

use crate::support::gpu;
use bevy_gs4d::internal::offline::score::score;
use bevy_gs4d::internal::offline::score::{GpuEngine, ScoreEngine, Want};
use bevy_gs4d::renderer::ShaderChecks;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::{Background, Camera, RasterFov};
use glam::{UVec2, Vec3};

#[test]
fn score_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let settings = SynthSettings { count: 4_000, degree: 1, ..SynthSettings::default() };
    let scene = synthesize(&settings).into_runtime().expect("synthetic scenes are valid");
    let background = Background::Color([0.2, 0.4, 0.1]);
    let mut engine =
        GpuEngine::new(&mut headless, &scene, background, ShaderChecks::On).expect("the scene fits the GPU");
    for (time, size) in [(0.1, UVec2::new(80, 60)), (0.6, UVec2::new(33, 47)), (0.6, UVec2::new(16, 16))] {
        let camera = Camera::look_at(Vec3::new(2.0, 0.6, 1.0), Vec3::ZERO, Vec3::Z, 0.8, size);
        let view = camera.view(time, RasterFov::Reference);
        let found = engine.score(&view, Want::Removal).expect("the view is scored");
        let expected = score(&scene, &view, background, Want::Removal);
        let columns = [
            ("contribution", &found.contribution, &expected.contribution),
            ("energy", &found.energy, &expected.energy),
            ("removal", &found.removal, &expected.removal),
        ];
        for (name, found, expected) in columns {
            let total: f32 = expected.iter().sum();
            assert!(total > 0.1, "{name} at {time}: the scene is visible, sum {total}");
            let apart: f32 = found.iter().zip(expected.iter()).map(|(a, b)| (a - b).abs()).sum();
            assert!(apart <= 1e-3 * total, "{name} at {time}: sums differ by {apart} in total, expected sum {total}");
            for (index, (found, expected)) in found.iter().zip(expected.iter()).enumerate() {
                // An alpha close to 1/255 may be skipped by one side only, in some pixels of a Gaussian.
                let apart = (found - expected).abs();
                assert!(
                    apart <= 1e-2 * *expected + 0.02,
                    "{name} at {time}: Gaussian {index} has {found}, expected {expected}"
                );
            }
        }
        let again = engine.score(&view, Want::Removal).expect("the view is scored");
        assert!(again == found, "at {time}: a second run has the same result");
    }
}
