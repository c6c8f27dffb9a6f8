// rounding: replaces trained Gaussians by the values that a package stores of them, for the last steps of training.
// In: the records that `slice` wrote, the change that rounding makes to each. Out: the same records, rounded. CPU
// reference: src/scene/packed/rounding.rs.
#import gs4d::training::{RoundingRecord, TrainedScene}
#import gs4d::types::GaussianRecord
#import gs4d::trained::diagonal

@group(0) @binding(0) var<uniform> scene: TrainedScene;
@group(0) @binding(1) var<storage, read> roundings: array<RoundingRecord>;
@group(0) @binding(2) var<storage, read_write> gaussians: array<GaussianRecord>;
@group(0) @binding(3) var<storage, read_write> lifespans: array<vec2<f32>>;

@compute @workgroup_size(256)
fn rounding(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= scene.count {
        return;
    }
    let g = gaussians[id.x];
    let own = roundings[id.x];
    let mean = g.mean + own.mean;
    // A factor keeps an inverse_sigma_t of 0 (a Gaussian that is present at every time) at 0, and every other
    // inverse_sigma_t positive.
    let velocity = vec4(g.velocity.xyz + own.velocity.xyz, g.velocity.w * own.velocity.w);
    let a = g.covariance_a;
    let b = g.covariance_b;
    let raised = mat3x3(a.xyz, vec3(a.y, a.w, b.x), vec3(a.z, b.x, b.y)) + diagonal(vec3(own.shape_x.w));
    let shape = mat3x3(own.shape_x.xyz, own.shape_y.xyz, own.shape_z.xyz);
    let covariance = shape * raised * transpose(shape);
    let opacity = clamp(b.z + own.shape_y.w, 0.0, 1.0);
    gaussians[id.x] = GaussianRecord(
        mean,
        velocity,
        vec4(covariance[0], covariance[1].y),
        vec4(covariance[1].z, covariance[2].z, opacity, 0.0),
    );
    lifespans[id.x] = vec2(mean.w, velocity.w);
}
