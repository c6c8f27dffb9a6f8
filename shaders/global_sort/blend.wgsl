// blend: front to back over each tile of 16 x 16 pixels, one workgroup each.
// In: tile ranges, pairs, splats, the depth of opaque surfaces, the background. Out: color and transmittance, expected
// and median depth. Each sample of a multisampled depth hides the splats behind it in its fraction of the pixel. CPU
// reference: src/reference/blend.rs.
//
// If the buffer is too small for all pairs, the lists contain the pairs of the nearest splats. After its list, a tile
// then searches the remaining splats in depth order and blends the splats that cover it. The picture is the same.
#import gs4d::types::{Counters, SplatRecord}
#import gs4d::records::read_splat
#import gs4d::alpha::alpha_at
#import gs4d::pixel::{Pixel, begin_pixel, blend_splat, finish_pixel, frame, pass_surfaces}
#import gs4d::scan::{exclusive_scan, scan_total}
#import gs4d::tile::{covers_tile, pair_of_tile, pixel_of, tile_index}

const BATCH: u32 = 256u;
#ifdef SIXTEEN_AT_ONCE
const MANY: u32 = 16u;
#endif
#ifdef SIXTY_FOUR_AT_ONCE
const MANY: u32 = 64u;
#endif
// Splats of a tile that are blended in an iteration each. With many at once, all later splats are blended in iterations
// of MANY.
const ONE_BY_ONE: u32 = 8192u;

@group(1) @binding(0) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(1) @binding(1) var<storage, read> pair_splats: array<u32>;
@group(1) @binding(2) var<storage, read> splats: array<SplatRecord>;
@group(1) @binding(3) var<storage, read> counters: Counters;
// The visible splats by depth, and the first pair of each.
@group(1) @binding(4) var<storage, read> order: array<u32>;
@group(1) @binding(5) var<storage, read> offsets: array<u32>;

// Center, opacity, depth; conic; color.
var<workgroup> batch_a: array<vec4<f32>, 256>;
var<workgroup> batch_b: array<vec3<f32>, 256>;
var<workgroup> batch_c: array<vec3<f32>, 256>;
// Number of finished pixels of this tile.
var<workgroup> finished: atomic<u32>;
#ifdef SUBGROUPS_OF_8
// Place of this thread in its subgroup.
var<private> lane: u32;
#endif

fn put_in_batch(place: u32, slot: u32) {
    let splat = read_splat(splats[slot]);
    batch_a[place] = vec4(splat.center, splat.opacity, splat.depth);
    batch_b[place] = splat.conic;
    batch_c[place] = splat.color;
}

// Blends a splat, the values of a batch, into a pixel that is not finished.
fn blend_values(pixel: ptr<function, Pixel>, a: vec4<f32>, b: vec3<f32>, c: vec3<f32>, position: vec2<f32>) {
    if a.w > (*pixel).limit {
        pass_surfaces(pixel, a.w);
        if (*pixel).done {
            return;
        }
    }
    blend_splat(pixel, alpha_at(b, a.z, a.xy - position), c, a.w);
}

// Blends splat `i` of the batch into a pixel that is not finished.
fn blend_one(pixel: ptr<function, Pixel>, i: u32, position: vec2<f32>) {
    blend_values(pixel, batch_a[i], batch_b[i], batch_c[i], position);
}

// Blends the first `count` splats of the batch, one after the other.
#ifdef SUBGROUPS_OF_8
fn blend_batch(pixel: ptr<function, Pixel>, count: u32, at: vec2<f32>) {
    for (var i = 0u; i < count; i += 8u) {
        if subgroupAll((*pixel).done) {
            break;
        }
        // Software drivers load from memory thread by thread: each thread loads one of eight splats for all.
        let own = min(i + lane, count - 1u);
        let a = batch_a[own];
        let b = batch_b[own];
        let c = batch_c[own];
        let left = count - i;
        blend_shared(pixel, subgroupBroadcast(a, 0u), subgroupBroadcast(b, 0u), subgroupBroadcast(c, 0u), 0u < left, at);
        blend_shared(pixel, subgroupBroadcast(a, 1u), subgroupBroadcast(b, 1u), subgroupBroadcast(c, 1u), 1u < left, at);
        blend_shared(pixel, subgroupBroadcast(a, 2u), subgroupBroadcast(b, 2u), subgroupBroadcast(c, 2u), 2u < left, at);
        blend_shared(pixel, subgroupBroadcast(a, 3u), subgroupBroadcast(b, 3u), subgroupBroadcast(c, 3u), 3u < left, at);
        blend_shared(pixel, subgroupBroadcast(a, 4u), subgroupBroadcast(b, 4u), subgroupBroadcast(c, 4u), 4u < left, at);
        blend_shared(pixel, subgroupBroadcast(a, 5u), subgroupBroadcast(b, 5u), subgroupBroadcast(c, 5u), 5u < left, at);
        blend_shared(pixel, subgroupBroadcast(a, 6u), subgroupBroadcast(b, 6u), subgroupBroadcast(c, 6u), 6u < left, at);
        blend_shared(pixel, subgroupBroadcast(a, 7u), subgroupBroadcast(b, 7u), subgroupBroadcast(c, 7u), 7u < left, at);
    }
}

// Blends a splat that a thread of the subgroup loaded, unless it is not `wanted` or the pixel is finished.
fn blend_shared(
    pixel: ptr<function, Pixel>, a: vec4<f32>, b: vec3<f32>, c: vec3<f32>, wanted: bool, position: vec2<f32>,
) {
    if wanted && !(*pixel).done {
        blend_values(pixel, a, b, c, position);
    }
}
#else
fn blend_batch(pixel: ptr<function, Pixel>, count: u32, position: vec2<f32>) {
    for (var i = 0u; i < count && !(*pixel).done; i++) {
        blend_one(pixel, i, position);
    }
}
#endif

