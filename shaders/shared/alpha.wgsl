// Alpha: how much of a splat a pixel takes, and the step that blends it. CPU reference: src/gaussian/alpha.rs.
#define_import_path gs4d::alpha

// A splat's alpha below this is skipped.
const ALPHA_MIN: f32 = 1.0 / 255.0;
// 1 / ALPHA_MIN.
const INVERSE_ALPHA_MIN: f32 = 255.0;
// Alpha is clamped to this from above.
const ALPHA_MAX: f32 = 0.99;
// A pixel stops before its transmittance would fall below this.
const TRANSMITTANCE_MIN: f32 = 1e-4;

// What one splat does to a pixel.
struct BlendStep {
    // alpha T; 0 where the splat is skipped, negative where the pixel stops before it.
    weight: f32,
    // Transmittance after it.
    transmittance: f32,
}

// One splat over a pixel that has this transmittance left; `d` leads from the pixel to the splat's centre.
fn blend_step(conic: vec3<f32>, opacity: f32, d: vec2<f32>, transmittance: f32) -> BlendStep {
    let power = -0.5 * (conic.x * d.x * d.x + conic.z * d.y * d.y) - conic.y * d.x * d.y;
    if power > 0.0 {
        return BlendStep(0.0, transmittance);
    }
    let alpha = min(ALPHA_MAX, opacity * exp(power));
    if alpha < ALPHA_MIN {
        return BlendStep(0.0, transmittance);
    }
    let left = transmittance * (1.0 - alpha);
    if left < TRANSMITTANCE_MIN {
        return BlendStep(-1.0, transmittance);
    }
    return BlendStep(alpha * transmittance, left);
}
