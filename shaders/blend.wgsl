// blend: front to back over each tile of 16 x 16 pixels, one workgroup each.
// In: tile ranges, pairs, splats, the depth of opaque surfaces, the background. Out: color and transmittance, expected and median
// depth. Each sample of a multisampled depth hides the splats behind it in its fraction of the pixel. CPU reference:
// src/reference/blend.rs.
//
// If the buffer is too small for all pairs, the lists contain the pairs of the nearest splats. After its list, a tile then searches the
// remaining splats in depth order and blends the splats that cover it. The picture is the same.
#import gs4d::types::{Counters, SplatRecord}
#import gs4d::records::read_splat
#import gs4d::alpha::alpha_at
#import gs4d::pixel::{Pixel, begin_pixel, blend_splat, finish_pixel, frame, pass_surfaces}
#import gs4d::scan::{exclusive_scan, scan_total}
#import gs4d::tile::{covers_tile, pair_of_tile, pixel_of, tile_index}

const BATCH: u32 = 256u;

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

fn put_in_batch(place: u32, slot: u32) {
    let splat = read_splat(splats[slot]);
    batch_a[place] = vec4(splat.center, splat.opacity, splat.depth);
    batch_b[place] = splat.conic;
    batch_c[place] = splat.color;
}

// Blends the first `count` splats of the batch into a pixel and stops when the pixel is finished.
fn blend_batch(pixel: ptr<function, Pixel>, count: u32, position: vec2<f32>) {
    if !(*pixel).done {
        for (var i = 0u; i < count; i++) {
            let a = batch_a[i];
            if a.w > (*pixel).limit {
                pass_surfaces(pixel, a.w);
                if (*pixel).done {
                    break;
                }
            }
            blend_splat(pixel, alpha_at(batch_b[i], a.z, a.xy - position), batch_c[i], a.w);
            if (*pixel).done {
                break;
            }
        }
        if (*pixel).done {
            atomicAdd(&finished, 1u);
        }
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

// Returns whether a splat covers a tile and their pair was not written. `first` is the first pair of the splat, or the largest 32-bit number
// if the count of pairs overflowed.
fn lacks_pair(slot: u32, first: u32, tile: vec2<u32>) -> bool {
    let low = splats[slot].shape.w;
    let high = splats[slot].color.w;
    if !covers_tile(low, high, tile) {
        return false;
    }
    return first >= counters.pairs || pair_of_tile(low, high, tile) >= counters.pairs - first;
}

@compute @workgroup_size(256)
fn blend(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
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
    for (var first = range.x; first < range.y; first += BATCH) {
        // No thread changes `finished` between these barriers, so all threads exit the loop together.
        workgroupBarrier();
        if atomicLoad(&finished) == BATCH {
            break;
        }
        let mine = first + thread;
        if mine < range.y {
            put_in_batch(thread, pair_splats[mine]);
        }
        workgroupBarrier();
        blend_batch(&pixel, min(BATCH, range.y - first), position);
    }
    if counters.pairs < counters.pairs_wanted {
        for (var first = first_without_room(); first < counters.visible; first += BATCH) {
            // All threads exit the loop together: the next barrier is the first barrier of the scan.
            workgroupBarrier();
            if atomicLoad(&finished) == BATCH {
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
            blend_batch(&pixel, scan_total(), position);
        }
    }
    finish_pixel(pixel, at);
}
