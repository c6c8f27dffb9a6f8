// adam: one step of the Adam optimizer; each thread updates a four-vector.
// In: gradients summed over the views of a batch, moments, learning rates. Out: updated parameters and moments, gradients reset to zero. In
// sparse mode, Gaussians that are invisible in all views of the batch are unchanged. Values from `settings.values` on keep their value, but
// not their moments. CPU reference: src/offline/fine_tune/adam.rs.
#import gs4d::training::AdamUniforms

const DECAY_1: f32 = 0.9;
const DECAY_2: f32 = 0.999;
const EPSILON: f32 = 1e-15;
// The same value as in `project_backward`.
const FIRST_SEEN: u32 = 3u;

@group(0) @binding(0) var<uniform> settings: AdamUniforms;
@group(0) @binding(1) var<storage, read_write> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> gradients: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> first_moments: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> second_moments: array<vec4<f32>>;
// Written by `project_backward`: from FIRST_SEEN on, one word for each Gaussian: the number of views of the batch that show it.
@group(0) @binding(5) var<storage, read> notes: array<u32>;

// Each Gaussian has `stride` four-vectors. The first four have their own rates; all others use the last rate.
@compute @workgroup_size(256)
fn adam(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < settings.count * settings.stride; i += groups.x * 256u) {
        if settings.sparse == 0u || notes[FIRST_SEEN + settings.first + i / settings.stride] != 0u {
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
        }
        gradients[i] = vec4(0.0);
    }
}
