// score: the contribution of each Gaussian to a view, without float atomics.
// In: the inputs and the output of `blend`. Out: for each slot, sums over pixels of c = alpha T (contribution) and c^2
// (energy), and the sum over pixels and channels of (c (color - behind))^2 (removal). `place` writes the first pair of
// each splat; `pairs` sums every pair over its tile, one workgroup per tile; `gather` sums the pairs of each slot in a
// fixed order, so that the result is the same in every run. CPU reference: src/offline/score/reference.rs.
#import gs4d::alpha::{alpha_at, is_opaque, is_skipped, left_behind}
#import gs4d::tile::{pixel_of, tile_count, tile_index}
#import gs4d::types::INVISIBLE
#import gs4d::pairs::{first_pairs, frame, pair_of, pair_splats, place_pairs, splats, tile_ranges}
#import gs4d::records::{read_splat, Splat}

const PIXELS: u32 = 256u;
// Number of splats whose terms are summed at once.
const BATCH: u32 = 8u;

@group(0) @binding(7) var<storage, read> depth_keys: array<u32>;
// The color that `blend` wrote, with the background.
@group(0) @binding(8) var color: texture_2d<f32>;
@group(1) @binding(1) var<storage, read_write> pair_scores: array<vec4<f32>>;
@group(1) @binding(2) var<storage, read_write> scores: array<vec4<f32>>;

// For the batch: c and the squared removal of each pixel, splat by splat; then their sums over eight pixels.
var<workgroup> contribution: array<f32, 2048>;
var<workgroup> removal: array<f32, 2048>;
var<workgroup> partial: array<vec3<f32>, 256>;
// Number of finished pixels of this tile.
var<workgroup> finished: atomic<u32>;

@compute @workgroup_size(256)
fn place(@builtin(global_invocation_id) id: vec3<u32>) {
    place_pairs(id.x);
}

// The accumulated state of one pixel.
struct Pixel {
    color: vec3<f32>,
    transmittance: f32,
    done: bool,
}

// Returns the weight of a splat at a pixel, 0 if it is skipped, and updates the pixel as `blend` does.
fn advance(pixel: ptr<function, Pixel>, splat: Splat, position: vec2<f32>) -> f32 {
    if (*pixel).done {
        return 0.0;
    }
    let alpha = alpha_at(splat.conic, splat.opacity, splat.center - position);
    if is_skipped(alpha) {
        return 0.0;
    }
    let left = left_behind((*pixel).transmittance, alpha);
    if is_opaque(left) {
        (*pixel).done = true;
        return 0.0;
    }
    let weight = alpha * (*pixel).transmittance;
    (*pixel).color += splat.color * weight;
    (*pixel).transmittance = left;
    return weight;
}

@compute @workgroup_size(256)
fn pairs(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let at = pixel_of(tile.xy, thread);
    let position = vec2<f32>(at);
    let range = tile_ranges[tile_index(tile.xy, frame.tiles.x)];
    let inside = all(at < frame.size);

    // The color behind a splat is computed from the finished pixel.
    var total = vec3(0.0);
    if inside {
        total = textureLoad(color, at, 0).xyz;
    }
    if thread == 0u {
        atomicStore(&finished, 0u);
    }
    workgroupBarrier();
    var pixel = Pixel(vec3(0.0), 1.0, !inside);
    if !inside {
        atomicAdd(&finished, 1u);
    }
    for (var first = range.x; first < range.y; first += BATCH) {
        let count = min(BATCH, range.y - first);
        let over = workgroupUniformLoad(&finished) == PIXELS;
        let was_done = pixel.done;
        for (var i = 0u; i < count; i++) {
            let splat = read_splat(splats[pair_splats[first + i]]);
            let weight = advance(&pixel, splat, position);
            let behind = (total - pixel.color) / pixel.transmittance;
            let change = weight * (splat.color - behind);
            contribution[i * PIXELS + thread] = weight;
            removal[i * PIXELS + thread] = dot(change, change);
        }
        workgroupBarrier();
        if pixel.done && !was_done {
            atomicAdd(&finished, 1u);
        }
        let splat_index = thread / 32u;
        if splat_index < count {
            var sum = vec3(0.0);
            for (var i = 0u; i < 8u; i++) {
                let item = splat_index * PIXELS + (thread % 32u) + 32u * i;
                let c = contribution[item];
                sum += vec3(c, c * c, removal[item]);
            }
            partial[thread] = sum;
        }
        workgroupBarrier();
        if thread < count {
            var sum = vec3(0.0);
            for (var i = 0u; i < 32u; i++) {
                sum += partial[thread * 32u + i];
            }
            pair_scores[pair_of(pair_splats[first + thread], tile.xy)] = vec4(sum, 0.0);
        }
        // All pixels are finished: the remaining pairs contribute nothing.
        if over {
            for (var i = first + BATCH + thread; i < range.y; i += PIXELS) {
                pair_scores[pair_of(pair_splats[i], tile.xy)] = vec4(0.0);
            }
            break;
        }
    }
}

@compute @workgroup_size(256)
fn gather(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= frame.slots {
        return;
    }
    var sum = vec4(0.0);
    if depth_keys[id.x] != INVISIBLE {
        let count = tile_count(splats[id.x].shape.w, splats[id.x].color.w);
        for (var i = 0u; i < count; i++) {
            sum += pair_scores[first_pairs[id.x] + i];
        }
    }
    scores[id.x] = sum;
}
