// blend_blocks: blends the splats of one tile, one workgroup per tile; the last pass of tile bins.
// In: the list of the tile that `sort_bins` wrote, splats, the depth of opaque surfaces, the background. Out: color and
// transmittance, with DEPTHS also expected and median depth. CPU reference: src/reference/blend.rs.
//
// The list is read in batches: each thread loads one splat and finds the blocks of 8 x 4 pixels that it can contribute
// to; each block queues its own splats, and its 32 threads blend them. If the list was not written for lack of space,
// all splats are searched for the nearest splats of each batch instead. The picture is the same.
#import gs4d::types::{SplatShape, VisibleSplat}
#import gs4d::records::{read_shape, Splat}
#import gs4d::bins::{depth_order, is_after, stamp_bits, FIRST, NONE, STAMP_MASK}
#import gs4d::nearest::{begin_search, clear_intervals, count_candidate, next_search}
#import gs4d::alpha::is_opaque
#ifdef DEPTHS
#import gs4d::pixel::{Pixel, begin_pixel, blend_or_skip, blend_splat, finish_pixel, frame, pass_surfaces}
#else ifdef MULTISAMPLED
#import gs4d::pixel::{frame, sample_count, samples_before, surface_range, write_color, FAR}
#else
#import gs4d::pixel::{frame, surface_depth, write_color, FAR}
#endif
#import gs4d::tile::{covers_tile, energy_of, tile_index, TILE_SIZE}

const THREADS: u32 = 256u;
// Splats per batch. Larger batches wait less often for the slowest block; smaller batches need less workgroup memory,
// so that more workgroups run at the same time.
#ifdef LARGE_BATCHES
const BATCH: u32 = 256u;
#else
const BATCH: u32 = 128u;
#endif
// Blocks of 8 x 4 pixels, one for each 32 threads.
const BLOCKS: u32 = 8u;
const LANES: u32 = 32u;
// Splats whose alphas a thread computes at once. Queue lengths are multiples of this number.
#ifdef EIGHT_AT_ONCE
const AT_ONCE: u32 = 8u;
#else
const AT_ONCE: u32 = 4u;
#endif
// Splats of a batch that each thread queues.
const OWN_SPLATS: u32 = BATCH / LANES;
const LOG2_E: f32 = 1.442695;
// log2 of ALPHA_MIN and of ALPHA_MAX.
const LOG2_ALPHA_MIN: f32 = -7.9943534;
const LOG2_ALPHA_MAX: f32 = -0.014499569;

// First and last + 1 pair of each tile; NONE if the pairs were not written for lack of space.
@group(1) @binding(0) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(1) @binding(1) var<storage, read> pair_splats: array<u32>;
// Indexed by slot, like `splat_colors`.
@group(1) @binding(2) var<storage, read> splats: array<SplatShape>;
@group(1) @binding(3) var<storage, read> splat_colors: array<vec4<f32>>;
@group(1) @binding(4) var<storage, read> visible: array<VisibleSplat>;

// batch_a: center, conic x scaled for exp2 and y. batch_b: conic z scaled, log2 of opacity, red, green. batch_c: blue
// and depth, padded to the same stride, so that one address serves all three arrays. The last element is a splat that
// is skipped at every pixel.
var<workgroup> batch_a: array<vec4<f32>, BATCH + 1u>;
var<workgroup> batch_b: array<vec4<f32>, BATCH + 1u>;
var<workgroup> batch_c: array<vec4<f32>, BATCH + 1u>;
// Blocks that each splat of the batch can contribute to, one bit per block.
var<workgroup> reached: array<u32, BATCH>;
// Splats of the batch that each block blends, in order, and AT_ONCE elements of padding for reads ahead. During a
// search: the depth keys of the splats found and, from BATCH on, their slots.
var<workgroup> queues: array<u32, BLOCKS * BATCH + AT_ONCE>;
#ifndef SUBGROUPS_OF_32
// Number of splats that each thread queues.
var<workgroup> queued_by: array<u32, THREADS>;
#endif
var<workgroup> finished: atomic<u32>;
// Number of splats found by a search, and their least and greatest depth keys.
var<workgroup> listed: atomic<u32>;
var<workgroup> least: atomic<u32>;
var<workgroup> greatest: atomic<u32>;

