// loss: the loss of a rendered picture against its training image, and the gradient with respect to each pixel.
// In: color over the background and transmittance, the image. Out: (1 - s) L1 + s (1 - SSIM) + w mask of the view, with
// s the similarity share and w the mask weight, and its gradient. The mask is the mean over pixels of -(1 - coverage)
// log(1 - opacity): it penalizes opacity where the image has no coverage. `similarity` writes the derivatives of SSIM
// with respect to the windowed means; `gradient` convolves them with the window, adds L1 and writes sums for each tile;
// `total` adds these to the sums of all views so far. CPU reference: src/offline/train/reference/loss.rs.
//
// SSIM: 11 x 11 Gaussian window of deviation 1.5, zeros beyond the border, channel by channel, mean over pixels and
// channels.
#import gs4d::training::LossUniforms

const RADIUS: u32 = 5u;
const SIDE: u32 = 16u;
// Side of a tile with a border of RADIUS pixels.
const REACH: u32 = 26u;
const C1: f32 = 0.0001;
const C2: f32 = 0.0009;
// The mask clamps opacity to the interval from MARGIN to 1 - MARGIN.
const MARGIN: f32 = 1e-6;

@group(0) @binding(0) var<uniform> loss: LossUniforms;
@group(0) @binding(1) var color: texture_2d<f32>;
// For each pixel and channel: derivatives of SSIM with respect to the mean, the mean square and the mean product with
// the image; SSIM.
@group(0) @binding(2) var<storage, read_write> slopes: array<vec4<f32>>;
// Gradient with respect to red, green, blue and opacity of each pixel.
@group(0) @binding(3) var<storage, read_write> pixel_gradients: array<vec4<f32>>;
// For each tile: sums of the absolute difference, of SSIM, of the squared difference of the clamped colors and of the
// mask.
@group(0) @binding(4) var<storage, read_write> tile_sums: array<vec4<f32>>;
// Loss, absolute difference, squared difference and number of views so far.
@group(0) @binding(5) var<storage, read_write> totals: array<vec4<f32>>;
// Color times coverage, coverage: one byte each.
@group(1) @binding(0) var<storage, read> image: array<u32>;

// Picture and image with the border, then three maps at a time; sums over rows.
var<workgroup> field: array<vec3<f32>, 676>;
var<workgroup> rows_a: array<vec3<f32>, 416>;
var<workgroup> rows_b: array<vec2<f32>, 416>;
var<workgroup> sums: array<vec4<f32>, 256>;

fn window(i: u32) -> f32 {
    let weights = array<f32, 6>(0.26601172, 0.21300553, 0.10936069, 0.03600077, 0.00759874, 0.00102838);
    return weights[select(i - RADIUS, RADIUS - i, i < RADIUS)];
}

fn is_inside(at: vec2<i32>) -> bool {
    return all(at >= vec2(0)) && all(at < vec2<i32>(loss.size));
}

fn index_of(at: vec2<i32>) -> u32 {
    return u32(at.y) * loss.size.x + u32(at.x);
}

// Returns the image over the background.
fn image_at(at: vec2<i32>) -> vec3<f32> {
    let texel = unpack4x8unorm(image[index_of(at)]);
    return texel.xyz + (1.0 - texel.w) * loss.background.xyz;
}

fn coverage_at(at: vec2<i32>) -> f32 {
    return unpack4x8unorm(image[index_of(at)]).w;
}

// Returns the pixel of the picture that an element of `field` belongs to.
fn place_of(tile: vec2<u32>, i: u32) -> vec2<i32> {
    return vec2<i32>(tile * SIDE + vec2(i % REACH, i / REACH)) - i32(RADIUS);
}

