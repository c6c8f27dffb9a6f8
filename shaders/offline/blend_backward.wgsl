// blend_backward: the gradient of a loss with respect to the splats of a view.
// In: the inputs and outputs of `blend`, and the gradient of the loss with respect to each pixel. Out: for each pair of
// splat and tile, sums over the pixels of the tile. `place` writes the first pair of each splat; `pairs` computes the
// sums of every pair, one workgroup for each tile. CPU reference: src/reference/blend_backward.rs; equations:
// section 7.1 of the 4DGS model.
//
// The splats of a pixel are visited front to back, as in `blend`, so that both stop at the same splat. The color behind
// a splat is the finished color minus the color blended so far.
#import gs4d::alpha::{is_opaque, is_skipped, left_behind, ALPHA_MAX}
#import gs4d::conic::exponent_at
#import gs4d::tile::{pixel_of, tile_index}
#import gs4d::pairs::{frame, pair_of, pair_splats, place_pairs, splats, tile_ranges}
#import gs4d::records::read_splat

const PIXELS: u32 = 256u;
// Number of splats whose terms are summed at once, and number of sums per splat.
const BATCH: u32 = 8u;
const SUMS: u32 = 10u;
// Number of splats that are loaded at once, a multiple of BATCH. Loading them one by one would add a memory latency for
// each.
const CHUNK: u32 = 64u;

// The color that `blend` wrote, with the background, and the transmittance.
@group(0) @binding(7) var color: texture_2d<f32>;
// Expected and median depth.
@group(0) @binding(8) var depth: texture_2d<f32>;
// SUMS values for each pair. With d from pixel to center, w = alpha T and q = alpha dL/dalpha: the sums of q dx, q dy,
// q dx^2, q dx dy, q dy^2, q, and of w times the gradient of the pixel's red, green, blue and depth.
@group(1) @binding(1) var<storage, read_write> pair_gradients: array<f32>;
// Gradient with respect to red, green, blue and opacity of each pixel.
@group(1) @binding(2) var<storage, read> pixel_gradients: array<vec4<f32>>;
// Gradient with respect to the expected depth of each pixel.
@group(1) @binding(3) var<storage, read> depth_gradients: array<f32>;

// For each splat of the chunk: center, opacity, depth; conic; color; the index of the pair to which its sums belong.
var<workgroup> places: array<vec4<f32>, CHUNK>;
var<workgroup> conics: array<vec3<f32>, CHUNK>;
var<workgroup> colors: array<vec3<f32>, CHUNK>;
var<workgroup> chunk_places: array<u32, CHUNK>;
// For the batch: w and q of each pixel, splat by splat; then their sums over eight pixels.
var<workgroup> weights: array<f32, 2048>;
var<workgroup> terms: array<f32, 2048>;
// Gradients with respect to red, green, blue and depth.
var<workgroup> own_gradients: array<vec4<f32>, 256>;
// Number of finished pixels of this tile.
var<workgroup> finished: atomic<u32>;

@compute @workgroup_size(256)
fn place(@builtin(global_invocation_id) id: vec3<u32>) {
    place_pairs(id.x);
}

