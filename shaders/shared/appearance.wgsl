// The appearance of a placed capture: light and debug colors. CPU reference of the light: src/view/appearance.rs.
#define_import_path gs4d::appearance

#import gs4d::srgb::{decode, encode}
#import gs4d::types::{LIGHTING_AS_TRAINED, LIGHTING_ENCODED}

// The largest color: the largest half-precision number, as in src/gaussian/harmonics.rs.
const BRIGHTEST: f32 = 65504.0;

// Returns a trained color with the light applied, in the blend space.
fn lit(color: vec3<f32>, lighting: u32, light: vec3<f32>) -> vec3<f32> {
    if lighting == LIGHTING_AS_TRAINED {
        return color;
    }
    let linear = decode(max(color, vec3(0.0))) * light;
    if lighting == LIGHTING_ENCODED {
        return encode(linear);
    }
    return linear;
}

// Returns a color for a value from 0 to 1: black, blue, green, yellow, red.
fn heat(value: f32) -> vec3<f32> {
    let x = clamp(value, 0.0, 1.0) * 4.0;
    return clamp(vec3(x - 2.0, min(x - 1.0, 4.0 - x), min(x, 2.0 - x)), vec3(0.0), vec3(1.0));
}
