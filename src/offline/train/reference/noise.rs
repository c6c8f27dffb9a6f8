//! Noise of means; CPU reference of `shaders/offline/noise.wgsl`.
//!
//! In: the raw parameters of a native 4D Gaussian, its index, the seed of a step, a strength, the least temporal scale.
//! Out: its mean after the step, moved at random in space and time if the Gaussian is faint; its temporal scale, if it
//! was smaller.
//!
//! 3DGS-MCMC takes the Gaussians for samples of a distribution and the noise for the exploration of Langevin dynamics:
//! faint Gaussians search for places that images need, and opaque ones, which have found theirs, stay. Along each axis
//! of the 4D Gaussian the noise is normal, with the deviation `strength × variance × faint`, where `faint` is a sigmoid
//! of the opacity: 1 for transparent Gaussians, 0 for opaque ones. Unlike there, the deviation is at most one scale
//! times `faint`, and a tenth of the scale along the fourth axis (time unless the Gaussian is rotated): otherwise a
//! large Gaussian would move by many scales, far out of the scene and the time interval.

use super::random_words::{STRIDE, mixed, word_of};
use crate::gaussian::rotation_4d;
use crate::offline::engine::layout::TrainedRecord;
use glam::DVec4;
use std::f64::consts::TAU;

/// Opacity of half the noise.
const FAINT: f64 = 0.005;
/// How fast the noise falls above that opacity.
const SLOPE: f64 = 100.0;
/// Largest deviation of the noise of a fully transparent Gaussian along each axis, in scales.
const LARGEST: DVec4 = DVec4::new(1.0, 1.0, 1.0, 0.1);

/// Moves the mean of a Gaussian, and raises its temporal scale to at least the exponential of `least_log_scale_t`.
pub fn noise(record: &mut TrainedRecord, index: u32, seed: u32, strength: f32, least_log_scale_t: f32) {
    let vector = |values: [f32; 4]| DVec4::from(values.map(f64::from));
    let [x, y, z] = record.log_scale;
    let scale = vector([x, y, z, record.log_scale_t]).map(f64::exp);
    let opacity = 1.0 / (1.0 + (-f64::from(record.opacity_logit[0])).exp());
    let faint = 1.0 / (1.0 + (SLOPE * (opacity - FAINT)).exp());
    let factors = (f64::from(strength) * scale).min(LARGEST);
    let rotation = rotation_4d(vector(record.rotation_l).normalize(), vector(record.rotation_r).normalize());
    let moved = rotation * (faint * factors * scale * normals(index, seed));
    let mean = record.mean.map(f64::from);
    record.mean = [0, 1, 2].map(|axis| (mean[axis] + moved[axis]) as f32);
    record.mean_t = (f64::from(record.mean_t) + moved.w) as f32;
    record.log_scale_t = record.log_scale_t.max(least_log_scale_t);
}

/// Returns four independent numbers of the standard normal distribution (Box and Muller).
fn normals(index: u32, seed: u32) -> DVec4 {
    let a = word_of(index, seed);
    let b = mixed(a.wrapping_add(STRIDE));
    let c = mixed(b.wrapping_add(STRIDE));
    let d = mixed(c.wrapping_add(STRIDE));
    let [first, second] = [a, c].map(|word| (-2.0 * unit(word).ln()).sqrt());
    let [one, other] = [b, d].map(|word| TAU * unit(word));
    DVec4::new(first * one.cos(), first * one.sin(), second * other.cos(), second * other.sin())
}

/// Returns a number above 0, at most 1.
fn unit(word: u32) -> f64 {
    f64::from((word >> 8) + 1) / f64::from(1 << 24)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a Gaussian at the origin, not rotated.
    fn record(opacity: f32, log_scale: [f32; 3], log_scale_t: f32) -> TrainedRecord {
        TrainedRecord {
            log_scale,
            log_scale_t,
            rotation_l: [1.0, 0.0, 0.0, 0.0],
            rotation_r: [1.0, 0.0, 0.0, 0.0],
            opacity_logit: [(opacity / (1.0 - opacity)).ln(), 0.0, 0.0, 0.0],
            ..TrainedRecord::default()
        }
    }

    /// Returns the deviation of the noise along each axis.
    fn deviations(record: TrainedRecord, strength: f32) -> [f64; 4] {
        const COUNT: u32 = 20_000;
        let mut squares = [0.0; 4];
        for index in 0..COUNT {
            let mut moved = record;
            noise(&mut moved, index, 77, strength, f32::NEG_INFINITY);
            let [x, y, z] = moved.mean;
            for (sum, value) in squares.iter_mut().zip([x, y, z, moved.mean_t]) {
                *sum += f64::from(value).powi(2) / f64::from(COUNT);
            }
        }
        squares.map(f64::sqrt)
    }

    #[test]
    fn the_deviation_follows_the_variance_and_the_opacity() {
        let scales = [0.1f32, 0.2, 0.05];
        let found = deviations(record(0.005, scales.map(f32::ln), 0.3f32.ln()), 3.0);
        let expected = [0.5 * 3.0 * 0.01, 0.5 * 3.0 * 0.04, 0.5 * 3.0 * 0.0025, 0.5 * 0.1 * 0.3];
        for (axis, (found, expected)) in found.into_iter().zip(expected).enumerate() {
            assert!((found / expected - 1.0).abs() < 0.03, "axis {axis}: deviation {found}, expected {expected}");
        }
        let large = deviations(record(0.005, [0.5f32.ln(); 3], 0.3f32.ln()), 3e3);
        assert!(large[..3].iter().all(|moved| (moved / 0.25 - 1.0).abs() < 0.03), "at most one scale: {large:?}");
        let opaque = deviations(record(0.5, scales.map(f32::ln), 0.3f32.ln()), 3.0);
        assert!(opaque.iter().all(|&moved| moved < 1e-15), "an opaque Gaussian stays: {opaque:?}");
    }

    #[test]
    fn the_temporal_scale_is_raised_to_the_least() {
        for (own, least, expected) in [(-4.0, -3.0, -3.0), (-2.0, -3.0, -2.0), (-9.0, f32::NEG_INFINITY, -9.0)] {
            let mut record = record(0.5, [-2.0; 3], own);
            noise(&mut record, 0, 1, 10.0, least);
            assert_eq!(record.log_scale_t, expected, "logarithm of the scale {own}, at least {least}");
        }
    }

    #[test]
    fn noise_repeats_with_the_seed_and_differs_between_gaussians_and_steps() {
        let moved = |index, seed| {
            let mut record = record(0.01, [-2.0; 3], -1.0);
            noise(&mut record, index, seed, 10.0, f32::NEG_INFINITY);
            record
        };
        assert_eq!(moved(4, 9), moved(4, 9), "the same index and seed");
        assert_ne!(moved(4, 9).mean, moved(5, 9).mean, "another Gaussian");
        assert_ne!(moved(4, 9).mean, moved(4, 10).mean, "another step");
    }
}
