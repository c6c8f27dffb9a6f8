// environment_backward: the gradient of a loss with respect to the texels of the environment map.
// In: the frame, the transmittance that `blend` wrote, the gradient of the loss with respect to each pixel. Out:
// `scatter` adds, for each value of the map, transmittance times bilinear weight times gradient over the pixels in
// front of it, as multiples of 1 / STEPS, so that sums do not depend on their order; `gather` adds these sums to the
// gradients of the batch and sets them to zero. CPU reference: src/offline/train/reference/environment_backward.rs.
#import gs4d::types::FrameUniforms
#import gs4d::environment::{bilinear_weight, environment_behind}

// The gradients of a batch have a sum of at most a few units: 32 bits hold eight.
const STEPS: f32 = 268435456.0;

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
// The color that `blend` wrote, and the transmittance.
@group(0) @binding(1) var color: texture_2d<f32>;
// Gradient with respect to red, green, blue and opacity of each pixel.
@group(0) @binding(2) var<storage, read> pixel_gradients: array<vec4<f32>>;
// Planar, as the map: 3 x height x width.
@group(0) @binding(3) var<storage, read_write> sums: array<atomic<i32>>;
@group(0) @binding(4) var<storage, read_write> gradients: array<f32>;

@compute @workgroup_size(16, 16)
fn scatter(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.xy;
    if !all(pixel < frame.size) {
        return;
    }
    let gradient = pixel_gradients[pixel.y * frame.size.x + pixel.x].xyz * textureLoad(color, pixel, 0).w;
    let size = frame.environment_size;
    let plane = size.x * size.y;
    let at = environment_behind(
        vec2<f32>(pixel), frame.size, frame.projection, frame.world_x, frame.world_y, frame.world_z, size
    );
    for (var i = 0u; i < 4u; i++) {
        let texel = floor(at) + vec2(f32(i & 1u), f32(i >> 1u));
        if any(texel < vec2(0.0)) || any(texel >= vec2<f32>(size)) {
            continue;
        }
        let share = vec3<i32>(round(gradient * bilinear_weight(at, texel) * STEPS));
        let index = u32(texel.y) * size.x + u32(texel.x);
        for (var channel = 0u; channel < 3u; channel++) {
            if share[channel] != 0 {
                atomicAdd(&sums[channel * plane + index], share[channel]);
            }
        }
    }
}

@compute @workgroup_size(256)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < arrayLength(&sums); i += groups.x * 256u) {
        gradients[i] += f32(atomicExchange(&sums[i], 0)) / STEPS;
    }
}
