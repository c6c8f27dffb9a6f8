//! The melody of the example `sound`.
//!
//! In: a duration. Out: samples of a tone that rises note by note, with a knock at each second, two channels.

use std::f64::consts::TAU;

/// Frames a second.
pub const RATE: u32 = 48_000;
/// Notes a second.
const NOTES: f64 = 4.0;
/// The lowest note, Hz, and the steps of the melody above it.
const LOWEST: f64 = 220.0;
const STEPS: [f64; 8] = [0.0, 2.0, 4.0, 7.0, 9.0, 12.0, 14.0, 16.0];

/// Returns the samples of `seconds` seconds, interleaved.
pub fn samples(seconds: f64) -> Vec<i16> {
    let frames = (seconds * f64::from(RATE)) as u32;
    (0..frames).flat_map(|frame| sample(f64::from(frame) / f64::from(RATE))).collect()
}

/// Returns a frame: the melody moves from the left to the right.
fn sample(time: f64) -> [i16; 2] {
    let (note, since) = ((time * NOTES) as usize, (time * NOTES).fract() / NOTES);
    let hertz = LOWEST * (STEPS[note % STEPS.len()] / 12.0).exp2();
    let tone = 0.35 * (TAU * hertz * since).sin() * (-since * 6.0).exp() * (since * 400.0).min(1.0);
    let knock = 0.4 * (TAU * 90.0 * time.fract()).sin() * (-time.fract() * 40.0).exp();
    let right = 0.5 + 0.4 * (TAU * time / 4.0).sin();
    [1.0 - right, right].map(|side| (32_767.0 * (tone * side + knock)) as i16)
}
