//! Gaussians that stand, in training.
//!
//! In: a synthetic scene, of which every third Gaussian lives longer than two intervals and moves slowly. Out: proof
//! that the pass `standing` has the results of its CPU reference, also of a scene of two parts, that it leaves other
//! Gaussians alone, and that noise does not move in time what stands. Skipped where there is no GPU.

use crate::support::trained::{trained, trained_mut};
use crate::support::training::{SEED, growing_step, still_growth};
use crate::support::{gpu, limited_device};
use bevy_gs4d::gaussian::{GradientMode, Parameters, SliceSettings};
use bevy_gs4d::internal::offline::engine::TrainedRecord;
use bevy_gs4d::internal::offline::train::{Request, Standing, Trainer, stand};
use bevy_gs4d::offline::train::{FineTuneSettings, Growth, Rates};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::GaussianScene;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::Vec3;

/// With bindings of [`BINDING`] bytes the first part has 7168.
const COUNT: usize = 9000;
const BINDING: u64 = 1 << 22;

/// The time interval, which is neither of length 1 nor around 0.
const INTERVAL: [f32; 2] = [2.0, 6.0];

/// Returns whether a Gaussian of [`scene`] lives long.
fn lives_long(index: usize) -> bool {
    index.is_multiple_of(3)
}

/// Returns a scene in which every third Gaussian lives longer than two intervals and moves, of which half have
/// quaternions of other signs; all others live for less than an interval.
fn scene() -> GaussianScene {
    let mut scene = synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() });
    scene.trained_with.time_interval = INTERVAL;
    let span = INTERVAL[1] - INTERVAL[0];
    let Parameters { mean_t, log_scale_t, rotation_l, rotation_r, opacity_logit, .. } =
        &mut trained_mut(&mut scene).parameters;
    for index in 0..COUNT {
        mean_t[index] = INTERVAL[0] + span * (index % 11) as f32 / 10.0;
        log_scale_t[index] = log_scale_t[index].min((0.9 * span).ln());
        if lives_long(index) {
            log_scale_t[index] = ((2.1 + (index % 50) as f32 * 0.1) * span).ln();
            let sign = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
            let [w, x, y, z] = rotation_l[index].map(|component| sign * component);
            rotation_r[index] = [w + 0.01, x - 0.015, y, z + 0.02];
            // Every other one is so faint that noise moves it.
            opacity_logit[index] = if index.is_multiple_of(2) { -7.0 } else { 1.0 };
        }
    }
    scene
}

/// Returns the scene after a step without gradients, in which what stands is kept at rest.
fn stepped(headless: &mut Headless, scene: GaussianScene, growth: Option<Growth>) -> GaussianScene {
    let mut trainer = Trainer::new(headless, scene, GradientMode::Exact).expect("the scene can be trained");
    let settings = FineTuneSettings { growth, standing: true, seed: SEED, ..FineTuneSettings::default() };
    trainer.prepare(&Request::of(&settings)).expect("the Gaussians are native");
    trainer.optimize(&growing_step(0, Rates::OURS, 144)).expect("the step succeeds");
    trainer.scene().expect("the scene can be read")
}

/// Returns the raw parameters of a Gaussian.
fn record(parameters: &Parameters, index: usize) -> TrainedRecord {
    TrainedRecord {
        mean: parameters.mean[index],
        mean_t: parameters.mean_t[index],
        log_scale: parameters.log_scale[index],
        log_scale_t: parameters.log_scale_t[index],
        rotation_l: parameters.rotation_l[index],
        rotation_r: parameters.rotation_r[index],
        opacity_logit: [parameters.opacity_logit[index], 0.0, 0.0, 0.0],
    }
}

#[test]
fn the_pass_standing_matches_the_cpu_reference_in_every_part() {
    let scene = scene();
    let times = Standing::of(INTERVAL).expect("the interval is not empty");
    for headless in [gpu::headless(), limited_device::binding(BINDING)] {
        let Some(mut headless) = headless else { return };
        let found = stepped(&mut headless, scene.clone(), None);
        let (before, found) = (trained(&scene), trained(&found));
        for index in 0..COUNT {
            let own = record(&before.parameters, index);
            let (mut expected, mut color) = (own, before.harmonics.of(index).to_vec());
            assert_eq!(stand(&mut expected, &mut color, &times), lives_long(index), "Gaussian {index} stands");
            let by_gpu = record(&found.parameters, index);
            assert_eq!(found.harmonics.of(index), color, "the color of Gaussian {index}");
            if !lives_long(index) {
                assert_eq!(by_gpu, own, "Gaussian {index} is left alone");
                continue;
            }
            let error = Vec3::from(by_gpu.mean).distance(Vec3::from(expected.mean));
            let far = Vec3::from(expected.mean).distance(Vec3::from(own.mean));
            assert!(error < 1e-3 * far + 1e-5, "Gaussian {index} is {error} from where it stands, {far} from its mean");
            let turned = by_gpu.rotation_l.iter().zip(expected.rotation_l).map(|(a, b)| (a - b).abs());
            let turned = turned.fold(0.0, f32::max);
            assert!(turned < 1e-5, "Gaussian {index} is turned by {turned}");
            let rest = TrainedRecord { mean: expected.mean, rotation_l: [0.0; 4], rotation_r: [0.0; 4], ..by_gpu };
            let expected = TrainedRecord { rotation_l: [0.0; 4], rotation_r: [0.0; 4], ..expected };
            assert_eq!(rest, expected, "Gaussian {index} has the times of what stands, and its own scales and opacity");
            assert_eq!(by_gpu.rotation_l, by_gpu.rotation_r, "Gaussian {index} has one rotation");
        }
        let moved = |parameters: &Parameters, index: usize| {
            Vec3::from(parameters.slice(&SliceSettings::default()).expect("valid parameters")[index].velocity).length()
        };
        let [was, is] = [&before.parameters, &found.parameters].map(|parameters| moved(parameters, 3));
        assert!(was > 1e-3 && is < 1e-9, "a Gaussian that moved at {was} stands: {is}");
    }
}

#[test]
fn noise_moves_what_stands_in_space_alone() {
    let Some(mut headless) = gpu::headless() else { return };
    let growth = Growth { noise: 5e5, ..still_growth() };
    // The second step begins with what stands.
    let still = stepped(&mut headless, scene(), None);
    let found = stepped(&mut headless, still.clone(), Some(growth));
    let (still, found) = (&trained(&still).parameters, &trained(&found).parameters);
    let mut moved = 0;
    for index in (0..COUNT).filter(|&index| lives_long(index)) {
        let times = |parameters: &Parameters| (parameters.mean_t[index], parameters.log_scale_t[index]);
        assert_eq!(times(found), times(still), "Gaussian {index} stands at all times");
        let far = Vec3::from(found.mean[index]).distance(Vec3::from(still.mean[index]));
        moved += usize::from(far > 1e-4);
    }
    assert!(moved > 100, "faint Gaussians search for places: {moved}");
}
