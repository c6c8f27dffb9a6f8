// codebooks: training of color coefficients that are sums of codebook entries.
// In: the codes of each Gaussian. `collect` reads the gradients of the coefficients and writes the gradients of the
// entries, each summed over its Gaussians in a fixed order. `expand` reads the entries and writes the coefficients. The
// DC coefficient of each Gaussian is not in the codebooks. CPU reference: `CodedColors::rest` of
// src/scene/packed/colors.rs.
#import gs4d::training::TiedColors

@group(0) @binding(0) var<uniform> tied: TiedColors;
// Codes of each Gaussian: the index of its entry in each codebook.
@group(0) @binding(1) var<storage, read> codes: array<u32>;
// Index of the first member of each entry, then the number of all members.
@group(0) @binding(2) var<storage, read> firsts: array<u32>;
// Gaussians that use each entry.
@group(0) @binding(3) var<storage, read> members: array<u32>;
@group(0) @binding(4) var<storage, read> entries: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> coefficients: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> coefficient_gradients: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> entry_gradients: array<vec4<f32>>;

// Returns 1 for the components of a four-vector that come from the codebooks, 0 for the others.
fn shared_values(place: u32) -> vec4<f32> {
    return select(vec4(1.0), vec4(0.0, 0.0, 0.0, 1.0), place == 0u);
}

@compute @workgroup_size(64)
fn collect(@builtin(workgroup_id) entry: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    for (var place = thread; place < tied.stride; place += 64u) {
        var sum = vec4(0.0);
        for (var i = firsts[entry.x]; i < firsts[entry.x + 1u]; i++) {
            sum += coefficient_gradients[members[i] * tied.stride + place];
        }
        entry_gradients[entry.x * tied.stride + place] = sum * shared_values(place);
    }
}

@compute @workgroup_size(256)
fn expand(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < tied.count * tied.stride; i += groups.x * 256u) {
        let place = i % tied.stride;
        var sum = vec4(0.0);
        for (var stage = 0u; stage < tied.stages; stage++) {
            sum += entries[codes[i / tied.stride * tied.stages + stage] * tied.stride + place];
        }
        coefficients[i] = select(coefficients[i], sum, shared_values(place) == vec4(1.0));
    }
}
