// codebooks: color coefficients that are sums of entries of codebooks, in training.
// In: the entries of each Gaussian; for `collect` the gradients of the coefficients, for `expand` the entries. Out: the gradients of the
// entries, each summed over its Gaussians in a fixed order; the coefficients. The first coefficient of each Gaussian is its own.
// CPU reference: `CodedColors::rest` of src/scene/packed/colors.rs.
#import gs4d::types::TiedColors

@group(0) @binding(0) var<uniform> tied: TiedColors;
// Entries of each Gaussian, one for each codebook.
@group(0) @binding(1) var<storage, read> codes: array<u32>;
// First member of each entry, and the end; the members: Gaussians.
@group(0) @binding(2) var<storage, read> firsts: array<u32>;
@group(0) @binding(3) var<storage, read> members: array<u32>;
@group(0) @binding(4) var<storage, read> entries: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> coefficients: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> coefficient_gradients: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> entry_gradients: array<vec4<f32>>;

// Which values of a four-vector are of codebooks.
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
