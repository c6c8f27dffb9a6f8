// standing: brings Gaussians that live much longer than the time interval to rest, after a step of training.
// In: raw parameters of native 4D Gaussians and colors of one part, the times of what stands. Out: the same; Gaussians
// whose temporal scale is at least the least one are at rest, at the place that they had in the middle of the interval,
// with the other two times, and with no color that depends on time. CPU reference:
// src/offline/train/reference/standing.rs.
#import gs4d::training::{TrainedRecord, TrainedScene}
#import gs4d::trained::{slice_of, ROTATED_4D}

// Four-vectors of a color that do not depend on time: those of 16 coefficients.
const WITHOUT_TIME: u32 = 12u;

// The times of what stands, and the size of a color. Mirror: src/offline/train/parts/standing.rs.
struct StandingUniforms {
    // Temporal mean of what stands.
    middle: f32,
    // Least temporal scale of a Gaussian that is brought to rest.
    least_scale_t: f32,
    // Logarithm of the temporal scale of what stands.
    log_scale_t: f32,
    // Four-vectors of the color of each Gaussian.
    stride: u32,
}

@group(0) @binding(0) var<uniform> scene: TrainedScene;
@group(0) @binding(1) var<uniform> times: StandingUniforms;
@group(0) @binding(2) var<storage, read_write> trained: array<TrainedRecord>;
@group(0) @binding(3) var<storage, read_write> colors: array<vec4<f32>>;

@compute @workgroup_size(256)
fn standing(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= scene.count {
        return;
    }
    let raw = trained[index];
    let left = normalize(raw.rotation_l);
    let right = normalize(raw.rotation_r);
    let cosine = dot(left, right);
    let lives_long = exp(raw.log_scale.w) * abs(cosine) >= times.least_scale_t;
    if !lives_long {
        return;
    }
    let sliced = slice_of(raw, ROTATED_4D);
    let place = raw.mean.xyz + sliced.c / sliced.v * (times.middle - raw.mean.w);
    let rotation = normalize(left + select(-right, right, cosine >= 0.0));
    trained[index] = TrainedRecord(
        vec4(place, times.middle),
        vec4(raw.log_scale.xyz, times.log_scale_t),
        rotation,
        rotation,
        raw.opacity_logit,
    );
    for (var value = WITHOUT_TIME; value < times.stride; value++) {
        colors[index * times.stride + value] = vec4(0.0);
    }
}
