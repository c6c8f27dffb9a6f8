// adam: one step of the Adam optimizer; each thread updates a four-vector.
// In: gradients summed over the views of a batch, moments, learning rates. Out: updated parameters and moments,
// gradients reset to zero. Values from `settings.values` on keep their value, but not their moments. CPU reference:
// src/offline/train/reference/adam.rs.
#import gs4d::training::AdamUniforms

const DECAY_1: f32 = 0.9;
const DECAY_2: f32 = 0.999;
const EPSILON: f32 = 1e-15;

@group(0) @binding(0) var<uniform> settings: AdamUniforms;
@group(0) @binding(1) var<storage, read_write> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> gradients: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> first_moments: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> second_moments: array<vec4<f32>>;

// Each Gaussian has `stride` four-vectors. The first four have their own rates; all others use the last rate.
@compute @workgroup_size(256)
fn adam(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < settings.count * settings.stride; i += groups.x * 256u) {
        let gradient = gradients[i];
        let first = DECAY_1 * first_moments[i] + (1.0 - DECAY_1) * gradient;
        let second = DECAY_2 * second_moments[i] + (1.0 - DECAY_2) * gradient * gradient;
        let place = i % settings.stride;
        let is_updated = vec4(0u, 1u, 2u, 3u) + 4u * place < vec4(settings.values);
        let rate = select(vec4(0.0), settings.rates[min(place, 4u)], is_updated);
        let scaled = sqrt(second) * settings.correction.y + EPSILON;
        values[i] -= rate * settings.correction.x * first / scaled;
        first_moments[i] = first;
        second_moments[i] = second;
        gradients[i] = vec4(0.0);
    }
}
