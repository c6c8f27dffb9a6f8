// exposure: corrects the color of a picture by the exposure of its camera, before the loss.
// In: color over the background and transmittance, the exposures of all cameras. Out: `expose` writes the corrected
// picture, which `loss` reads. `backward` turns the gradients with respect to the corrected picture into those with
// respect to the drawn one, and writes sums for each tile; `gather` adds these sums, and the gradient of the pull to
// the identity, to the gradients of the exposure. `center` moves all exposures alike, so that their mean is the
// identity. CPU reference: src/offline/train/reference/exposure.rs.
#import gs4d::training::ExposureUniforms

const SIDE: u32 = 16u;
// Rows of an exposure: factors on red, green and blue, and the offset of an opaque pixel.
const ROWS: u32 = 3u;

@group(0) @binding(0) var<uniform> settings: ExposureUniforms;
// The color that `blend` wrote, with the background, and the transmittance.
@group(0) @binding(1) var color: texture_2d<f32>;
// The same, corrected.
@group(0) @binding(2) var exposed: texture_storage_2d<rgba32float, write>;
// ROWS for each camera.
@group(0) @binding(3) var<storage, read> exposures: array<vec4<f32>>;
// Gradient with respect to red, green, blue and opacity of each pixel.
@group(0) @binding(4) var<storage, read_write> pixel_gradients: array<vec4<f32>>;
// ROWS for each tile.
@group(0) @binding(5) var<storage, read_write> tile_sums: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> gradients: array<vec4<f32>>;
// The exposures of all cameras, for `center`.
@group(1) @binding(0) var<storage, read_write> every: array<vec4<f32>>;

var<workgroup> sums: array<vec4<f32>, 256>;

fn row(i: u32) -> vec4<f32> {
    return exposures[ROWS * settings.camera + i];
}

fn identity(i: u32) -> vec4<f32> {
    return vec4<f32>(vec4(0u, 1u, 2u, 3u) == vec4(i));
}

// Returns the color of the scene without the background, and its opacity.
fn of_scene(drawn: vec4<f32>) -> vec4<f32> {
    let left = settings.background.w * drawn.w;
    return vec4(drawn.xyz - left * settings.background.xyz, 1.0 - left);
}

@compute @workgroup_size(16, 16)
fn expose(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.xy;
    if !all(pixel < settings.size) {
        return;
    }
    let drawn = textureLoad(color, pixel, 0);
    let own = of_scene(drawn);
    let corrected = vec3(dot(row(0u), own), dot(row(1u), own), dot(row(2u), own));
    textureStore(exposed, pixel, vec4(corrected + drawn.xyz - own.xyz, drawn.w));
}

@compute @workgroup_size(256)
fn backward(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let pixel = tile.xy * SIDE + vec2(thread % SIDE, thread / SIDE);
    var own = vec4(0.0);
    var gradient = vec3(0.0);
    if all(pixel < settings.size) {
        let index = pixel.y * settings.size.x + pixel.x;
        let before = pixel_gradients[index];
        gradient = before.xyz;
        own = of_scene(textureLoad(color, pixel, 0));
        let by_own = gradient.x * row(0u) + gradient.y * row(1u) + gradient.z * row(2u);
        let behind = settings.background;
        // More opacity means less background in the drawn color: a larger part of the color is corrected.
        let by_opacity = behind.w * (dot(by_own, vec4(behind.xyz, 1.0)) - dot(gradient, behind.xyz));
        pixel_gradients[index] = vec4(by_own.xyz, before.w + by_opacity);
    }
    for (var i = 0u; i < ROWS; i++) {
        sums[thread] = gradient[i] * own;
        add_sums(thread);
        if thread == 0u {
            tile_sums[ROWS * (tile.y * settings.tiles.x + tile.x) + i] = sums[0];
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(256)
fn gather(@builtin(local_invocation_index) thread: u32) {
    for (var i = 0u; i < ROWS; i++) {
        var sum = vec4(0.0);
        for (var tile = thread; tile < settings.tiles.x * settings.tiles.y; tile += 256u) {
            sum += tile_sums[ROWS * tile + i];
        }
        sums[thread] = sum;
        add_sums(thread);
        if thread == 0u {
            let pulled = 2.0 * settings.pull * settings.share * (row(i) - identity(i));
            gradients[ROWS * settings.camera + i] += sums[0] + pulled;
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(256)
fn center(@builtin(local_invocation_index) thread: u32) {
    let cameras = arrayLength(&every) / ROWS;
    for (var i = 0u; i < ROWS; i++) {
        var sum = vec4(0.0);
        for (var camera = thread; camera < cameras; camera += 256u) {
            sum += every[ROWS * camera + i] - identity(i);
        }
        sums[thread] = sum;
        add_sums(thread);
        let mean = sums[0] / f32(cameras);
        for (var camera = thread; camera < cameras; camera += 256u) {
            every[ROWS * camera + i] -= mean;
        }
        workgroupBarrier();
    }
}

// Adds all sums to the first.
fn add_sums(thread: u32) {
    for (var half = 128u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if thread < half {
            sums[thread] += sums[thread + half];
        }
    }
    workgroupBarrier();
}
