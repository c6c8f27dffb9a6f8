// ranges: the first and the last pair of each tile.
// In: pairs sorted by tile. Out: first and last + 1 for each tile. CPU reference: `ranges` in src/reference/bin.rs.
#import gs4d::types::{Counters, FrameUniforms}

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
@group(0) @binding(1) var<storage, read> counters: Counters;
@group(0) @binding(2) var<storage, read> pair_tiles: array<u32>;
@group(0) @binding(3) var<storage, read_write> tile_ranges: array<vec2<u32>>;

// Returns the first pair whose tile is not below `tile`.
fn lower_bound(tile: u32) -> u32 {
    var low = 0u;
    var high = counters.pairs;
    while low < high {
        let mid = (low + high) / 2u;
        if pair_tiles[mid] < tile {
            low = mid + 1u;
        } else {
            high = mid;
        }
    }
    return low;
}

@compute @workgroup_size(256)
fn ranges(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < frame.tiles.x * frame.tiles.y {
        tile_ranges[id.x] = vec2(lower_bound(id.x), lower_bound(id.x + 1u));
    }
}
