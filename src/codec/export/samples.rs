//! Gaussians for the tests of exports.
//!
//! In: a number and a degree. Out: [`Columns`] whose values all differ; their comparison within a tolerance.

use super::clip::Clip;
use crate::codec::import::columns::{Columns, sigmoid};
use crate::gaussian::{Harmonics, SMALLEST_CUTOFF};
use crate::scene::UpAxis;
use glam::Vec4;

/// The largest differences between columns.
pub(super) struct Tolerance {
    /// Of means.
    pub mean: f32,
    /// Of logarithms of scales.
    pub log_scale: f32,
    /// Of components of unit quaternions.
    pub rotation: f32,
    /// Of opacities.
    pub opacity: f32,
    /// Of coefficients of degree 0.
    pub color: f32,
    /// Of the other coefficients.
    pub harmonics: f32,
}

/// Returns Gaussians at rest.
pub(super) fn columns(count: usize, degree: u32) -> Columns {
    let wave = |index: usize, salt: usize| ((index * 7919 + salt * 104_729) % 1009) as f32 / 504.5 - 1.0;
    let coefficients = (degree as usize + 1).pow(2);
    let triple = |index: usize, salt: usize, factor: f32| [0_usize, 1, 2].map(|axis| factor * wave(index, salt + axis));
    Columns {
        mean: (0..count).map(|index| triple(index, 1, 3.0)).collect(),
        log_scale: (0..count).map(|index| triple(index, 4, 2.0).map(|value| value - 4.0)).collect(),
        rotation: (0..count).map(|index| [0, 1, 2, 3].map(|axis| 2.0 * wave(index, 7 + axis) + 0.01)).collect(),
        opacity_logit: (0..count).map(|index| 3.0 * wave(index, 11)).collect(),
        harmonics: Harmonics {
            coefficients,
            degree,
            degree_t: 0,
            values: (0..count * coefficients * 3).map(|value| 0.9 * wave(value, 12)).collect(),
        },
        ..Columns::default()
    }
}

/// Returns how a still capture is played.
pub(super) fn clip(up: UpAxis) -> Clip {
    Clip { time_interval: [0.0, 1.0], duration_seconds: 0.0, fps: 30.0, up, marginal_cutoff: SMALLEST_CUTOFF }
}

/// Checks that columns are alike.
pub(super) fn assert_alike(found: &Columns, expected: &Columns, tolerance: &Tolerance) {
    assert_eq!(found.len(), expected.len(), "the number of Gaussians");
    assert_eq!(found.harmonics.degree, expected.harmonics.degree, "the degree of the colors");
    let near = |what: &str, index: usize, found: &[f32], expected: &[f32], tolerance: f32| {
        let differ = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let is_near = found.len() == expected.len() && differ <= tolerance;
        assert!(is_near, "{what} of Gaussian {index}: {found:?}, not {expected:?}, differ by {differ}");
    };
    for index in 0..expected.len() {
        near("mean", index, &found.mean[index], &expected.mean[index], tolerance.mean);
        near("log scale", index, &found.log_scale[index], &expected.log_scale[index], tolerance.log_scale);
        let (own, other) =
            (Vec4::from(found.rotation[index]).normalize(), Vec4::from(expected.rotation[index]).normalize());
        let own = if own.dot(other) < 0.0 { -own } else { own };
        near("rotation", index, &own.to_array(), &other.to_array(), tolerance.rotation);
        let [own, other] = [found, expected].map(|columns| [sigmoid(columns.opacity_logit[index])]);
        near("opacity", index, &own, &other, tolerance.opacity);
        let (own, other) = (found.harmonics.of(index), expected.harmonics.of(index));
        near("color", index, &own[..3], &other[..3], tolerance.color);
        near("harmonics", index, &own[3..], &other[3..], tolerance.harmonics);
    }
}
