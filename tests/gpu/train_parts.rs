//! Training of more Gaussians than a binding holds colors of.
//!
//! In: a scene that a device with low limits divides into two parts. Out: proof that every step of training has the same bytes as on a device that
//! binds all at once, and that what needs all Gaussians in one binding is refused by name.
//! Skipped where there is no GPU.

use crate::support::{gpu, limited_device};
use bevy_gs4d::gaussian::GradientMode;
use bevy_gs4d::internal::offline::fine_tune::{CloningStep, FREE, Sample, StepGrowth, Terms, Trainer, TrainerState};
use bevy_gs4d::internal::offline::quantize::codebook::Centers;
use bevy_gs4d::offline::dataset::CoveredImage;
use bevy_gs4d::offline::fine_tune::Rates;
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Bits, GaussianScene, SceneForm};
use bevy_gs4d::view::{Background, Camera, RasterFov, View};
use glam::{UVec2, Vec3};

/// The first part has 7168.
const COUNT: usize = 9000;

/// Bytes of a binding, which holds the gradients of as many pairs as frames have room for at first.
const BINDING: u64 = 1 << 22;

const SIZE: UVec2 = UVec2::new(70, 54);

/// Returns small Gaussians, of which every third has this logit of opacity.
fn scene(logit: f32) -> GaussianScene {
    let mut scene = synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() });
    let SceneForm::Trained(trained) = &mut scene.form else { panic!("the trained form") };
    let parameters = &mut trained.parameters;
    parameters.log_scale.iter_mut().flatten().for_each(|scale| *scale -= 2.0);
    parameters.opacity_logit.iter_mut().step_by(3).for_each(|own| *own = logit);
    scene
}

fn view(index: usize) -> View {
    let angle = index as f32 * 0.7;
    let eye = Vec3::new(2.4 * angle.cos(), 2.4 * angle.sin(), 1.2);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.8, SIZE).view(index as f32 / 6.0, RasterFov::Reference)
}

fn growing(headless: &mut Headless, logit: f32) -> Trainer<'_> {
    let mut trainer = Trainer::new(headless, scene(logit), GradientMode::Exact).expect("the scene can be trained");
    trainer.set_growing().expect("the Gaussians are native");
    trainer
}

/// Trains with everything that is used from pictures alone, and returns the state after each step. `change` gets the trainer after each.
fn states(trainer: &mut Trainer<'_>, mut change: impl FnMut(&mut Trainer<'_>, usize)) -> Vec<TrainerState> {
    let texels = (0..SIZE.element_product()).map(|i| [(i * 7 % 200) as u8, 120, (i / 70 * 4) as u8, 255]).collect();
    let image = CoveredImage { size: SIZE, texels, has_gaps: false };
    let image = trainer.upload(&image).expect("the image fits the GPU");
    let steps = 1..=6usize;
    let after = |step: usize| {
        trainer.drop_out(0.1, step as u32);
        let view = view(step);
        let sample = Sample { view: &view, image: &image, background: Background::Color([0.0; 3]), number: 0 };
        // Frames have room for all pairs only after the first.
        trainer.make_room(&view).expect("the view is drawn");
        trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
        trainer.accumulate_terms(step).expect("the terms are added");
        let growth =
            StepGrowth { color_values: 48, noise: 5e5, least_time_scale: 0.01, seed: step as u32, adds_up: true };
        trainer.step_growing(&Rates::OURS, 1.0, step, Some(growth)).expect("the step succeeds");
        change(trainer, step);
        trainer.state().expect("the state can be read")
    };
    steps.map(after).collect()
}

/// Returns the buffers of a state by kind: raw parameters, colors, and what follows, with their moments; `parts` is the number of parts of colors.
fn by_kind(state: &TrainerState, parts: usize) -> Vec<Vec<u8>> {
    let (geometry, rest) = state.buffers.split_at(3);
    let (colors, others) = rest.split_at(3 * parts);
    let joined = |kind: usize| colors.iter().skip(kind).step_by(3).flatten().copied().collect();
    [geometry, &[0, 1, 2].map(joined), others].concat()
}

