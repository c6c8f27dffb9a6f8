//! Bands of brightness: a rolling shutter under light that flickers.
//!
//! In: small pictures of each camera. Out: a finding about cameras whose pictures have bands: the brightness of their
//! rows or columns, relative to the median over time, is mostly one wave. A rolling shutter that only bends what moves
//! fast is not found.

use super::evidence::{Evidence, LONGEST, Sample, Seen};
use super::finding::{Finding, Severity, Subject, listed};
use super::plane::median;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Least amplitude of the wave, 0 to 255, and its least share of the variance of the lines. Footage without bands has
/// at most 0.5, and half of that with a share of 0.5.
const AMPLITUDE: f32 = 1.0;
const SHARE: f32 = 0.4;
/// Longest period tried: the picture; shortest: so many to a picture.
const WAVES: usize = 40;
/// Fewest pictures of a median, and share of them that must have bands.
const FEWEST: usize = 5;
const OFTEN: f32 = 0.4;

/// Returns the finding about bands.
pub(super) fn shutter(evidence: &Evidence) -> Option<Finding> {
    let banded: Vec<&str> =
        evidence.cameras.par_iter().filter(|seen| has_bands(seen)).map(|seen| seen.name.as_str()).collect();
    (!banded.is_empty()).then(|| {
        let names = listed(&banded);
        let what = format!("Rolling shutter or flicker suspected: bands of brightness run through {names}.");
        let remedy = "Film by daylight or lamps that do not flicker, then with a short shutter; under other lamps with \
                      1/50 or 1/100 s (1/60 or 1/120 s where mains have 60 Hz), or with a global shutter.";
        Finding::new(Severity::Warning, Subject::Shutter, what, remedy).about(banded)
    })
}

/// Returns whether many pictures of a camera have bands along or across.
fn has_bands(seen: &Seen) -> bool {
    let samples: Vec<&Sample> = seen.shown().collect();
    let Some(first) = samples.first().filter(|_| samples.len() >= FEWEST) else { return false };
    let size = first.gray.size;
    if size.max_element() > LONGEST || samples.iter().any(|sample| sample.gray.size != size) {
        return false;
    }
    let middle = |index: usize| median(samples.iter().map(|sample| sample.gray.values[index]).collect());
    let plate: Vec<f32> = (0..first.gray.values.len()).map(|index| middle(index).unwrap_or(0.0)).collect();
    [false, true].into_iter().any(|is_column| {
        let count = samples.iter().filter(|sample| is_wave(&profile(sample, &plate, is_column))).count();
        count as f32 >= OFTEN * samples.len() as f32
    })
}

/// Returns the median difference from the plate, of each row or column: of what stands still.
fn profile(sample: &Sample, plate: &[f32], is_column: bool) -> Vec<f32> {
    let size = sample.gray.size;
    let (lines, length) = if is_column { (size.x, size.y) } else { (size.y, size.x) };
    let of_line = |line: u32| {
        let pixels = (0..length).map(|at| if is_column { (line, at) } else { (at, line) });
        let still = pixels.filter(|&(x, y)| sample.stands(x, y));
        let differences = still.map(|(x, y)| sample.gray.at(x, y) - plate[(y * size.x + x) as usize]);
        median(differences.collect()).unwrap_or(0.0)
    };
    (0..lines).map(of_line).collect()
}

/// Returns whether a profile is mostly one wave. Its mean and slope do not count.
fn is_wave(profile: &[f32]) -> bool {
    let count = profile.len() as f32;
    let place = |index: usize| index as f32 - (count - 1.0) / 2.0;
    let mean = profile.iter().sum::<f32>() / count.max(1.0);
    let square: f32 = (0..profile.len()).map(|index| place(index) * place(index)).sum();
    let slope = profile.iter().enumerate().map(|(index, value)| place(index) * value).sum::<f32>() / square.max(1.0);
    let rest: Vec<f32> = profile.iter().enumerate().map(|(index, value)| value - mean - slope * place(index)).collect();
    let variance = rest.iter().map(|value| value * value).sum::<f32>() / count.max(1.0);
    let amplitude = |wave: usize| {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (index, value) in rest.iter().enumerate() {
            let (sin, cos) = (TAU * wave as f32 * index as f32 / count).sin_cos();
            sine += value * sin;
            cosine += value * cos;
        }
        2.0 * f32::hypot(sine, cosine) / count
    };
    let greatest = (1..WAVES.min(profile.len() / 2)).map(amplitude).fold(0.0, f32::max);
    greatest >= AMPLITUDE && greatest * greatest / 2.0 >= SHARE * variance
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen, textured};
    use super::*;

    /// Returns the finding on a camera whose pictures have waves of this amplitude, at another phase at each moment.
    fn found(amplitude: f32) -> Option<Finding> {
        let picture = |moment: usize| {
            let mut picture = textured(1.0, 0.0, 1.0);
            for (_, y, pixel) in picture.enumerate_pixels_mut() {
                let wave = amplitude * (TAU * (3.0 * y as f32 / 120.0 + moment as f32 * 0.37)).sin();
                pixel.0 = pixel.0.map(|value| (f32::from(value) + wave).round().clamp(0.0, 255.0) as u8);
            }
            picture
        };
        shutter(&evidence(vec![seen(0, 4, (0..9).map(picture).collect())]))
    }

    #[test]
    fn bands_are_found_and_still_pictures_have_none() {
        assert_eq!(found(0.0), None, "no bands");
        let bands = found(6.0).expect("bands of six levels");
        assert_eq!(bands.cameras, ["cam0"], "the camera is named");
    }
}
