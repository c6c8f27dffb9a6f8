//! Gaussians of two segments in one form.
//!
//! In: a form, its place on the clock of all, a shift in space. Out: the form in the time and the space of all; the forms
//! of several segments as one, and of packed chunks, whose values stay as they are.

use super::clock::Place;
use crate::gaussian::{Gaussian, Harmonics, Parameters};
use crate::scene::packed::{BLOCK, SHARED_RANGES};
use crate::scene::{Form, PackedColors, PackedScene, RunPart, Runs, SceneForm, Sliced, Trained};

/// Moves Gaussians to the clock of all and by `shift`, capture units. Values that do not move keep their bits. Gaussians
/// in the trained form are moved only, not stretched in time: their clock must have the unit of the clock of all.
pub(super) fn move_form(form: &mut SceneForm, place: &Place, shift: [f64; 3]) {
    match form {
        SceneForm::Trained(Trained { parameters, .. }) => {
            parameters.mean.iter_mut().for_each(|mean| move_mean(mean, shift));
            parameters.mean_t.iter_mut().for_each(|mean_t| *mean_t = place.time(*mean_t) as f32);
        }
        SceneForm::Ready(Form::Sliced(Sliced { gaussians, .. })) => {
            gaussians.iter_mut().for_each(|gaussian| move_gaussian(gaussian, place, shift));
        }
        SceneForm::Ready(Form::Packed(_)) => {}
    }
}

fn move_mean(mean: &mut [f32; 3], shift: [f64; 3]) {
    for (value, shift) in mean.iter_mut().zip(shift) {
        *value = (f64::from(*value) + shift) as f32;
    }
}

fn move_gaussian(gaussian: &mut Gaussian, place: &Place, shift: [f64; 3]) {
    move_mean(&mut gaussian.mean, shift);
    gaussian.mean_t = place.time(gaussian.mean_t) as f32;
    if place.scale != 1.0 {
        gaussian.sigma_t = (f64::from(gaussian.sigma_t) * place.scale) as f32;
        gaussian.velocity = gaussian.velocity.map(|speed| (f64::from(speed) / place.scale) as f32);
    }
}

/// Appends the Gaussians of a form to those of another. Returns false if the forms or the models are different, or the
/// numbers of coefficients; then nothing is appended.
pub(super) fn append(all: &mut SceneForm, part: SceneForm) -> bool {
    match (all, part) {
        (SceneForm::Trained(all), SceneForm::Trained(part)) => {
            let is_alike = all.parameters.model() == part.parameters.model();
            if is_alike && append_colors(&mut all.harmonics, part.harmonics) {
                append_parameters(&mut all.parameters, part.parameters);
                return true;
            }
            false
        }
        (SceneForm::Ready(Form::Sliced(all)), SceneForm::Ready(Form::Sliced(mut part))) => {
            if append_colors(&mut all.harmonics, part.harmonics) {
                all.gaussians.append(&mut part.gaussians);
                return true;
            }
            false
        }
        (SceneForm::Ready(Form::Packed(all)), SceneForm::Ready(Form::Packed(part))) => append_packed(all, part),
        _ => false,
    }
}

/// Appends packed Gaussians that are drawn by the same ranges and codebooks, and their runs.
fn append_packed(all: &mut PackedScene, mut part: PackedScene) -> bool {
    let count = all.len();
    let (Some(runs), Some(own)) = (&mut all.runs, part.runs) else { return false };
    let shared = |ranges: &[[f32; 4]]| {
        ranges.iter().take(SHARED_RANGES).map(|range| range.map(f32::to_bits)).collect::<Vec<_>>()
    };
    let is_alike =
        count.is_multiple_of(BLOCK) && runs.stretches == own.stretches && shared(&all.ranges) == shared(&part.ranges);
    if !is_alike || !append_packed_colors(&mut all.colors, part.colors) {
        return false;
    }
    let Runs { parts, .. } = own;
    runs.parts.extend(parts.into_iter().map(|part| RunPart { end: count + part.end, ..part }));
    all.layers = runs.layers();
    all.records.append(&mut part.records);
    all.ranges.extend(part.ranges.into_iter().skip(SHARED_RANGES));
    true
}

fn append_packed_colors(all: &mut PackedColors, part: PackedColors) -> bool {
    match (all, part) {
        (PackedColors::Whole(all), PackedColors::Whole(part)) => append_colors(all, part),
        (PackedColors::Coded(all), PackedColors::Coded(mut part)) => {
            let degrees = (all.degree, all.degree_t) == (part.degree, part.degree_t);
            let is_alike = degrees && all.codebooks == part.codebooks;
            if is_alike {
                all.records.append(&mut part.records);
            }
            is_alike
        }
        _ => false,
    }
}

fn append_colors(all: &mut Harmonics, mut part: Harmonics) -> bool {
    let degrees = |harmonics: &Harmonics| (harmonics.coefficients, harmonics.degree, harmonics.degree_t);
    let is_alike = degrees(all) == degrees(&part);
    if is_alike {
        all.values.append(&mut part.values);
    }
    is_alike
}

fn append_parameters(all: &mut Parameters, mut part: Parameters) {
    all.mean.append(&mut part.mean);
    all.mean_t.append(&mut part.mean_t);
    all.log_scale.append(&mut part.log_scale);
    all.log_scale_t.append(&mut part.log_scale_t);
    all.rotation_l.append(&mut part.rotation_l);
    all.rotation_r.append(&mut part.rotation_r);
    all.opacity_logit.append(&mut part.opacity_logit);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};

    #[test]
    fn a_gaussian_on_a_faster_clock_is_at_the_same_place_at_the_same_moment() {
        let own = Gaussian {
            mean: [1.0, 2.0, 3.0],
            mean_t: 0.25,
            sigma_t: 0.5,
            velocity: [4.0, 0.0, -1.0],
            ..bytemuck::Zeroable::zeroed()
        };
        let mut moved = own;
        move_gaussian(&mut moved, &Place { begin: 0.0, start: 10.0, end: 12.0, scale: 2.0 }, [0.0, 0.0, 1.0]);
        for time in [0.0, 0.25, 1.0] {
            let there = 10.0 + 2.0 * time;
            assert_eq!(moved.mean_at(there) - own.mean_at(time), glam::Vec3::Z, "at {time}, one unit higher");
            assert_eq!(moved.marginal(there), own.marginal(time), "as visible at {time}");
        }
    }

    #[test]
    fn only_equal_forms_are_appended() {
        let scene = |degree| synthesize(&SynthSettings { count: 3, degree, ..SynthSettings::default() });
        let mut all = scene(3).form;
        assert!(append(&mut all, scene(3).form), "two trained forms");
        assert_eq!((all.len(), all.harmonics().map(|colors| colors.values.len())), (6, Some(6 * 48 * 3)), "of both");
        assert!(!append(&mut all, scene(1).form), "another degree of color");
        let runtime = scene(3).into_runtime().expect("the scene can be drawn");
        assert!(!append(&mut all, SceneForm::Ready(runtime.form)), "another form");
        assert_eq!(all.len(), 6, "what differs is left out");
    }
}