var<private> tile: vec2<u32>;

// Returns the depth key and slot of a visible splat; NONE if it belongs to another frame or does not cover this tile.
fn splat_of_tile(i: u32) -> vec2<u32> {
    let words = visible[i].words.zw;
    if any((words & vec2(STAMP_MASK)) != stamp_bits(frame.binning.x >> 8u)) {
        return NONE;
    }
    if !covers_tile(words.x & ~STAMP_MASK, words.y & ~STAMP_MASK, tile) {
        return NONE;
    }
    let slot = visible[i].words.x;
    return vec2(depth_order(splats[slot].place.w), slot);
}

// Lists the splats of this tile after `lower` and not after `upper`, unordered. Returns their number; at most BATCH are
// listed.
fn search(lower: vec2<u32>, upper: vec2<u32>, thread: u32) -> u32 {
    workgroupBarrier();
    if thread == 0u {
        atomicStore(&listed, 0u);
        atomicStore(&least, 0xffffffffu);
        atomicStore(&greatest, 0u);
    }
    workgroupBarrier();
    for (var i = thread; i < frame.slots; i += THREADS) {
        let found = splat_of_tile(i);
        if found.y != NONE.y && is_after(found, lower) && !is_after(found, upper) {
            let place = atomicAdd(&listed, 1u);
            if place < BATCH {
                queues[place] = found.x;
                queues[BATCH + place] = found.y;
            }
            atomicMin(&least, found.x);
            atomicMax(&greatest, found.x);
        }
    }
    return workgroupUniformLoad(&listed);
}

// Returns the last position up to which the splats of this tile after `lower` fit into a batch.
fn last_fitting(lower: vec2<u32>, thread: u32) -> vec2<u32> {
    var nearest = begin_search(lower, workgroupUniformLoad(&least), workgroupUniformLoad(&greatest));
    while !nearest.found {
        clear_intervals(thread);
        for (var i = thread; i < frame.slots; i += THREADS) {
            let found = splat_of_tile(i);
            if found.y != NONE.y {
                count_candidate(nearest, found);
            }
        }
        nearest = next_search(nearest, BATCH, thread);
    }
    return nearest.last;
}

// Lists the nearest splats of this tile after `lower` that fit into a batch, in depth order. Returns the position of
// the last; NONE if no splat remains.
fn search_batch(lower: vec2<u32>, thread: u32) -> vec2<u32> {
    var upper = NONE;
    if search(lower, NONE, thread) > BATCH {
        upper = last_fitting(lower, thread);
    }
    let count = search(lower, upper, thread);
    var own = NONE;
    var place = 0u;
    if thread < count {
        own = vec2(queues[thread], queues[BATCH + thread]);
        for (var i = 0u; i < count; i++) {
            place += select(0u, 1u, is_after(own, vec2(queues[i], queues[BATCH + i])));
        }
    }
    workgroupBarrier();
    if thread < count {
        queues[BATCH + place] = own.y;
    } else if thread < BATCH {
        queues[BATCH + thread] = NONE.y;
    }
    workgroupBarrier();
    return upper;
}

// Returns the splat of a pair; a splat of opacity 0 from `end` on.
fn load_pair(pair: u32, end: u32) -> Splat {
    var splat: Splat;
    if pair < end {
        splat = load_splat(pair_splats[pair]);
    }
    return splat;
}

// Returns the splat that `search_batch` found for a thread; a splat of opacity 0 if there is none.
fn load_found(thread: u32) -> Splat {
    var splat: Splat;
    if queues[BATCH + thread] != NONE.y {
        splat = load_splat(queues[BATCH + thread]);
    }
    return splat;
}

fn load_splat(slot: u32) -> Splat {
    return read_shape(splats[slot], splat_colors[slot].xyz);
}

