// Blending of one pixel front to back: opaque surfaces, splats, background. Used by `blend` and `blend_blocks`, which
// differ in how they find the splats. CPU reference: src/reference/blend.rs.
#define_import_path gs4d::pixel

#import gs4d::types::{FrameUniforms, BACKGROUND_COLOR, BACKGROUND_ENVIRONMENT, DEBUG_DEPTH, DEBUG_OVERDRAW}
#import gs4d::alpha::{is_opaque, is_skipped, left_behind}
#import gs4d::appearance::{BRIGHTEST, heat, lit}
#import gs4d::environment::{bilinear_weight, environment_behind}

const FAR: f32 = 3.4e38;
// Number of blended splats at the upper end of the overdraw scale.
const OVERDRAW_MAX: f32 = 64.0;
// Loops over samples have this constant bound, so that they are unrolled: software drivers end all loops of a thread
// after 65,535 iterations.
#ifdef MULTISAMPLED
const SAMPLES_MAX: u32 = 8u;
#else
const SAMPLES_MAX: u32 = 1u;
#endif

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
// Planar: 3 x height x width.
@group(0) @binding(1) var<storage, read> environment: array<f32>;
#ifdef MULTISAMPLED
@group(0) @binding(2) var opaque_depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(2) var opaque_depth: texture_depth_2d;
#endif
#ifdef HALF_COLOR
@group(0) @binding(3) var color_out: texture_storage_2d<rgba16float, write>;
#else
@group(0) @binding(3) var color_out: texture_storage_2d<rgba32float, write>;
#endif
@group(0) @binding(4) var depth_out: texture_storage_2d<rg32float, write>;

// Camera-space depth of the opaque surface of each sample, and the number of samples.
#ifdef MULTISAMPLED
var<private> limits: array<f32, 8>;
#else
var<private> limits: array<f32, 1>;
#endif
var<private> samples: u32;

struct Pixel {
    color: vec3<f32>,
    transmittance: f32,
    // Expected depth, not divided by opacity, and median depth.
    depth: f32,
    median: f32,
    // Number of splats blended.
    blended: u32,
    // Number of samples whose surface is in front of the current splat, their summed transmittance, and the depth of
    // the next surface.
    hidden: u32,
    hidden_transmittance: f32,
    limit: f32,
    // Whether the pixel is finished: no further splat changes it.
    done: bool,
}

// Returns the pixel before the first splat.
fn begin_pixel(at: vec2<u32>) -> Pixel {
    let inside = all(at < frame.size);
    find_limits(at, inside);
    return Pixel(vec3(0.0), 1.0, 0.0, 0.0, 0u, 0u, 0.0, next_limit(-FAR), !inside);
}

// Passes the surfaces in front of a splat at this depth, the nearest splat that has not been blended: in their samples
// these surfaces hide this splat and all later splats.
fn pass_surfaces(pixel: ptr<function, Pixel>, depth: f32) {
    let passed = passed_limits(depth);
    (*pixel).hidden_transmittance += f32(passed - (*pixel).hidden) * (*pixel).transmittance;
    (*pixel).hidden = passed;
    (*pixel).limit = next_limit(depth);
    (*pixel).done = passed == samples;
}

// Blends a splat.
fn blend_splat(pixel: ptr<function, Pixel>, alpha: f32, color: vec3<f32>, depth: f32) {
    if is_skipped(alpha) {
        return;
    }
    let left = left_behind((*pixel).transmittance, alpha);
    if is_opaque(left) {
        (*pixel).done = true;
        return;
    }
    let weight = alpha * (*pixel).transmittance * (f32(samples - (*pixel).hidden) / f32(samples));
    (*pixel).color += color * weight;
    (*pixel).depth += depth * weight;
    if (*pixel).transmittance > 0.5 && left <= 0.5 {
        (*pixel).median = depth;
    }
    (*pixel).transmittance = left;
    (*pixel).blended++;
}

