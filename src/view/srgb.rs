//! The sRGB transfer functions: between sRGB-encoded values, the space captures are trained in, and linear light.
//!
//! In and out: colors with values of 0 and above. The same curve as `shaders/shared/srgb.wgsl`.

use glam::Vec3;

/// Converts linear light to sRGB-encoded values; the power curve continues above 1.
pub fn encode(linear: Vec3) -> Vec3 {
    linear.map(|x| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 })
}

/// Converts sRGB-encoded values to linear light: the inverse of [`encode`].
pub fn decode(encoded: Vec3) -> Vec3 {
    encoded.map(|x| if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) })
}
