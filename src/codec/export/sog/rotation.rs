//! Rotations as three bytes.
//!
//! In: a quaternion w, x, y, z of any length. Out: the texel with all components but the largest.

use std::f64::consts::FRAC_1_SQRT_2;

/// The alpha of a texel with a rotation whose first component, w, is left out.
const FIRST_LEFT_OUT: u8 = 252;

/// Returns the texel of a rotation.
pub(super) fn texel(rotation: [f32; 4]) -> [u8; 4] {
    let rotation = rotation.map(f64::from);
    let largest = (1..4).fold(0, |most, axis| if rotation[axis].abs() > rotation[most].abs() { axis } else { most });
    let length = rotation.iter().map(|component| component * component).sum::<f64>().sqrt().copysign(rotation[largest]);
    let code = |component: f64| ((component / length * FRAC_1_SQRT_2 + 0.5) * 255.0).round() as u8;
    let mut others = (0..4).filter(|&axis| axis != largest).map(|axis| code(rotation[axis]));
    let mut next = || others.next().unwrap_or_default();
    [next(), next(), next(), FIRST_LEFT_OUT + largest as u8]
}
