// The sorted pairs of a finished frame, for passes that write results for each pair: `score` and `blend_backward`. The
// results are in the order in which `bin` emitted the pairs: the pairs of one splat are contiguous.
#define_import_path gs4d::pairs

#import gs4d::tile::pair_of_tile
#import gs4d::types::{Counters, FrameUniforms, SplatRecord}

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
@group(0) @binding(1) var<storage, read> counters: Counters;
@group(0) @binding(2) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> pair_splats: array<u32>;
@group(0) @binding(4) var<storage, read> splats: array<SplatRecord>;
@group(0) @binding(5) var<storage, read> order: array<u32>;
@group(0) @binding(6) var<storage, read> offsets: array<u32>;
// First pair of each slot.
@group(1) @binding(0) var<storage, read_write> first_pairs: array<u32>;

// Writes the first pair of visible splat `i` in depth order.
fn place_pairs(i: u32) {
    if i < counters.visible {
        first_pairs[order[i]] = offsets[i];
    }
}

// Returns the index that `bin` gave the pair of this splat and tile.
fn pair_of(splat: u32, tile: vec2<u32>) -> u32 {
    return first_pairs[splat] + pair_of_tile(splats[splat].shape.w, splats[splat].color.w, tile);
}
