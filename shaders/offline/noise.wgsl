// noise: moves the means of faint Gaussians at random, in space and time, after a step of training.
// In: raw parameters of native 4D Gaussians, the seed of the step, the least temporal scale. Out: the same parameters
// with other means, and no smaller temporal scale. CPU reference: src/offline/train/reference/noise.rs.
#import gs4d::training::{NoiseUniforms, TrainedRecord}
#import gs4d::random::{mixed, word_of}
#import gs4d::trained::{left_matrix, opacity_of, right_matrix}

const TAU: f32 = 6.2831853;
// Opacity of half the noise, and how fast the noise falls above it.
const FAINT: f32 = 0.005;
const SLOPE: f32 = 100.0;
// Largest deviation of the noise of a fully transparent Gaussian along each axis, in scales.
const LARGEST = vec4<f32>(1.0, 1.0, 1.0, 0.1);

@group(0) @binding(0) var<uniform> settings: NoiseUniforms;
@group(0) @binding(1) var<storage, read_write> trained: array<TrainedRecord>;

// Returns a number above 0, at most 1.
fn unit(word: u32) -> f32 {
    return f32((word >> 8u) + 1u) / 16777216.0;
}

// Returns four independent numbers of the standard normal distribution.
fn normals(index: u32) -> vec4<f32> {
    let a = word_of(index, settings.seed);
    let b = mixed(a + 0x9e3779b9u);
    let c = mixed(b + 0x9e3779b9u);
    let d = mixed(c + 0x9e3779b9u);
    let first = sqrt(-2.0 * log(unit(a)));
    let second = sqrt(-2.0 * log(unit(c)));
    let angles = TAU * vec2(unit(b), unit(d));
    return vec4(first * cos(angles.x), first * sin(angles.x), second * cos(angles.y), second * sin(angles.y));
}

@compute @workgroup_size(256)
fn noise(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= settings.count {
        return;
    }
    let raw = trained[index];
    let faint = 1.0 / (1.0 + exp(SLOPE * (opacity_of(raw.opacity_logit.x) - FAINT)));
    let scale = exp(raw.log_scale);
    let factors = faint * min(settings.strength * scale, LARGEST);
    let rotation = left_matrix(normalize(raw.rotation_l)) * right_matrix(normalize(raw.rotation_r));
    trained[index].mean = raw.mean + rotation * (factors * scale * normals(index));
    trained[index].log_scale.w = max(raw.log_scale.w, settings.least_log_scale_t);
}