// Blends a splat as `blend_splat`, without a branch: a splat with alpha 0 is skipped, a finished pixel is unchanged.
fn blend_or_skip(pixel: ptr<function, Pixel>, alpha: f32, color: vec3<f32>, depth: f32) {
    let before = (*pixel).transmittance;
    let left = left_behind(before, alpha);
    (*pixel).done = (*pixel).done || is_opaque(left);
    let taken = !(*pixel).done && alpha > 0.0;
    let weight = select(0.0, alpha * before * (f32(samples - (*pixel).hidden) / f32(samples)), taken);
    (*pixel).color += color * weight;
    (*pixel).depth += depth * weight;
    (*pixel).median = select((*pixel).median, depth, taken && before > 0.5 && left <= 0.5);
    (*pixel).transmittance = select(before, left, taken);
    (*pixel).blended += select(0u, 1u, taken);
}

// Writes the pixel over the background.
fn finish_pixel(pixel: Pixel, at: vec2<u32>) {
    if !all(at < frame.size) {
        return;
    }
    // Transmittance of the samples without a surface, and the mean over all samples.
    let behind = pixel.transmittance * open_share();
    let transmittance = (pixel.hidden_transmittance + f32(samples - pixel.hidden) * pixel.transmittance) / f32(samples);
    if frame.debug == DEBUG_DEPTH {
        let value = vec3(debug_depth(pixel.depth, 1.0 - transmittance));
        textureStore(color_out, at, vec4(value, transmittance));
    } else if frame.debug == DEBUG_OVERDRAW {
        let value = heat(f32(pixel.blended) / OVERDRAW_MAX);
        textureStore(color_out, at, vec4(value, select(0.0, 1.0, pixel.blended == 0u)));
    } else {
        textureStore(color_out, at, over_background(pixel.color, transmittance, behind, at));
    }
    textureStore(depth_out, at, vec4(pixel.depth, pixel.median, 0.0, 0.0));
}

// Writes the color of a pixel over the background, without depths. `behind` is the transmittance of the samples without
// a surface.
fn write_color(color: vec3<f32>, transmittance: f32, behind: f32, at: vec2<u32>) {
    textureStore(color_out, at, over_background(color, transmittance, behind, at));
}

#ifdef MULTISAMPLED
fn sample_count() -> u32 {
    return clamp(frame.opaque_samples, 1u, SAMPLES_MAX);
}

// Returns the camera-space depth of the opaque surface of a sample of a pixel; FAR if there is none.
fn sample_depth(pixel: vec2<u32>, i: u32) -> f32 {
    return distance_of(textureLoad(opaque_depth, pixel + frame.opaque_origin, i));
}

// Returns the depth of the nearest and of the farthest surface of the samples of a pixel.
fn surface_range(pixel: vec2<u32>, inside: bool) -> vec2<f32> {
    if frame.opaque_samples == 0u || !inside {
        return vec2(FAR);
    }
    var range = vec2(sample_depth(pixel, 0u));
    for (var i = 1u; i < sample_count(); i++) {
        let depth = sample_depth(pixel, i);
        range = vec2(min(range.x, depth), max(range.y, depth));
    }
    return range;
}

// Returns the number of samples of a pixel whose surface is nearer than `depth`; with FAR, the number of samples that
// have a surface.
fn samples_before(pixel: vec2<u32>, depth: f32) -> u32 {
    var before = 0u;
    for (var i = 0u; i < sample_count(); i++) {
        before += select(0u, 1u, sample_depth(pixel, i) < depth);
    }
    return before;
}
#else
// Returns the camera-space depth of the opaque surface of a pixel; FAR if there is none.
fn surface_depth(pixel: vec2<u32>, inside: bool) -> f32 {
    if frame.opaque_samples == 0u || !inside {
        return FAR;
    }
    return distance_of(textureLoad(opaque_depth, pixel + frame.opaque_origin, 0));
}
#endif