// Returns the first pixel of a block in its tile.
fn corner_of(block: u32) -> vec2<u32> {
    return vec2(block % (TILE_SIZE / 8u) * 8u, block / (TILE_SIZE / 8u) * 4u);
}

// Writes the splat of a thread into the batch.
fn put_in_batch(splat: Splat, thread: u32) {
    let scaled = -0.5 * LOG2_E * splat.conic.xz;
    batch_a[thread] = vec4(splat.center, scaled.x, splat.conic.y);
    batch_b[thread] = vec4(scaled.y, log2(splat.opacity), splat.color.xy);
    batch_c[thread] = vec4(splat.color.z, splat.depth, 0.0, 0.0);
    var blocks = 0u;
    if splat.opacity > 0.0 {
        blocks = blocks_reached(splat);
    }
    reached[place_of(thread)] = blocks;
}

#ifdef SUBGROUPS_OF_32
fn place_of(i: u32) -> u32 {
    return i;
}
#else
// Orders splats 0, 8, 16, .. first, so that the threads of `queue_splats` read from different banks.
fn place_of(i: u32) -> u32 {
    return i % OWN_SPLATS * LANES + i / OWN_SPLATS;
}
#endif

// Returns the blocks of 8 x 4 pixels where the alpha of a splat can reach 1/255, one bit per block, with a margin for
// rounding.
fn blocks_reached(splat: Splat) -> u32 {
    let c = splat.conic;
    let bound = energy_of(splat.opacity) * 1.001 + 0.02;
    // On the line x = 1 the quadratic form has its minimum at y = slope.x, on y = 1 at x = slope.y.
    let slope = vec2(-c.x * c.y / (c.z + c.x * c.y * c.y), -c.y);
    let corner = vec2<f32>(tile * TILE_SIZE) - splat.center;
    let left = corner.x + vec2(0.0, 8.0);
    let right = left + 7.0;
    let near_x = clamp(vec2(0.0), left, right);
    var blocks = 0u;
    for (var row = 0u; row < 4u; row++) {
        let top = corner.y + f32(4u * row);
        let bottom = top + 3.0;
        let near_y = clamp(0.0, top, bottom);
        // The minimum of the form over a block lies on one of the two sides that face the center.
        let y = clamp(slope.x * near_x, vec2(top), vec2(bottom));
        let x = clamp(vec2(slope.y * near_y), left, right);
        let along_x = fma(vec2(c.y), y, near_x);
        let on_x = fma(c.x * along_x, along_x, c.z * y * y);
        let along_y = x + c.y * near_y;
        let on_y = fma(c.x * along_y, along_y, vec2(c.z * near_y * near_y));
        let hit = min(on_x, on_y) <= vec2(bound);
        blocks |= (select(0u, 1u, hit.x) | select(0u, 2u, hit.y)) << (2u * row);
    }
    return blocks;
}

// Lists the splats of the batch that can contribute to each block, in order. Returns their number, rounded up to a
// multiple of AT_ONCE: the queue is padded with BATCH, a splat that is skipped at every pixel.
fn queue_splats(thread: u32) -> u32 {
    let block = thread / LANES;
    let lane = thread % LANES;
    let queue = block * BATCH;
    var total = 0u;
#ifdef SUBGROUPS_OF_32
    for (var i = 0u; i < OWN_SPLATS; i++) {
        let hit = ((reached[i * LANES + lane] >> block) & 1u) == 1u;
        let hits = subgroupBallot(hit).x;
        if hit {
            queues[queue + total + countOneBits(hits & ((1u << lane) - 1u))] = i * LANES + lane;
        }
        total += countOneBits(hits);
    }
#else
    var own = 0u;
    for (var i = 0u; i < OWN_SPLATS; i++) {
        own |= ((reached[i * LANES + lane] >> block) & 1u) << i;
    }
    queued_by[thread] = countOneBits(own);
    workgroupBarrier();
    var place = 0u;
    for (var i = 0u; i < LANES; i++) {
        place = select(place, total, i == lane);
        total += queued_by[block * LANES + i];
    }
    for (var i = 0u; i < OWN_SPLATS; i++) {
        if ((own >> i) & 1u) == 1u {
            queues[queue + place] = lane * OWN_SPLATS + i;
            place++;
        }
    }
#endif
    let end = (total + AT_ONCE - 1u) & ~(AT_ONCE - 1u);
    if total + lane < end {
        queues[queue + total + lane] = BATCH;
    }
    workgroupBarrier();
    return end;
}

