// The sRGB transfer functions for nonnegative values; the power curve continues above 1. CPU reference:
// src/view/srgb.rs.
#define_import_path gs4d::srgb

// Converts linear light to sRGB-encoded values.
fn encode(linear: vec3<f32>) -> vec3<f32> {
    let curve = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * linear, linear <= vec3(0.0031308));
}

// Converts sRGB-encoded values to linear light.
fn decode(encoded: vec3<f32>) -> vec3<f32> {
    let curve = pow((encoded + 0.055) / 1.055, vec3(2.4));
    return select(curve, encoded / 12.92, encoded <= vec3(0.04045));
}
