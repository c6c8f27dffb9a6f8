// regularize: the terms of the loss that depend on Gaussians alone: motion, difference of motion from neighbors
// (rigidity), opacity, scale.
// In: raw parameters of one part, their slice, the neighbors of each Gaussian. Out: the gradients of the terms with
// respect to the raw parameters, added to the gradients of the batch. CPU reference:
// src/offline/train/reference/terms.rs, which defines the terms.
#import gs4d::training::{TrainedRecord, TrainedScene}
#import gs4d::types::GaussianRecord
#import gs4d::trained::{opacity_of, slice_of, ROTATED_4D}
#import gs4d::slice_backward::{is_finite_slice, through_slice}

// Neighbors of each Gaussian, including itself.
const NEIGHBORS: u32 = 20u;
// A shorter vector counts as zero: its square underflows.
const LEAST_LENGTH: f32 = 1e-15;

// The weights of the terms for each Gaussian. Mirror: src/offline/train/parts/regularizer.rs.
struct TermWeights {
    // Weight of the length of its velocity.
    motion: f32,
    // Weight of the length of the difference between its velocity and the velocity of a neighbor at the same position.
    rigid: f32,
    // Weight of its opacity.
    opacity: f32,
    // Weight of each of its spatial scales.
    scale: f32,
    // The weight of a neighbor is exp(-falloff distance).
    falloff: f32,
}

@group(0) @binding(0) var<uniform> scene: TrainedScene;
@group(0) @binding(1) var<uniform> weights: TermWeights;
@group(0) @binding(2) var<storage, read> trained: array<TrainedRecord>;
@group(0) @binding(3) var<storage, read> gaussians: array<GaussianRecord>;
// NEIGHBORS indices for each Gaussian. Read only if the rigid term has a weight, which is possible only with a single
// part.
@group(0) @binding(4) var<storage, read> neighbors: array<u32>;
@group(0) @binding(5) var<storage, read_write> trained_gradients: array<TrainedRecord>;

// Returns the derivative of the length of a vector, 0 at 0.
fn slope_of_length(v: vec3<f32>) -> vec3<f32> {
    let far = length(v);
    if far < LEAST_LENGTH {
        return vec3(0.0);
    }
    return v / far;
}

@compute @workgroup_size(64)
fn regularize(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * groups.x * 64u + id.x;
    if index >= scene.count {
        return;
    }
    let raw = trained[index];
    let opacity = opacity_of(raw.opacity_logit.x);
    trained_gradients[index].opacity_logit.x += weights.opacity * opacity * (1.0 - opacity);
    if weights.scale > 0.0 {
        let slope = weights.scale * exp(raw.log_scale.xyz);
        trained_gradients[index].log_scale += vec4(slope, 0.0);
    }
    // Gaussians of the other models are at rest.
    if scene.model != ROTATED_4D {
        return;
    }
    let own = gaussians[index];
    var by_velocity = weights.motion * slope_of_length(own.velocity.xyz);
    if weights.rigid > 0.0 {
        for (var i = NEIGHBORS * index; i < NEIGHBORS * (index + 1u); i++) {
            let other = gaussians[neighbors[i]];
            let near = exp(-weights.falloff * distance(own.mean.xyz, other.mean.xyz));
            by_velocity += weights.rigid * near * slope_of_length(own.velocity.xyz - other.velocity.xyz);
        }
    }
    let sliced = slice_of(raw, scene.model);
    let shape = through_slice(raw, scene.model, sliced, mat3x3<f32>(), by_velocity, 0.0);
    // As in `project_backward`, gradients that are not finite are left out.
    if is_finite_slice(shape) {
        let before = trained_gradients[index];
        trained_gradients[index] = TrainedRecord(
            before.mean,
            before.log_scale + shape.log_scale,
            before.rotation_l + shape.rotation_l,
            before.rotation_r + shape.rotation_r,
            before.opacity_logit,
        );
    }
}