// Returns the alpha of a splat of the batch, as `alpha_at`, with the conic scaled for exp2; 0 if the splat is skipped.
fn batch_alpha(a: vec4<f32>, b: vec4<f32>, position: vec2<f32>) -> f32 {
    let d = a.xy - position;
    let along = d.x + a.w * d.y;
    let exponent = a.z * along * along + (b.x * d.y * d.y + b.y);
    return select(0.0, exp2(min(exponent, LOG2_ALPHA_MAX)), exponent >= LOG2_ALPHA_MIN);
}

fn batch_color(i: u32) -> vec3<f32> {
    return vec3(batch_b[i].zw, batch_c[i].x);
}

// Returns four splats of a queue.
fn queued_four(at: u32) -> vec4<u32> {
    return vec4(queues[at], queues[at + 1u], queues[at + 2u], queues[at + 3u]);
}

// Returns the alphas of four splats of the batch. Computed before blending, the four exponentials are independent of
// each other.
fn batch_alphas(four: vec4<u32>, position: vec2<f32>) -> vec4<f32> {
    return vec4(
        batch_alpha(batch_a[four.x], batch_b[four.x], position),
        batch_alpha(batch_a[four.y], batch_b[four.y], position),
        batch_alpha(batch_a[four.z], batch_b[four.z], position),
        batch_alpha(batch_a[four.w], batch_b[four.w], position),
    );
}

// Returns the colors of four splats of the batch.
fn batch_colors(four: vec4<u32>) -> mat4x3<f32> {
    return mat4x3(batch_color(four.x), batch_color(four.y), batch_color(four.z), batch_color(four.w));
}

fn batch_depths(four: vec4<u32>) -> vec4<f32> {
    return vec4(batch_c[four.x].y, batch_c[four.y].y, batch_c[four.z].y, batch_c[four.w].y);
}

#ifdef DEPTHS
// Blends four splats of the batch; splats with alpha 0 are skipped.
fn blend_four(pixel: ptr<function, Pixel>, alphas: vec4<f32>, four: vec4<u32>) {
    let depths = batch_depths(four);
    if any(depths > vec4((*pixel).limit)) {
        for (var i = 0u; i < 4u; i++) {
            if alphas[i] > 0.0 && !(*pixel).done {
                if depths[i] > (*pixel).limit {
                    pass_surfaces(pixel, depths[i]);
                }
                if !(*pixel).done {
                    blend_splat(pixel, alphas[i], batch_color(four[i]), depths[i]);
                }
            }
        }
        return;
    }
    blend_or_skip(pixel, alphas.x, batch_color(four.x), depths.x);
    blend_or_skip(pixel, alphas.y, batch_color(four.y), depths.y);
    blend_or_skip(pixel, alphas.z, batch_color(four.z), depths.z);
    blend_or_skip(pixel, alphas.w, batch_color(four.w), depths.w);
}
#else
// Color blended so far and remaining transmittance: `left` is 0 once the pixel is opaque, and `opaque_at` is its
// transmittance before that.
struct Sample {
    color: vec3<f32>,
    left: f32,
    opaque_at: f32,
#ifdef MULTISAMPLED
    // Number of samples whose surface is in front of the current splat, and their summed transmittance.
    hidden: u32,
    hidden_left: f32,
#endif
}

// Blends a splat. A splat with alpha 0 is skipped; an opaque pixel is unchanged.
fn blend_one(sample: ptr<function, Sample>, alpha: f32, color: vec3<f32>) {
    let left = (*sample).left * (1.0 - alpha);
    if is_opaque(left) {
        (*sample).opaque_at = select((*sample).opaque_at, (*sample).left, (*sample).left > 0.0);
        (*sample).left = 0.0;
        return;
    }
#ifdef MULTISAMPLED
    let open = 1.0 - f32((*sample).hidden) / f32(sample_count());
    (*sample).color += color * (alpha * (*sample).left * open);
#else
    (*sample).color += color * (alpha * (*sample).left);
#endif
    (*sample).left = left;
}

