//! Training with more Gaussians than one binding holds the colors of.
//!
//! In: a scene that a device with low limits divides into two parts. Out: proof that every step of training has the
//! same bytes as on a device that binds all at once, and that settings that need all Gaussians in one binding are
//! refused by name. Skipped where there is no GPU.

use crate::support::trained::trained_mut;
use crate::support::training::{add_terms, growing, growing_step, round, still_growth, view};
use crate::support::{gpu, limited_device};
use bevy_gs4d::internal::offline::compress::Centers;
use bevy_gs4d::internal::offline::engine::TrainedRecord;
use bevy_gs4d::internal::offline::train::{Cloning, FREE, Request, Sample, Trainer, TrainerState, is_free};
use bevy_gs4d::offline::dataset::CoveredImage;
use bevy_gs4d::offline::train::{FineTuneSettings, Growth, Rates, Terms};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Bits, GaussianScene};
use bevy_gs4d::view::Background;
use glam::UVec2;

/// The first part has 7168.
const COUNT: usize = 9000;

/// Bytes of a binding, which holds the gradients of as many pairs as frames have room for at first.
const BINDING: u64 = 1 << 22;

const SIZE: UVec2 = UVec2::new(70, 54);

/// Returns small Gaussians, of which every third has this logit of opacity.
fn scene(logit: f32) -> GaussianScene {
    let mut scene = synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() });
    let parameters = &mut trained_mut(&mut scene).parameters;
    parameters.log_scale.iter_mut().flatten().for_each(|scale| *scale -= 2.0);
    parameters.opacity_logit.iter_mut().step_by(3).for_each(|own| *own = logit);
    scene
}

/// Trains with everything that is used from pictures alone, and returns the state after each step. `change` is called
/// with the trainer after each step.
fn states(trainer: &mut Trainer<'_>, mut change: impl FnMut(&mut Trainer<'_>, usize)) -> Vec<TrainerState> {
    let texels = (0..SIZE.element_product()).map(|i| [(i * 7 % 200) as u8, 120, (i / 70 * 4) as u8, 255]).collect();
    let image = CoveredImage { size: SIZE, texels, has_gaps: false };
    let image = trainer.upload(&image).expect("the image fits the GPU");
    let steps = 1..=6usize;
    let after = |step: usize| {
        let of_step = growing_step(step - 1, Rates::OURS, 48);
        trainer.begin_step(&of_step).expect("the device works");
        let view = view(step, SIZE);
        let sample = Sample { view: &view, image: &image, background: Background::Color([0.0; 3]), number: 0 };
        // Frames have room for all pairs only after the first.
        trainer.make_room(&view).expect("the view is drawn");
        trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
        trainer.accumulate_terms(step).expect("the terms are added");
        trainer.optimize(&of_step).expect("the step succeeds");
        trainer.end_step(&of_step).expect("the device works");
        change(trainer, step);
        trainer.state().expect("the state can be read")
    };
    steps.map(after).collect()
}

/// Returns training from pictures alone with dropout and noise.
fn noisy() -> Growth {
    Growth { noise: 5e5, least_time_scale: 0.01, dropout: 0.1, ..still_growth() }
}

/// Returns the raw parameters of a state.
fn records(state: &TrainerState) -> Vec<TrainedRecord> {
    bytemuck::pod_collect_to_vec(&state.buffers[0])
}

/// Returns the buffers of a state by kind: raw parameters, colors, and what follows, with their moments; `parts` is the
/// number of parts of colors.
fn by_kind(state: &TrainerState, parts: usize) -> Vec<Vec<u8>> {
    let (geometry, rest) = state.buffers.split_at(3);
    let (colors, others) = rest.split_at(3 * parts);
    let joined = |kind: usize| colors.iter().skip(kind).step_by(3).flatten().copied().collect();
    [geometry, &[0, 1, 2].map(joined), others].concat()
}

/// Asserts that a training has the same bytes on both devices.
fn assert_same(
    logit: f32,
    growth: Growth,
    prepare: impl Fn(&mut Trainer<'_>),
    change: impl Fn(&mut Trainer<'_>, usize),
) -> Option<Vec<TrainerState>> {
    let (mut headless, mut limited) = (gpu::headless()?, limited_device::binding(BINDING)?);
    let trained = |headless: &mut Headless| {
        let mut trainer = growing(headless, scene(logit), growth);
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
        add_terms(trainer, terms).expect("the weights are right");
    };
    let change = |trainer: &mut Trainer<'_>, step: usize| {
        if step == 4 {
            let bits = Bits { mean: 14, velocity: 6, sigma_t: 6, scale: 4, rotation: 4, ..Bits::default() };
            round(trainer, bits, usize::MAX).expect("geometry can be packed");
        }
    };
    let growth = Growth { relocate_every: Some(3), ..noisy() };
    let Some(states) = assert_same(-9.0, growth, prepare, change) else { return };
    let faded = |state: &TrainerState| records(state).iter().filter(|record| record.opacity_logit[0] < -6.0).count();
    let (before, after) = (faded(&states[1]), faded(&states[2]));
    assert!(before > 2500 && after == 0, "the faded third moves, within parts and between them: {before}, {after}");
    let Some(mut limited) = limited_device::binding(BINDING) else { return };
    let mut trainer = growing(&mut limited, scene(-9.0), growth);
    assert!(trainer.resume(&states[1]), "a state of as many parts is accepted");
    assert!(trainer.state().expect("the state can be read") == states[1], "the state read back is unchanged");
}

#[test]
fn the_densification_of_the_original_has_the_same_bytes_with_two_parts() {
    // After three steps Gaussians are cloned and split and opacities reset, after six large ones are removed too.
    let cloning = Cloning { capacity: COUNT, every: 3, from: 0, until: usize::MAX, reset_every: 3 };
    let growth = Growth { cloning: Some(cloning), ..noisy() };
    let Some(states) = assert_same(FREE, growth, |_| {}, |_, _| {}) else { return };
    let [before, after] = [1, 2].map(|step| records(&states[step]));
    let filled = before.iter().zip(&after).filter(|(before, after)| is_free(before) && !is_free(after)).count();
    assert!(filled > 5, "Gaussians are cloned and split into free places: {filled}");
}

#[test]
fn settings_that_need_all_gaussians_in_one_binding_are_refused_by_name() {
    let Some(mut limited) = limited_device::binding(BINDING) else { return };
    let mut trainer = growing(&mut limited, scene(-2.0), still_growth());
    let terms = Terms { rigid: 0.5, ..Terms::default() };
    let refused = add_terms(&mut trainer, terms).expect_err("neighbors are of all Gaussians").to_string();
    assert!(refused.contains("the Gaussians of a rigid term"), "the term is named: {refused}");
    let books = Centers { entries: Vec::new(), codes: Vec::new() };
    let settings = FineTuneSettings::default();
    let request = Request { codebooks: Some(&books), ..Request::of(&settings) };
    let refused = trainer.prepare(&request).expect_err("entries are of all Gaussians").to_string();
    assert!(refused.contains("the Gaussians that codebooks give colors"), "codebooks are named: {refused}");
}
