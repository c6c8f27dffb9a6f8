// Alpha: the opacity of a splat at a pixel, and the step that blends it. CPU reference: src/gaussian/alpha.rs.
#define_import_path gs4d::alpha

#import gs4d::conic::exponent_at

// A splat whose alpha at a pixel is below this is skipped there.
const ALPHA_MIN: f32 = 1.0 / 255.0;
// 1 / ALPHA_MIN.
const INVERSE_ALPHA_MIN: f32 = 255.0;
// Upper bound of alpha.
const ALPHA_MAX: f32 = 0.99;
// Blending of a pixel stops before the splat that would reduce its transmittance below this value.
const TRANSMITTANCE_MIN: f32 = 1e-4;

// The blending step, front to back, for a pixel with `transmittance`:
//
//     let alpha = alpha_at(..);                          if is_skipped(alpha), the splat is skipped,
//     let left = left_behind(transmittance, alpha);      if is_opaque(left), the pixel is finished without the splat,
//     color += alpha * transmittance * splat's color;    transmittance = left.
//
// These are separate functions because a single function that returns which of the three cases applies makes `blend` a
// seventh slower.

// Returns the alpha of a splat at a pixel; `conic` is factored, `offset` is the vector from the pixel to the splat's
// center, pixels.
fn alpha_at(conic: vec3<f32>, opacity: f32, offset: vec2<f32>) -> f32 {
    return min(ALPHA_MAX, opacity * exp(exponent_at(conic, offset)));
}

fn is_skipped(alpha: f32) -> bool {
    return alpha < ALPHA_MIN;
}

fn left_behind(transmittance: f32, alpha: f32) -> f32 {
    return transmittance * (1.0 - alpha);
}

fn is_opaque(left: f32) -> bool {
    return left < TRANSMITTANCE_MIN;
}