// Blends four splats with these alphas and colors, which are loaded before the test for opacity. Returns whether the
// pixel is opaque.
fn blend_four(sample: ptr<function, Sample>, alphas: vec4<f32>, colors: mat4x3<f32>) -> bool {
    // Fused multiply-adds: each splat depends on one instruction of the previous splat.
    let left = (*sample).left;
    let after_one = fma(-alphas.x, left, left);
    let after_two = fma(-alphas.y, after_one, after_one);
    let after_three = fma(-alphas.z, after_two, after_two);
    let after_four = fma(-alphas.w, after_three, after_three);
    if is_opaque(after_four) {
        blend_one(sample, alphas.x, colors[0]);
        blend_one(sample, alphas.y, colors[1]);
        blend_one(sample, alphas.z, colors[2]);
        blend_one(sample, alphas.w, colors[3]);
        return (*sample).left == 0.0;
    }
    (*sample).color += colors[0] * (alphas.x * left);
    (*sample).color += colors[1] * (alphas.y * after_one);
    (*sample).color += colors[2] * (alphas.z * after_two);
    (*sample).color += colors[3] * (alphas.w * after_three);
    (*sample).left = after_four;
    return false;
}
#endif

#ifdef MULTISAMPLED
#ifndef DEPTHS
// Blends a splat behind the nearest surface into a pixel whose samples have different surfaces.
fn blend_cut(sample: ptr<function, Sample>, alpha: f32, color: vec3<f32>, depth: f32, at: vec2<u32>) {
    if alpha == 0.0 || (*sample).left == 0.0 {
        return;
    }
    let passed = samples_before(at, depth);
    (*sample).hidden_left += f32(passed - (*sample).hidden) * (*sample).left;
    (*sample).hidden = passed;
    if passed == sample_count() {
        (*sample).left = 0.0;
        return;
    }
    blend_one(sample, alpha, color);
}
#endif
#endif