@compute @workgroup_size(256)
fn pairs(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let at = pixel_of(tile.xy, thread);
    let position = vec2<f32>(at);
    let range = tile_ranges[tile_index(tile.xy, frame.tiles.x)];
    var gradient = vec4(0.0);
    var by_opacity = 0.0;
    // Gradient-weighted sum of the color, depth and opacity behind the splats blended so far.
    var behind = 0.0;
    var transmittance = 1.0;
    var done = !all(at < frame.size);
    if !done {
        let pixel = at.y * frame.size.x + at.x;
        let whole = textureLoad(color, at, 0);
        gradient = vec4(pixel_gradients[pixel].xyz, depth_gradients[pixel]);
        by_opacity = pixel_gradients[pixel].w;
        behind = dot(vec4(whole.xyz, textureLoad(depth, at, 0).x), gradient) + (1.0 - whole.w) * by_opacity;
    }
    if thread == 0u {
        atomicStore(&finished, 0u);
    }
    own_gradients[thread] = gradient;
    workgroupBarrier();
    if done {
        atomicAdd(&finished, 1u);
    }
    for (var first = range.x; first < range.y; first += BATCH) {
        let count = min(BATCH, range.y - first);
        let in_chunk = (first - range.x) % CHUNK;
        workgroupBarrier();
        if in_chunk == 0u && thread < min(CHUNK, range.y - first) {
            let slot = pair_splats[first + thread];
            let splat = read_splat(splats[slot]);
            places[thread] = vec4(splat.center, splat.opacity, splat.depth);
            conics[thread] = splat.conic;
            colors[thread] = splat.color;
            chunk_places[thread] = pair_of(slot, tile.xy);
        }
        let over = workgroupUniformLoad(&finished) == PIXELS;
        let was_done = done;
        for (var i = 0u; i < count; i++) {
            let place = places[in_chunk + i];
            let conic = conics[in_chunk + i];
            var weight = 0.0;
            var term = 0.0;
            let d = place.xy - position;
            let peak = place.z * exp(exponent_at(conic, d));
            let alpha = min(ALPHA_MAX, peak);
            if !done && !is_skipped(alpha) {
                let left = left_behind(transmittance, alpha);
                if is_opaque(left) {
                    done = true;
                } else {
                    weight = alpha * transmittance;
                    let own = dot(vec4(colors[in_chunk + i], place.w), gradient) + by_opacity;
                    behind -= weight * own;
                    let slope = transmittance * own - behind / (1.0 - alpha);
#ifdef COMPAT
                    term = peak * slope;
#else
                    // The derivative of a clamped alpha is zero.
                    term = select(peak * slope, 0.0, peak > ALPHA_MAX);
#endif
                    transmittance = left;
                }
            }
            weights[i * PIXELS + thread] = weight;
            terms[i * PIXELS + thread] = term;
        }
        workgroupBarrier();
        if done && !was_done {
            atomicAdd(&finished, 1u);
        }
        let own_splat = thread / 32u;
        var moments = vec3(0.0);
        var squares = vec3(0.0);
        var shares = vec4(0.0);
        if own_splat < count {
            let center = places[in_chunk + own_splat].xy;
            for (var i = 0u; i < 8u; i++) {
                let pixel = thread % 32u + 32u * i;
                let q = terms[own_splat * PIXELS + pixel];
                let d = center - vec2<f32>(pixel_of(tile.xy, pixel));
                moments += q * vec3(d, d.x * d.x);
                squares += q * vec3(d.x * d.y, d.y * d.y, 1.0);
                shares += weights[own_splat * PIXELS + pixel] * own_gradients[pixel];
            }
        }
        workgroupBarrier();
        for (var k = 0u; k < 3u; k++) {
            weights[k * 256u + thread] = moments[k];
            weights[(3u + k) * 256u + thread] = squares[k];
        }
        for (var k = 0u; k < 4u; k++) {
            terms[k * 256u + thread] = shares[k];
        }
        workgroupBarrier();
        if thread < SUMS * count {
            let splat = thread / SUMS;
            let k = thread % SUMS;
            var sum = 0.0;
            for (var i = 0u; i < 32u; i++) {
                if k < 6u {
                    sum += weights[k * 256u + splat * 32u + i];
                } else {
                    sum += terms[(k - 6u) * 256u + splat * 32u + i];
                }
            }
            pair_gradients[chunk_places[in_chunk + splat] * SUMS + k] = sum;
        }
        // All pixels are finished: the remaining pairs contribute nothing.
        if over {
            for (var i = first + BATCH + thread; i < range.y; i += PIXELS) {
                let pair = pair_of(pair_splats[i], tile.xy) * SUMS;
                for (var k = 0u; k < SUMS; k++) {
                    pair_gradients[pair + k] = 0.0;
                }
            }
            break;
        }
    }
}
