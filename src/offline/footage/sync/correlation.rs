//! The delay between two recordings of the same sound.
//!
//! In: the samples of two tracks, [`RATE`] a second. Out: how much later the second has the sound, with a confidence.
//! The generalized cross-correlation with phase transform (GCC-PHAT): each frequency counts the same, so that the peak
//! is narrow whatever the sound, and echoes give peaks of their own instead of a wider one.

use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use std::ops::RangeInclusive;

/// Samples a second of tracks.
pub(crate) const RATE: u32 = 16_000;
/// Frequencies that are compared, hertz: below are wind and hum, above is what encoders cut.
const BAND: RangeInclusive<f64> = 100.0..=7000.0;
/// Distance around the peak within which another is no other delay, samples: 5 ms.
const AROUND: usize = RATE as usize / 200;
/// Shortest track, samples: half a second.
const SHORTEST: usize = RATE as usize / 2;
/// Share of the mean magnitude below which a frequency is silent.
const SILENT: f64 = 1e-6;

/// A delay between two tracks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Delay {
    /// Time of a sound in the second track, less its time in the first.
    pub seconds: f64,
    /// The peak as a multiple of the next at another delay: tracks of different sounds have 1.0 to 1.3.
    pub confidence: f64,
}

/// Returns the delay of track `b` against `a`, of at most `longest` seconds; `None` of short or silent tracks.
pub(crate) fn delay(a: &[f32], b: &[f32], longest: f64) -> Option<Delay> {
    let (shorter, longer) = (a.len().min(b.len()), a.len().max(b.len()));
    let reach = ((longest * f64::from(RATE)) as usize).min(longer);
    if shorter < SHORTEST || reach <= 2 * AROUND {
        return None;
    }
    // With so many zeros, no delay within reach wraps around.
    let length = fast_length(longer + reach);
    let mut planner = RealFftPlanner::<f32>::new();
    let forward = planner.plan_fft_forward(length);
    let [a, b] = [a, b].map(|track| spectrum(track, &*forward));
    let mut phases = phases(&a?, &b?, f64::from(RATE) / length as f64)?;
    let backward = planner.plan_fft_inverse(length);
    let mut correlation = backward.make_output_vec();
    backward.process(&mut phases, &mut correlation).ok()?;
    // Negative delays are at the end. From here on, the delay at index `reach` is 0.
    let correlation = [&correlation[length - reach..], &correlation[..=reach]].concat();
    peak(&correlation, reach)
}

/// Returns a length, at least so much, of which the transform is fast.
fn fast_length(least: usize) -> usize {
    let of = |factor: usize| factor * least.div_ceil(factor).next_power_of_two();
    of(1).min(of(3)).min(of(5))
}

/// Returns the spectrum of a track with zeros after it.
fn spectrum(track: &[f32], forward: &dyn RealToComplex<f32>) -> Option<Vec<Complex<f32>>> {
    let mut padded = forward.make_input_vec();
    padded[..track.len()].copy_from_slice(track);
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut padded, &mut spectrum).ok()?;
    Some(spectrum)
}

/// Returns the differences of phases, of magnitude 1 inside the band; `None` of silent tracks. `width` is that of a
/// frequency, hertz.
fn phases(a: &[Complex<f32>], b: &[Complex<f32>], width: f64) -> Option<Vec<Complex<f32>>> {
    let mut cross: Vec<Complex<f32>> = a.iter().zip(b).map(|(a, b)| a.conj() * b).collect();
    for (index, value) in cross.iter_mut().enumerate() {
        if !BAND.contains(&(index as f64 * width)) {
            *value = Complex::new(0.0, 0.0);
        }
    }
    let mean = cross.iter().map(|value| f64::from(value.norm())).sum::<f64>() / cross.len() as f64;
    let floor = (mean * SILENT) as f32;
    if !floor.is_normal() {
        return None;
    }
    cross.iter_mut().for_each(|value| *value /= value.norm().max(floor));
    Some(cross)
}

/// Returns the delay at the peak, which may be negative if a microphone is the other way round. `zero` is the index of
/// no delay.
fn peak(correlation: &[f32], zero: usize) -> Option<Delay> {
    let top = highest(correlation, 0..correlation.len())?;
    let elsewhere = (0..correlation.len()).filter(|index| index.abs_diff(top) > AROUND);
    let second = correlation[highest(correlation, elsewhere)?].abs().max(f32::MIN_POSITIVE);
    let confidence = f64::from(correlation[top].abs() / second);
    // A peak at the end has no sides: the sound may be further away.
    let sides = [top.checked_sub(1)?, top, top + 1].map(|index| correlation.get(index).copied().map(f64::from));
    let [before, at, after] = [sides[0]?, sides[1]?, sides[2]?];
    let bend = before - 2.0 * at + after;
    let part = if bend == 0.0 { 0.0 } else { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) };
    let samples = top as f64 - zero as f64 + part;
    Some(Delay { seconds: samples / f64::from(RATE), confidence })
}

/// Returns the index of the largest magnitude among these.
fn highest(correlation: &[f32], indices: impl Iterator<Item = usize>) -> Option<usize> {
    indices.max_by(|a, b| correlation[*a].abs().total_cmp(&correlation[*b].abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    fn noise(seed: u64, count: usize) -> Vec<f32> {
        let mut random = Random::new(seed);
        (0..count).map(|_| random.in_range(-1.0, 1.0)).collect()
    }

    /// Returns a recording from a sample on: with an echo of half, noise 10 dB below, and this gain.
    fn recorded(sound: &[f32], start: usize, echo: usize, gain: f32) -> Vec<f32> {
        let noise = noise(start as u64, 32_000);
        let sample = |at: usize| (sound[start + at] + 0.5 * sound[start + at - echo] + 0.35 * noise[at]) * gain;
        (0..32_000).map(sample).collect()
    }

    #[test]
    fn the_delay_is_found_among_echoes_and_noise() {
        let sound = noise(1, 48_000);
        let first = recorded(&sound, 6000, 1500, 0.1);
        for (start, gain) in [(4766, 0.01), (4766, -1.0), (8000, 0.5)] {
            let found = delay(&first, &recorded(&sound, start, 400, gain), 1.5).expect("sounds");
            // A camera that starts earlier has everything later in its track.
            let truth = (6000.0 - start as f64) / f64::from(RATE);
            assert!((found.seconds - truth).abs() < 5e-5, "{found:?}, not {truth}");
            assert!(found.confidence > 1.5, "{found:?}");
        }
    }

    #[test]
    fn parts_of_a_sample_are_told() {
        // The mean of two samples is the sound at half a sample later.
        let sound = noise(2, 40_000);
        let late: Vec<f32> = (0..32_000).map(|at| f32::midpoint(sound[at + 99], sound[at + 100])).collect();
        let found = delay(&sound[100..32_100], &late, 1.0).expect("sounds");
        assert!((found.seconds * f64::from(RATE) - 0.5).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn different_sounds_have_no_confidence() {
        let found = delay(&noise(3, 32_000), &noise(4, 32_000), 1.0).expect("sounds");
        assert!(found.confidence < 1.5, "{found:?}");
        assert_eq!(delay(&noise(3, 32_000), &[0.0; 32_000], 1.0), None, "silence");
        assert_eq!(delay(&noise(3, 100), &noise(3, 100), 1.0), None, "too short");
    }
}
