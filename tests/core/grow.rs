//! Growing a capture.
//!
//! In: a synthetic scene. Out: proof that the parts of a Gaussian together have its mean and covariance, and that each
//! part has its color and opacity.

use crate::support::trained::trained;
use bevy_gs4d::scene::grow::grow;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, Trained};
use glam::{DMat4, DVec4};

const TIMES: usize = 4000;

fn scene() -> GaussianScene {
    synthesize(&SynthSettings { count: 5, ..SynthSettings::default() })
}

fn mean_of(trained: &Trained, index: usize) -> DVec4 {
    let [x, y, z] = trained.parameters.mean[index].map(f64::from);
    DVec4::new(x, y, z, f64::from(trained.parameters.mean_t[index]))
}

#[test]
fn parts_have_the_mean_and_the_covariance_of_the_whole() {
    let scene = scene();
    let whole = trained(&scene);
    let grown = grow(&scene, whole, TIMES, 7).expect("rotations are valid");
    let parts = trained(&grown);
    assert_eq!(grown.len(), 5 * TIMES, "the requested number of parts");
    for index in 0..5 {
        let factor = whole.parameters.factor(index).expect("valid");
        let expected = factor * factor.transpose();
        let inverse = factor.inverse();
        let own = index * TIMES..(index + 1) * TIMES;
        let part = parts.parameters.factor(own.start).expect("valid");
        let mut sum = part * part.transpose();
        let mut middle = DVec4::ZERO;
        for at in own.clone() {
            let offset = mean_of(parts, at) - mean_of(whole, index);
            sum += DMat4::from_cols(offset * offset.x, offset * offset.y, offset * offset.z, offset * offset.w)
                * (1.0 / TIMES as f64);
            middle += offset / TIMES as f64;
            assert_eq!(parts.parameters.opacity_logit[at], whole.parameters.opacity_logit[index], "opacity");
        }
        // In units of the Gaussian: the identity matrix, and no offset.
        let relative = inverse * sum * inverse.transpose();
        let error = (relative - DMat4::IDENTITY).to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        assert!(error < 0.12, "Gaussian {index}: the covariance is {error} off, {expected}");
        assert!((inverse * middle).length() < 0.1, "Gaussian {index}: the mean is off");
        let each = whole.harmonics.coefficients * 3;
        let values = |trained: &Trained, at: usize| trained.harmonics.values[at * each..(at + 1) * each].to_vec();
        assert_eq!(values(parts, own.end - 1), values(whole, index), "color");
    }
}

#[test]
fn the_same_seed_makes_the_same_scene() {
    let scene = scene();
    let again = |seed| grow(&scene, trained(&scene), 3, seed).expect("rotations are valid");
    assert!(again(1) == again(1), "the same seed");
    assert!(again(1) != again(2), "another seed");
    let single = grow(&scene, trained(&scene), 1, 1).expect("rotations are valid");
    assert!(single == scene, "a single part is the Gaussian itself");
}
