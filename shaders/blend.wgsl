// blend: front to back over each tile of 16 x 16 pixels, one workgroup each.
// In: tile ranges, pairs, splats, the depth of opaque surfaces, the background. Out: colour and transmittance, expected depth.
// Section 3.4 of the 4DGS model; twin of src/reference/blend.rs.
#import gs4d::types::{Frame, Splat, BACKGROUND_COLOR, BACKGROUND_ENVIRONMENT}
#import gs4d::environment::environment_texel

const TILE_SIZE: u32 = 16u;
const BATCH: u32 = 256u;
const ALPHA_MIN: f32 = 1.0 / 255.0;
const ALPHA_MAX: f32 = 0.99;
const TRANSMITTANCE_MIN: f32 = 1e-4;
const FAR: f32 = 3.4e38;

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> pair_splats: array<u32>;
@group(0) @binding(3) var<storage, read> splats: array<Splat>;
// Planar: 3 x height x width.
@group(0) @binding(4) var<storage, read> environment: array<f32>;
@group(0) @binding(5) var opaque_depth: texture_depth_2d;
@group(0) @binding(6) var color_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var depth_out: texture_storage_2d<r32float, write>;

// Centre, opacity, depth; conic; colour.
var<workgroup> batch_a: array<vec4<f32>, 256>;
var<workgroup> batch_b: array<vec3<f32>, 256>;
var<workgroup> batch_c: array<vec3<f32>, 256>;
// Pixels of this tile that need no more splats.
var<workgroup> finished: atomic<u32>;

@compute @workgroup_size(256)
fn blend(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let pixel = tile.xy * TILE_SIZE + vec2(thread % TILE_SIZE, thread / TILE_SIZE);
    let position = vec2<f32>(pixel);
    let range = tile_ranges[tile.y * frame.tiles.x + tile.x];
    let inside = all(pixel < frame.size);
    let limit = opaque_limit(pixel, inside);

    var color = vec3(0.0);
    var transmittance = 1.0;
    var depth = 0.0;
    var done = !inside;
    if thread == 0u {
        atomicStore(&finished, 0u);
    }
    workgroupBarrier();
    if done {
        atomicAdd(&finished, 1u);
    }
    for (var first = range.x; first < range.y; first += BATCH) {
        // Nobody adds to `finished` between these barriers, so that all threads leave together.
        workgroupBarrier();
        if atomicLoad(&finished) == BATCH {
            break;
        }
        let mine = first + thread;
        if mine < range.y {
            let splat = splats[pair_splats[mine]];
            batch_a[thread] = vec4(splat.center, splat.opacity, splat.depth);
            batch_b[thread] = splat.conic;
            batch_c[thread] = splat.color;
        }
        workgroupBarrier();
        if done {
            continue;
        }
        for (var i = 0u; i < min(BATCH, range.y - first); i++) {
            let a = batch_a[i];
            // Sorted by depth: all that follow are hidden too.
            if a.w > limit {
                done = true;
                break;
            }
            let d = a.xy - position;
            let conic = batch_b[i];
            let power = -0.5 * (conic.x * d.x * d.x + conic.z * d.y * d.y) - conic.y * d.x * d.y;
            if power > 0.0 {
                continue;
            }
            let alpha = min(ALPHA_MAX, a.z * exp(power));
            if alpha < ALPHA_MIN {
                continue;
            }
            let left = transmittance * (1.0 - alpha);
            if left < TRANSMITTANCE_MIN {
                done = true;
                break;
            }
            let weight = alpha * transmittance;
            color += batch_c[i] * weight;
            depth += a.w * weight;
            transmittance = left;
        }
        if done {
            atomicAdd(&finished, 1u);
        }
    }
    if inside {
        if frame.background_mode == BACKGROUND_COLOR {
            color += transmittance * frame.background.xyz;
        } else if frame.background_mode == BACKGROUND_ENVIRONMENT && limit == FAR {
            color += transmittance * environment_color(position);
            // background.w: whether what is behind the map is hidden by it.
            transmittance *= frame.background.w;
        }
        textureStore(color_out, pixel, vec4(color, transmittance));
        textureStore(depth_out, pixel, vec4(depth, 0.0, 0.0, 0.0));
    }
}

// Camera-space depth of the opaque surface at this pixel: z = near / depth with an infinite reverse-z projection.
fn opaque_limit(pixel: vec2<u32>, inside: bool) -> f32 {
    if frame.opaque_near == 0.0 || !inside {
        return FAR;
    }
    let depth = textureLoad(opaque_depth, pixel + frame.opaque_origin, 0);
    return select(FAR, frame.opaque_near / depth, depth > 0.0);
}

fn environment_color(position: vec2<f32>) -> vec3<f32> {
    let ndc = (position + 0.5) / vec2<f32>(frame.size) * 2.0 - 1.0;
    let ray = vec3((ndc - frame.projection.zw) / frame.projection.xy, 1.0);
    let world = frame.world_x.xyz * ray.x + frame.world_y.xyz * ray.y + frame.world_z.xyz * ray.z;
    let origin = vec3(frame.world_x.w, frame.world_y.w, frame.world_z.w);
    let at = environment_texel(origin, normalize(world), frame.environment_size);
    let corner = floor(at);
    var color = vec3(0.0);
    for (var i = 0u; i < 4u; i++) {
        let texel = corner + vec2(f32(i & 1u), f32(i >> 1u));
        let weight = (1.0 - abs(at.x - texel.x)) * (1.0 - abs(at.y - texel.y));
        color += weight * environment_at(texel);
    }
    return color;
}

// Black outside the texture: the seam fades, as in the original.
fn environment_at(texel: vec2<f32>) -> vec3<f32> {
    let size = frame.environment_size;
    if any(texel < vec2(0.0)) || any(texel >= vec2<f32>(size)) {
        return vec3(0.0);
    }
    let plane = size.x * size.y;
    let at = u32(texel.y) * size.x + u32(texel.x);
    return vec3(environment[at], environment[plane + at], environment[2u * plane + at]);
}
