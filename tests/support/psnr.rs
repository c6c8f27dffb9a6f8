//! The difference of two frames.
//!
//! In: frames of the same size. Out: their PSNR.

use bevy_gs4d::view::Frame;
use glam::Vec3;

/// Returns the PSNR of the colors of two frames, clamped to 0 to 1, in dB.
pub fn psnr(a: &Frame, b: &Frame) -> f64 {
    let colors = |frame: &Frame| -> Vec<f32> {
        frame.picture.pixels.iter().flat_map(|pixel| pixel.clamp(Vec3::ZERO, Vec3::ONE).to_array()).collect()
    };
    let (a, b) = (colors(a), colors(b));
    let squares: f64 = a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    10.0 * (a.len() as f64 / squares.max(1e-30)).log10()
}
