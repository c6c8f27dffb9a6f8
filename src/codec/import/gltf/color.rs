//! Conversion of linear colors to the sRGB-encoded colors that are blended.
//!
//! In: harmonics of linear Rec. 709 colors. Out: harmonics of sRGB-encoded colors. The mean color of a Gaussian is
//! exact; the view-dependent part is scaled by the slope of the encoding at that color, which is exact to first order.

use crate::codec::import::columns::SH_C0;
use crate::gaussian::Harmonics;
use crate::view::srgb;
use glam::Vec3;

/// The linear value at which the encoding changes from a line to a power.
const LINE: f32 = 0.003_130_8;

/// Encodes colors.
pub(super) fn encode(harmonics: &mut Harmonics) {
    let stride = harmonics.coefficients * 3;
    if stride == 0 {
        return;
    }
    for values in harmonics.values.chunks_exact_mut(stride) {
        for channel in 0..3 {
            let (color, slope) = encoded(0.5 + SH_C0 * values[channel]);
            for value in values[channel..].iter_mut().step_by(3) {
                *value *= slope;
            }
            values[channel] = (color - 0.5) / SH_C0;
        }
    }
}

/// Returns the sRGB encoding of linear light, and its slope.
fn encoded(linear: f32) -> (f32, f32) {
    let slope = if linear <= LINE { 12.92 } else { 1.055 / 2.4 * linear.powf(1.0 / 2.4 - 1.0) };
    (srgb::encode(Vec3::splat(linear)).x, slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::columns::coefficient;

    #[test]
    fn view_dependent_colors_are_encoded_to_first_order() {
        let linear = [0.001, 0.2140, 0.8];
        let mut harmonics = Harmonics { coefficients: 4, degree: 1, degree_t: 0, values: vec![0.0; 12] };
        for (channel, linear) in linear.into_iter().enumerate() {
            harmonics.values[channel] = coefficient(linear);
            harmonics.values[3 + channel] = 0.0005;
        }
        let before = harmonics.clone();
        encode(&mut harmonics);
        for direction in [Vec3::Y, Vec3::X, Vec3::NEG_Y] {
            let expected = before.color(0, direction, 0.0, 1.0).map(|linear| encoded(linear).0);
            let found = harmonics.color(0, direction, 0.0, 1.0);
            assert!(found.abs_diff_eq(expected, 1e-5), "{found}, not {expected}, toward {direction}");
        }
        assert!((encoded(0.2140).0 - 0.5).abs() < 1e-3, "21.4 % of linear light is the middle of sRGB");
    }
}
