// blend: front to back over each tile of 16 x 16 pixels, one workgroup each, as the original rasterizer does.
// In: tile ranges, pairs, splats, the depth of opaque surfaces, the background. Out: color and transmittance, expected
// and median depth. Each sample of a multisampled depth hides what is behind it from its share of the pixel. CPU
// reference: src/reference/blend.rs.
#import gs4d::types::{FrameUniforms, SplatRecord, BACKGROUND_COLOR, BACKGROUND_ENVIRONMENT, DEBUG_DEPTH, DEBUG_OVERDRAW}
#import gs4d::alpha::{alpha_at, is_opaque, is_skipped, left_behind}
#import gs4d::appearance::{heat, lit}
#import gs4d::environment::environment_texel
#import gs4d::tile::{pixel_of, tile_index}

const BATCH: u32 = 256u;
const FAR: f32 = 3.4e38;
// Number of blended splats at the end of the scale of overdraw.
const OVERDRAW_MAX: f32 = 64.0;
#ifdef MULTISAMPLED
const SAMPLES_MAX: u32 = 8u;
#endif

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
@group(0) @binding(1) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> pair_splats: array<u32>;
@group(0) @binding(3) var<storage, read> splats: array<SplatRecord>;
// Planar: 3 x height x width.
@group(0) @binding(4) var<storage, read> environment: array<f32>;
#ifdef MULTISAMPLED
@group(0) @binding(5) var opaque_depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(5) var opaque_depth: texture_depth_2d;
#endif
@group(0) @binding(6) var color_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var depth_out: texture_storage_2d<rg32float, write>;

// Center, opacity, depth; conic; color.
var<workgroup> batch_a: array<vec4<f32>, 256>;
var<workgroup> batch_b: array<vec3<f32>, 256>;
var<workgroup> batch_c: array<vec3<f32>, 256>;
// Camera-space depth of the opaque surface of each sample, and the number of samples.
#ifdef MULTISAMPLED
var<private> limits: array<f32, 8>;
#else
var<private> limits: array<f32, 1>;
#endif
var<private> samples: u32;

// Number of pixels of this tile that need no more splats.
var<workgroup> finished: atomic<u32>;

@compute @workgroup_size(256)
fn blend(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let pixel = pixel_of(tile.xy, thread);
    let position = vec2<f32>(pixel);
    let range = tile_ranges[tile_index(tile.xy, frame.tiles.x)];
    let inside = all(pixel < frame.size);
    find_limits(pixel, inside);
    let open = open_share();

    var color = vec3(0.0);
    var transmittance = 1.0;
    var depth = 0.0;
    var median = 0.0;
    var blended = 0u;
    // Number of samples whose surface has been passed, the sum of their transmittances, and the depth of the next
    // surface.
    var hidden = 0u;
    var hidden_transmittance = 0.0;
    var limit = next_limit(-FAR);
    var done = !inside;
    if thread == 0u {
        atomicStore(&finished, 0u);
    }
    workgroupBarrier();
    if done {
        atomicAdd(&finished, 1u);
    }
    for (var first = range.x; first < range.y; first += BATCH) {
        // No thread adds to `finished` between these barriers, so that all threads leave together.
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
            // Sorted by depth: all that follow are hidden from these samples too.
            if a.w > limit {
                let passed = passed_limits(a.w);
                hidden_transmittance += f32(passed - hidden) * transmittance;
                hidden = passed;
                if hidden == samples {
                    done = true;
                    break;
                }
                limit = next_limit(a.w);
            }
            let alpha = alpha_at(batch_b[i], a.z, a.xy - position);
            if is_skipped(alpha) {
                continue;
            }
            let left = left_behind(transmittance, alpha);
            if is_opaque(left) {
                done = true;
                break;
            }
            let weight = alpha * transmittance * (f32(samples - hidden) / f32(samples));
            color += batch_c[i] * weight;
            depth += a.w * weight;
            if transmittance > 0.5 && left <= 0.5 {
                median = a.w;
            }
            transmittance = left;
            blended++;
        }
        if done {
            atomicAdd(&finished, 1u);
        }
    }
    if inside {
        // Transmittance where there is no surface, and the mean over all samples.
        let behind = transmittance * open;
        transmittance = (hidden_transmittance + f32(samples - hidden) * transmittance) / f32(samples);
        if frame.debug == DEBUG_DEPTH {
            color = vec3(debug_depth(depth, 1.0 - transmittance));
        } else if frame.debug == DEBUG_OVERDRAW {
            color = heat(f32(blended) / OVERDRAW_MAX);
            transmittance = select(0.0, 1.0, blended == 0u);
        } else if frame.background_mode == BACKGROUND_COLOR {
            color += transmittance * frame.background.xyz;
        } else if frame.background_mode == BACKGROUND_ENVIRONMENT && open > 0.0 {
            let shown = behind * frame.environment_opacity;
            color += shown * environment_color(position);
            // background.w: factor on the transmittance behind the map, 0 or 1.
            transmittance -= shown * (1.0 - frame.background.w);
        }
        textureStore(color_out, pixel, vec4(color, transmittance));
        textureStore(depth_out, pixel, vec4(depth, median, 0.0, 0.0));
    }
}