// Blends splat `i`, unless it is not below `count` or the pixel is finished.
fn blend_if_open(pixel: ptr<function, Pixel>, i: u32, count: u32, position: vec2<f32>) {
    if i < count && !(*pixel).done {
        blend_one(pixel, i, position);
    }
}

fn blend_4(pixel: ptr<function, Pixel>, i: u32, count: u32, position: vec2<f32>) {
    blend_if_open(pixel, i, count, position);
    blend_if_open(pixel, i + 1u, count, position);
    blend_if_open(pixel, i + 2u, count, position);
    blend_if_open(pixel, i + 3u, count, position);
}

fn blend_16(pixel: ptr<function, Pixel>, i: u32, count: u32, position: vec2<f32>) {
    blend_4(pixel, i, count, position);
    blend_4(pixel, i + 4u, count, position);
    blend_4(pixel, i + 8u, count, position);
    blend_4(pixel, i + 12u, count, position);
}

// Blends MANY splats from `i` on, those below `count`. Each call is expanded, not a loop: see `AtOnce` in
// src/renderer/shaders.rs.
#ifdef SIXTEEN_AT_ONCE
fn blend_many(pixel: ptr<function, Pixel>, i: u32, count: u32, position: vec2<f32>) {
    blend_16(pixel, i, count, position);
}
#endif
#ifdef SIXTY_FOUR_AT_ONCE
fn blend_many(pixel: ptr<function, Pixel>, i: u32, count: u32, position: vec2<f32>) {
    blend_16(pixel, i, count, position);
    blend_16(pixel, i + 16u, count, position);
    blend_16(pixel, i + 32u, count, position);
    blend_16(pixel, i + 48u, count, position);
}
#endif

// Loads the batch of the pairs from `first` to `end`, unless all pixels of the tile are finished. Returns whether the
// batch was loaded.
fn load_batch(first: u32, end: u32, thread: u32) -> bool {
    if workgroupUniformLoad(&finished) == BATCH {
        return false;
    }
    if first + thread < end {
        put_in_batch(thread, pair_splats[first + thread]);
    }
    workgroupBarrier();
    return true;
}

// Counts a pixel that has been finished since it was `open`.
fn count_finished(pixel: ptr<function, Pixel>, open: bool) {
    if open && (*pixel).done {
        atomicAdd(&finished, 1u);
    }
}

// Returns the index in depth order of the first splat with a pair that was not written.
fn first_without_room() -> u32 {
    var low = 0u;
    var high = counters.visible;
    while high - low > 1u {
        let mid = (low + high) / 2u;
        if offsets[mid] <= counters.pairs {
            low = mid;
        } else {
            high = mid;
        }
    }
    return low;
}

// Returns whether a splat covers a tile and their pair was not written. `first` is the first pair of the splat, or the
// largest 32-bit number if the count of pairs overflowed.
fn lacks_pair(slot: u32, first: u32, tile: vec2<u32>) -> bool {
    let low = splats[slot].shape.w;
    let high = splats[slot].color.w;
    if !covers_tile(low, high, tile) {
        return false;
    }
    return first >= counters.pairs || pair_of_tile(low, high, tile) >= counters.pairs - first;
}

@compute @workgroup_size(256)
#ifdef SUBGROUPS_OF_8
fn blend(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
    @builtin(subgroup_invocation_id) place: u32,
) {
    lane = place;
#else
fn blend(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
#endif
    let at = pixel_of(tile.xy, thread);
    let position = vec2<f32>(at);
    let range = tile_ranges[tile_index(tile.xy, frame.tiles.x)];
    var pixel = begin_pixel(at);
    if thread == 0u {
        atomicStore(&finished, 0u);
    }
    workgroupBarrier();
    if pixel.done {
        atomicAdd(&finished, 1u);
    }
#ifdef MANY_AT_ONCE
    let end = min(range.y, range.x + ONE_BY_ONE);
#else
    let end = range.y;
#endif
    for (var first = range.x; first < end; first += BATCH) {
        if !load_batch(first, end, thread) {
            break;
        }
        let open = !pixel.done;
        blend_batch(&pixel, min(BATCH, end - first), position);
        count_finished(&pixel, open);
    }
#ifdef MANY_AT_ONCE
    for (var first = end; first < range.y; first += MANY) {
        let i = (first - end) % BATCH;
        if i == 0u {
            if !load_batch(first, range.y, thread) {
                break;
            }
        }
        let open = !pixel.done;
        blend_many(&pixel, i, i + range.y - first, position);
        count_finished(&pixel, open);
    }
#endif
    if counters.pairs < counters.pairs_wanted {
        for (var first = first_without_room(); first < counters.visible; first += BATCH) {
            if workgroupUniformLoad(&finished) == BATCH {
                break;
            }
            let mine = first + thread;
            var found = false;
            if mine < counters.visible {
                found = lacks_pair(order[mine], offsets[mine], tile.xy);
            }
            let place = exclusive_scan(select(0u, 1u, found), thread);
            if found {
                put_in_batch(place, order[mine]);
            }
            workgroupBarrier();
            let open = !pixel.done;
#ifdef MANY_AT_ONCE
            for (var i = 0u; i < scan_total() && !pixel.done; i += MANY) {
                blend_many(&pixel, i, scan_total(), position);
            }
#else
            blend_batch(&pixel, scan_total(), position);
#endif
            count_finished(&pixel, open);
        }
    }
    finish_pixel(pixel, at);
}