/// Asserts that a training has the same bytes on both devices.
fn assert_same(
    logit: f32,
    prepare: impl Fn(&mut Trainer<'_>),
    change: impl Fn(&mut Trainer<'_>, usize),
) -> Option<Vec<TrainerState>> {
    let (mut headless, mut limited) = (gpu::headless()?, limited_device::binding(BINDING)?);
    let trained = |headless: &mut Headless| {
        let mut trainer = growing(headless, logit);
        prepare(&mut trainer);
        let states = states(&mut trainer, &change);
        assert_eq!(trainer.faults().expect("faults can be read"), None, "every gradient is finite");
        (states, trainer.scene().expect("the scene can be read"))
    };
    let ((whole, scene), (divided, of_parts)) = (trained(&mut headless), trained(&mut limited));
    assert_eq!(divided[0].buffers.len(), whole[0].buffers.len() + 3, "there are two parts");
    for (step, (whole, divided)) in whole.iter().zip(&divided).enumerate() {
        for (kind, (whole, divided)) in by_kind(whole, 1).iter().zip(by_kind(divided, 2)).enumerate() {
            assert!(*whole == divided, "step {}: buffer {kind} has the same bytes", step + 1);
        }
    }
    assert!(scene == of_parts, "the same scene is read");
    Some(divided)
}

#[test]
fn a_scene_of_two_parts_is_trained_to_the_same_bytes_as_one_of_a_single_part() {
    let prepare = |trainer: &mut Trainer<'_>| {
        let terms = Terms { opacity: 0.01, scale: 0.01, ..Terms::default() };
        trainer.set_terms(terms).expect("the weights are right");
    };
    let change = |trainer: &mut Trainer<'_>, step: usize| match step {
        2 => {
            let moved = trainer.relocate(17).expect("the device works");
            assert!(moved > 2500, "the faded third moves, within parts and between them: {moved}");
        }
        4 => {
            let bits = Bits { mean: 14, velocity: 6, sigma_t: 6, scale: 4, rotation: 4, ..Bits::default() };
            trainer.round(&bits).expect("geometry can be packed");
        }
        _ => {}
    };
    let Some(states) = assert_same(-9.0, prepare, change) else { return };
    let Some(mut limited) = limited_device::binding(BINDING) else { return };
    let mut trainer = growing(&mut limited, -9.0);
    assert!(trainer.resume(&states[1]), "a state of as many parts is accepted");
    assert!(trainer.state().expect("the state can be read") == states[1], "the state read back is unchanged");
}

#[test]
fn the_densification_of_the_original_has_the_same_bytes_with_two_parts() {
    let prepare = |trainer: &mut Trainer<'_>| trainer.set_cloning().expect("the shader compiles");
    let change = |trainer: &mut Trainer<'_>, step: usize| {
        if step == 3 {
            let step = CloningStep { batch: 1, removes_large: true, seed: 3 };
            let densified = trainer.densify(&step).expect("the device works");
            assert!(densified.moves.len() > 20, "Gaussians are cloned and split: {}", densified.moves.len());
            trainer.reset_opacity().expect("the device works");
        }
    };
    assert_same(FREE, prepare, change);
}

#[test]
fn what_needs_all_gaussians_in_one_binding_is_refused_by_name() {
    let Some(mut limited) = limited_device::binding(BINDING) else { return };
    let mut trainer = growing(&mut limited, -2.0);
    let terms = Terms { rigid: 0.5, ..Terms::default() };
    let refused = trainer.set_terms(terms).expect_err("neighbors are of all Gaussians").to_string();
    assert!(refused.contains("the Gaussians of a rigid term"), "the term is named: {refused}");
    let books = Centers { entries: Vec::new(), codes: Vec::new() };
    let refused = trainer.tie(books).expect_err("entries are of all Gaussians").to_string();
    assert!(refused.contains("the Gaussians that codebooks give colors"), "codebooks are named: {refused}");
}