@compute @workgroup_size(THREADS)
#ifdef SUBGROUPS_OF_32
fn blend_blocks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(subgroup_id) subgroup: u32,
    @builtin(subgroup_invocation_id) lane: u32,
) {
    let thread = LANES * subgroup + lane;
#else
fn blend_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
#endif
    tile = group.xy;
    if thread == 0u {
        atomicStore(&finished, 0u);
        batch_a[BATCH] = vec4(0.0);
        batch_b[BATCH] = vec4(0.0, -1e9, 0.0, 0.0);
        batch_c[BATCH] = vec4(0.0);
    }
    // Of the workgroup: what is read from `tile` is not uniform for browsers.
    let range = tile_ranges[tile_index(group.xy, frame.tiles.x)];
    workgroupBarrier();
    let searching = range.x == NONE.x;
    let end = range.y;

    let block = thread / LANES;
    let at = tile * TILE_SIZE + corner_of(block) + vec2(thread % 8u, thread % LANES / 8u);
    let position = vec2<f32>(at);
#ifdef DEPTHS
    var pixel = begin_pixel(at);
    var done = pixel.done;
#else
    var sample: Sample;
    sample.left = 1.0;
    var done = any(at >= frame.size);
#ifdef MULTISAMPLED
    let surfaces = surface_range(at, !done);
    let limit = surfaces.x;
    let farthest = surfaces.y;
#else ifdef OPAQUE
    let limit = surface_depth(at, !done);
    let farthest = limit;
#endif
#endif
    if done {
        atomicAdd(&finished, 1u);
    }

    // The position of the last blended splat, for a search.
    var lower = FIRST;
    // The first pair of the batch. Threads from BATCH on load no splats.
    var first = range.x;
    let own = select(end, thread, thread < BATCH);
    var next: Splat;
#ifdef LARGE_BATCHES
    if !searching {
        next = load_pair(first + own, end);
    }
#endif
    var more = searching || first < end;
    while more {
        if searching {
            lower = search_batch(lower, thread);
            next = load_found(thread % BATCH);
#ifdef LARGE_BATCHES
        }
#else
        } else {
            next = load_pair(first + own, end);
        }
#endif
        if thread < BATCH {
            put_in_batch(next, thread);
        }
        workgroupBarrier();
        let queued = queue_splats(thread);
        if searching {
            more = any(lower != NONE);
        } else {
            first += BATCH;
            more = first < end;
#ifdef LARGE_BATCHES
            // Loaded while this batch is blended. With small batches, other workgroups run while this one waits for
            // memory.
            next = load_pair(first + own, end);
#endif
        }
        let queue = block * BATCH;
        if !done {
#ifdef EIGHT_AT_ONCE
            // The next splats of the queue are loaded before the current ones are blended: in a small picture too few
            // threads run to hide the memory latency.
            var near = queued_four(queue);
            var far = queued_four(queue + 4u);
            for (var i = AT_ONCE; i <= queued; i += AT_ONCE) {
                let next_near = queued_four(queue + i);
                let next_far = queued_four(queue + i + 4u);
                var near_alphas = batch_alphas(near, position);
                var far_alphas = batch_alphas(far, position);
#ifdef OPAQUE
                // The surface hides the splats behind it: this splat and all later ones, or some of these eight.
                let near_depths = batch_depths(near);
                if near_depths.x > farthest {
                    break;
                }
                near_alphas = select(near_alphas, vec4(0.0), near_depths > vec4(limit));
                far_alphas = select(far_alphas, vec4(0.0), batch_depths(far) > vec4(limit));
#endif
                if blend_four(&sample, near_alphas, batch_colors(near)) {
                    break;
                }
                if blend_four(&sample, far_alphas, batch_colors(far)) {
                    break;
                }
                near = next_near;
                far = next_far;
            }
#else
            for (var i = 0u; i < queued; i += AT_ONCE) {
                let four = queued_four(queue + i);
                var alphas = batch_alphas(four, position);
#ifdef DEPTHS
                blend_four(&pixel, alphas, four);
                if pixel.done {
                    break;
                }
#else
#ifdef OPAQUE
                // All surfaces of the pixel hide this splat and all later ones.
                let depths = batch_depths(four);
                if depths.x > farthest {
                    break;
                }
#ifdef MULTISAMPLED
                if surfaces.y > limit && any(depths > vec4(limit)) {
                    for (var j = 0u; j < 4u; j++) {
                        blend_cut(&sample, alphas[j], batch_color(four[j]), depths[j], at);
                    }
                    if sample.left == 0.0 {
                        break;
                    }
                    continue;
                }
#endif
                alphas = select(alphas, vec4(0.0), depths > vec4(limit));
#endif
                if blend_four(&sample, alphas, batch_colors(four)) {
                    break;
                }
#endif
            }
#endif
#ifdef DEPTHS
            done = pixel.done;
#else
            done = sample.left == 0.0;
#ifdef OPAQUE
            // The lists are in order of depth: all splats of later batches are hidden.
            done = done || batch_c[BATCH - 1u].y > farthest;
#endif
#endif
            if done {
                atomicAdd(&finished, 1u);
            }
        }
        if more {
            more = workgroupUniformLoad(&finished) < THREADS;
        }
    }
#ifdef DEPTHS
    finish_pixel(pixel, at);
#else
    if all(at < frame.size) {
        let transmittance = select(sample.left, sample.opaque_at, sample.left == 0.0);
#ifdef MULTISAMPLED
        let all = sample_count();
        let mean = (sample.hidden_left + f32(all - sample.hidden) * transmittance) / f32(all);
        let behind = transmittance * (1.0 - f32(samples_before(at, FAR)) / f32(all));
        write_color(sample.color, mean, behind, at);
#else ifdef OPAQUE
        write_color(sample.color, transmittance, select(0.0, transmittance, limit == FAR), at);
#else
        write_color(sample.color, transmittance, transmittance, at);
#endif
    }
#endif
}