@compute @workgroup_size(256)
fn similarity(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let own = vec2(thread % SIDE, thread / SIDE);
    let at = vec2<i32>(tile.xy * SIDE + own);
    for (var channel = 0u; channel < 3u; channel++) {
        for (var i = thread; i < REACH * REACH; i += 256u) {
            let place = place_of(tile.xy, i);
            var both = vec3(0.0);
            if is_inside(place) {
                both = vec3(textureLoad(color, place, 0)[channel], image_at(place)[channel], 0.0);
            }
            field[i] = both;
        }
        workgroupBarrier();
        for (var i = thread; i < SIDE * REACH; i += 256u) {
            var a = vec3(0.0);
            var b = vec2(0.0);
            for (var k = 0u; k < 11u; k++) {
                let both = field[i / SIDE * REACH + i % SIDE + k].xy;
                a += window(k) * vec3(both, both.x * both.x);
                b += window(k) * both.y * both.yx;
            }
            rows_a[i] = a;
            rows_b[i] = b;
        }
        workgroupBarrier();
        var a = vec3(0.0);
        var b = vec2(0.0);
        for (var k = 0u; k < 11u; k++) {
            a += window(k) * rows_a[(own.y + k) * SIDE + own.x];
            b += window(k) * rows_b[(own.y + k) * SIDE + own.x];
        }
        if is_inside(at) {
            let x = a.x;
            let y = a.y;
            let a1 = 2.0 * x * y + C1;
            let a2 = 2.0 * (b.y - x * y) + C2;
            let b1 = x * x + y * y + C1;
            let b2 = (a.z - x * x) + (b.x - y * y) + C2;
            let s = a1 * a2 / (b1 * b2);
            let by_mean = 2.0 * y * (a2 - a1) / (b1 * b2) + 2.0 * x * s * (1.0 / b2 - 1.0 / b1);
            slopes[3u * index_of(at) + channel] = vec4(by_mean, -s / b2, 2.0 * a1 / (b1 * b2), s);
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(256)
fn gradient(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let own = vec2(thread % SIDE, thread / SIDE);
    let at = vec2<i32>(tile.xy * SIDE + own);
    let inside = is_inside(at);
    // Color, transmittance.
    var rendered = vec4(0.0);
    var expected = vec3(0.0);
    var uncovered = 0.0;
    if inside {
        rendered = textureLoad(color, at, 0);
        expected = image_at(at);
        uncovered = 1.0 - coverage_at(at);
    }
    var by_similarity = vec3(0.0);
    var similarity_sum = 0.0;
    for (var channel = 0u; channel < 3u; channel++) {
        for (var i = thread; i < REACH * REACH; i += 256u) {
            let place = place_of(tile.xy, i);
            var map = vec3(0.0);
            if is_inside(place) {
                map = slopes[3u * index_of(place) + channel].xyz;
            }
            field[i] = map;
        }
        workgroupBarrier();
        for (var i = thread; i < SIDE * REACH; i += 256u) {
            var sum = vec3(0.0);
            for (var k = 0u; k < 11u; k++) {
                sum += window(k) * field[i / SIDE * REACH + i % SIDE + k];
            }
            rows_a[i] = sum;
        }
        workgroupBarrier();
        var sum = vec3(0.0);
        for (var k = 0u; k < 11u; k++) {
            sum += window(k) * rows_a[(own.y + k) * SIDE + own.x];
        }
        by_similarity[channel] = sum.x + 2.0 * rendered[channel] * sum.y + expected[channel] * sum.z;
        if inside {
            similarity_sum += slopes[3u * index_of(at) + channel].w;
        }
        workgroupBarrier();
    }
    let difference = rendered.xyz - expected;
    let clamped = clamp(rendered.xyz, vec3(0.0), vec3(1.0)) - expected;
    if inside {
        let pixels = f32(loss.size.x * loss.size.y);
        let gradient = (1.0 - loss.similarity_share) * sign(difference) - loss.similarity_share * by_similarity;
        let left = clamp(rendered.w, MARGIN, 1.0 - MARGIN);
        // The derivative of a clamped opacity is zero.
        let by_opacity = select(0.0, loss.mask_weight * uncovered / left, left == rendered.w);
        pixel_gradients[index_of(at)] =
            vec4(gradient * loss.share / (3.0 * pixels), by_opacity * loss.share / pixels);
        sums[thread] =
            vec4(dot(abs(difference), vec3(1.0)), similarity_sum, dot(clamped, clamped), -uncovered * log(left));
    } else {
        sums[thread] = vec4(0.0);
    }
    add_sums(thread);
    if thread == 0u {
        tile_sums[tile.y * loss.tiles.x + tile.x] = sums[0];
    }
}

@compute @workgroup_size(256)
fn total(@builtin(local_invocation_index) thread: u32) {
    var sum = vec4(0.0);
    for (var i = thread; i < loss.tiles.x * loss.tiles.y; i += 256u) {
        sum += tile_sums[i];
    }
    sums[thread] = sum;
    add_sums(thread);
    if thread == 0u {
        let pixels = f32(loss.size.x * loss.size.y);
        let mean = sums[0].xyz / (3.0 * pixels);
        let mask = loss.mask_weight * sums[0].w / pixels;
        let value = (1.0 - loss.similarity_share) * mean.x + loss.similarity_share * (1.0 - mean.y) + mask;
        totals[0] += vec4(value, mean.x, mean.z, 1.0);
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