// Returns color and transmittance over the background. `behind` is the transmittance of the samples without a surface.
fn over_background(color: vec3<f32>, transmittance: f32, behind: f32, at: vec2<u32>) -> vec4<f32> {
    if frame.background_mode == BACKGROUND_COLOR {
        return vec4(color + transmittance * frame.background.xyz, transmittance);
    }
    if frame.background_mode == BACKGROUND_ENVIRONMENT && behind > 0.0 {
        let shown = behind * frame.environment_opacity;
        // background.w: factor on the transmittance behind the environment map, 0 or 1.
        let left = transmittance - shown * (1.0 - frame.background.w);
        return vec4(color + shown * environment_color(vec2<f32>(at)), left);
    }
    return vec4(color, transmittance);
}

// Returns the brightness of a depth, premultiplied: near depths are bright.
fn debug_depth(depth: f32, opacity: f32) -> f32 {
    if opacity <= 0.0 {
        return 0.0;
    }
    return opacity * frame.debug_depth / (frame.debug_depth + max(depth / opacity, 0.0));
}

// Loads the camera-space depth of the opaque surface of each sample of this pixel.
fn find_limits(pixel: vec2<u32>, inside: bool) {
    samples = 1u;
    for (var i = 0u; i < SAMPLES_MAX; i++) {
        limits[i] = FAR;
    }
    if frame.opaque_samples == 0u || !inside {
        return;
    }
#ifdef MULTISAMPLED
    samples = sample_count();
    for (var i = 0u; i < samples; i++) {
        limits[i] = sample_depth(pixel, i);
    }
#else
    limits[0] = surface_depth(pixel, inside);
#endif
}

// Returns the camera-space depth of a value of the depth buffer. 0 means that there is no surface: the far plane. A
// value beyond that of infinity is of another range of the buffer, which is behind.
fn distance_of(depth: f32) -> f32 {
    let d = frame.opaque_distance;
    let divisor = d.z + d.w * depth;
    return select(FAR, (d.x + d.y * depth) / divisor, depth > 0.0 && divisor > 0.0);
}

// Returns the fraction of the samples without a surface.
fn open_share() -> f32 {
    var open = 0u;
    for (var i = 0u; i < SAMPLES_MAX; i++) {
        open += select(0u, 1u, i < samples && limits[i] == FAR);
    }
    return f32(open) / f32(samples);
}

// Returns the depth of the nearest surface that is not nearer than `depth`.
fn next_limit(depth: f32) -> f32 {
    var nearest = FAR;
    for (var i = 0u; i < SAMPLES_MAX; i++) {
        nearest = select(nearest, min(nearest, limits[i]), limits[i] >= depth);
    }
    return nearest;
}

// Returns the number of samples whose surface is nearer than `depth`.
fn passed_limits(depth: f32) -> u32 {
    var passed = 0u;
    for (var i = 0u; i < SAMPLES_MAX; i++) {
        passed += select(0u, 1u, limits[i] < depth);
    }
    return passed;
}

fn environment_color(position: vec2<f32>) -> vec3<f32> {
    let size = frame.environment_size;
    let at = environment_behind(
        position, frame.size, frame.projection, frame.world_x, frame.world_y, frame.world_z, size
    );
    let corner = floor(at);
    var color = vec3(0.0);
    for (var i = 0u; i < 4u; i++) {
        let texel = corner + vec2(f32(i & 1u), f32(i >> 1u));
        color += bilinear_weight(at, texel) * environment_at(texel);
    }
    return lit(color, frame.environment_lighting, frame.background.xyz);
}

// Returns a texel, black outside the texture: colors fade to black at the seam, as in the original.
fn environment_at(texel: vec2<f32>) -> vec3<f32> {
    let size = frame.environment_size;
    if any(texel < vec2(0.0)) || any(texel >= vec2<f32>(size)) {
        return vec3(0.0);
    }
    let plane = size.x * size.y;
    let at = u32(texel.y) * size.x + u32(texel.x);
    let color = vec3(environment[at], environment[plane + at], environment[2u * plane + at]);
    return clamp(color, vec3(-BRIGHTEST), vec3(BRIGHTEST));
}