// Returns the brightness of a depth, premultiplied: near is bright.
fn debug_depth(depth: f32, opacity: f32) -> f32 {
    if opacity <= 0.0 {
        return 0.0;
    }
    return opacity * frame.debug_depth / (frame.debug_depth + max(depth / opacity, 0.0));
}

// Loads the camera-space depth of the opaque surface of each sample of this pixel.
fn find_limits(pixel: vec2<u32>, inside: bool) {
    samples = 1u;
    limits[0] = FAR;
    if frame.opaque_samples == 0u || !inside {
        return;
    }
#ifdef MULTISAMPLED
    samples = min(frame.opaque_samples, SAMPLES_MAX);
    for (var i = 0u; i < samples; i++) {
        limits[i] = distance_of(textureLoad(opaque_depth, pixel + frame.opaque_origin, i));
    }
#else
    limits[0] = distance_of(textureLoad(opaque_depth, pixel + frame.opaque_origin, 0));
#endif
}

// Returns the camera-space depth of a value of the depth buffer. 0 means that there is no surface: the far plane.
fn distance_of(depth: f32) -> f32 {
    let d = frame.opaque_distance;
    return select(FAR, (d.x + d.y * depth) / (d.z + d.w * depth), depth > 0.0);
}

// Returns the share of the samples without a surface.
fn open_share() -> f32 {
    var open = 0u;
    for (var i = 0u; i < samples; i++) {
        open += select(0u, 1u, limits[i] == FAR);
    }
    return f32(open) / f32(samples);
}

// Returns the depth of the nearest surface that is not before `depth`.
fn next_limit(depth: f32) -> f32 {
    var nearest = FAR;
    for (var i = 0u; i < samples; i++) {
        nearest = select(nearest, min(nearest, limits[i]), limits[i] >= depth);
    }
    return nearest;
}

// Returns the number of samples whose surface is before `depth`.
fn passed_limits(depth: f32) -> u32 {
    var passed = 0u;
    for (var i = 0u; i < samples; i++) {
        passed += select(0u, 1u, limits[i] < depth);
    }
    return passed;
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
    return lit(color, frame.environment_lighting, frame.background.xyz);
}

// Returns a texel, black outside the texture: the seam fades, as in the original.
fn environment_at(texel: vec2<f32>) -> vec3<f32> {
    let size = frame.environment_size;
    if any(texel < vec2(0.0)) || any(texel >= vec2<f32>(size)) {
        return vec3(0.0);
    }
    let plane = size.x * size.y;
    let at = u32(texel.y) * size.x + u32(texel.x);
    return vec3(environment[at], environment[plane + at], environment[2u * plane + at]);
}
