// bin: writes one pair for each overlap of a splat with a tile, in order of depth.
// In: splats and their order. Out: pairs (tile, splat), their number and the size of the dispatches over them. `count`
// sums the tiles of blocks of splats, `scan` sums the blocks, `offset` computes the first pair of each splat, and
// `emit` writes one pair per thread, so that a large splat does not delay other splats. CPU reference:
// src/reference/bin.rs.
#import gs4d::types::{Counters, FrameUniforms, SplatRecord}
#import gs4d::scan::{exclusive_scan, saturating_add, scan_total}
#import gs4d::tile::{tile_count, tile_index, tile_of_pair}

const SPLATS_PER_THREAD: u32 = 8u;
const BLOCK: u32 = 2048u;

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
@group(0) @binding(1) var<storage, read_write> counters: Counters;
@group(0) @binding(2) var<storage, read> splats: array<SplatRecord>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
// First pair of each splat in order; then one sum for each block, from `frame.slots` on.
@group(0) @binding(4) var<storage, read_write> offsets: array<u32>;
@group(0) @binding(5) var<storage, read_write> pair_tiles: array<u32>;
@group(0) @binding(6) var<storage, read_write> pair_splats: array<u32>;
@group(1) @binding(0) var<storage, read_write> arguments: array<u32>;

fn pair_count(splat: u32) -> u32 {
    return tile_count(splats[splat].shape.w, splats[splat].color.w);
}

// Returns the number of pairs of this thread's splats.
fn thread_sum(first: u32) -> u32 {
    var sum = 0u;
    for (var i = first; i < min(first + SPLATS_PER_THREAD, counters.visible); i++) {
        sum = saturating_add(sum, pair_count(order[i]));
    }
    return sum;
}

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) block: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    exclusive_scan(thread_sum(block.x * BLOCK + thread * SPLATS_PER_THREAD), thread);
    if thread == 0u {
        offsets[frame.slots + block.x] = scan_total();
    }
}

// One workgroup.
@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) thread: u32) {
    let blocks = (counters.visible + BLOCK - 1u) / BLOCK;
    let each = (blocks + 255u) / 256u;
    let first = frame.slots + min(thread * each, blocks);
    let last = frame.slots + min((thread + 1u) * each, blocks);
    var sum = 0u;
    for (var i = first; i < last; i++) {
        sum = saturating_add(sum, offsets[i]);
    }
    sum = exclusive_scan(sum, thread);
    for (var i = first; i < last; i++) {
        let item = offsets[i];
        offsets[i] = sum;
        sum = saturating_add(sum, item);
    }
    if thread == 0u {
        let wanted = scan_total();
        let pairs = min(wanted, frame.pair_capacity);
        counters.pairs_wanted = wanted;
        counters.pairs = pairs;
        arguments[3] = (pairs + BLOCK - 1u) / BLOCK;
        arguments[4] = 1u;
        arguments[5] = 1u;
    }
}

@compute @workgroup_size(256)
fn offset(@builtin(workgroup_id) block: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let first = block.x * BLOCK + thread * SPLATS_PER_THREAD;
    var at = saturating_add(offsets[frame.slots + block.x], exclusive_scan(thread_sum(first), thread));
    for (var i = first; i < min(first + SPLATS_PER_THREAD, counters.visible); i++) {
        offsets[i] = at;
        at = saturating_add(at, pair_count(order[i]));
    }
}

@compute @workgroup_size(256)
fn emit(@builtin(workgroup_id) block: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    for (var pair = block.x * BLOCK + thread; pair < min((block.x + 1u) * BLOCK, counters.pairs); pair += 256u) {
        // The last splat whose first pair is not after this one.
        var low = 0u;
        var high = counters.visible;
        while high - low > 1u {
            let mid = (low + high) / 2u;
            if offsets[mid] <= pair {
                low = mid;
            } else {
                high = mid;
            }
        }
        let splat = order[low];
        let tile = tile_of_pair(splats[splat].shape.w, splats[splat].color.w, pair - offsets[low]);
        pair_tiles[pair] = tile_index(tile, frame.tiles.x);
        pair_splats[pair] = splat;
    }
}
