//! The ranges in which the values of a picture may lie.
//!
//! In: a frame of the CPU reference, and the scene. Out: [`Ranges`]: the values of the frame, or the ranges of frames
//! of the scene with all of its numbers rounded differently. A picture that changes as much by rounding as by the
//! renderer shows no defect of the renderer.

use crate::limits::sliced;
use crate::support::random::Random;
use bevy_gs4d::reference;
use bevy_gs4d::scene::{Form, RuntimeScene};
use bevy_gs4d::view::{Background, Frame, View};

/// The largest relative change of a number: eight units in the last place of a float of the smallest mantissa.
const ROUNDING: f32 = 1e-6;
/// Frames of a range, beside the frame itself.
const FRAMES: u64 = 8;
/// Depths may differ by this factor more than colors, as in `tests/gpu/render.rs`.
const DEPTH: f32 = 5.0;

/// Color, transmittance and depth of a pixel.
type Values = [f32; 5];

/// The ranges of every pixel.
pub struct Ranges {
    low: Vec<Values>,
    high: Vec<Values>,
    /// The brightest color that the scene can show, at least 1: a transmittance that differs by 0.001 changes a color
    /// by this part of it.
    brightest: f32,
}

impl Ranges {
    /// Returns the values of a frame as ranges; no color of the scene is brighter than `brightest`.
    pub fn exact(frame: &Frame, brightest: f32) -> Self {
        let low = values(frame);
        Self { high: low.clone(), low, brightest: brightest.max(1.0) }
    }

    /// Returns the ranges of the frames of a scene whose numbers are rounded differently; `self` has the values of one
    /// of these.
    pub fn rounded(mut self, scene: &RuntimeScene, view: &View, background: Background) -> Self {
        for seed in 0..FRAMES {
            let frame = reference::render(&rounded(scene, seed), view, background);
            let pixels = self.low.iter_mut().zip(&mut self.high).zip(values(&frame));
            for ((low, high), found) in pixels {
                for (at, found) in found.into_iter().enumerate() {
                    low[at] = low[at].min(found);
                    high[at] = high[at].max(found);
                }
            }
        }
        self
    }

    /// Returns the number of pixels.
    pub fn len(&self) -> usize {
        self.low.len()
    }

    /// Returns the distance of the values of a pixel from its ranges, beyond the width of the ranges again: the
    /// largest, relative to the larger of 1 and the value, for colors to the brightest color of the scene.
    pub fn distance(&self, found: &Frame, pixel: usize) -> f32 {
        let (low, high, found) = (self.low[pixel], self.high[pixel], values_of(found, pixel));
        let one = |at: usize| {
            let (low, high, found) = (low[at], high[at], found[at]);
            let width = high - low;
            let outside = (low - found).max(found - high) - width;
            let least = if at < 3 { self.brightest } else { 1.0 };
            let relative = outside.max(0.0) / low.abs().max(high.abs()).max(found.abs()).max(least);
            if at == 4 { relative / DEPTH } else { relative }
        };
        (0..5).map(one).fold(0.0, f32::max)
    }

    /// Returns the ranges of a pixel, in words.
    pub fn described(&self, pixel: usize) -> String {
        let (low, high) = (self.low[pixel], self.high[pixel]);
        if low == high { format!("{low:?}") } else { format!("{low:?} to {high:?}") }
    }
}

/// Returns color, transmittance and depth of a pixel.
pub fn values_of(frame: &Frame, pixel: usize) -> Values {
    let [r, g, b] = frame.picture.pixels[pixel].to_array();
    [r, g, b, frame.transmittance[pixel], frame.depth[pixel]]
}

fn values(frame: &Frame) -> Vec<Values> {
    (0..frame.transmittance.len()).map(|pixel| values_of(frame, pixel)).collect()
}

/// Returns a scene in single precision, with every number of a Gaussian and its color changed by a part of
/// [`ROUNDING`].
fn rounded(scene: &RuntimeScene, seed: u64) -> RuntimeScene {
    let mut random = Random::new(seed);
    let mut change = |value: &mut f32| *value *= 1.0 + (random.below(2001) as f32 - 1000.0) * 1e-3 * ROUNDING;
    let mut sliced = sliced(scene).into_owned();
    for gaussian in &mut sliced.gaussians {
        gaussian.mean.iter_mut().for_each(&mut change);
        gaussian.velocity.iter_mut().for_each(&mut change);
        gaussian.covariance.iter_mut().for_each(&mut change);
        [&mut gaussian.mean_t, &mut gaussian.sigma_t, &mut gaussian.opacity].into_iter().for_each(&mut change);
    }
    sliced.harmonics.values.iter_mut().for_each(&mut change);
    RuntimeScene { form: Form::Sliced(sliced), ..scene.clone() }
}
