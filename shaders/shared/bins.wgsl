// The order of blending, the entries of tile bins, and the stamps of visible splats.
// In: depth, slot and tiles of a splat; the stamp of a frame; the uniform `binning`. Out: its depth key, the second word
// of its entry in a bin, the bits of the stamp, the grid of the bins.
#define_import_path gs4d::bins

// Bits of the slot in the second word of an entry. The other eight are the first and last column and row of the bin's
// tiles that the splat covers, x0, y0, x1, y1 of two bits each.
const SLOT_MASK: u32 = 0xffffffu;
// Positions before and after all splats in the order of blending; NONE also stands for no splat.
const FIRST: vec2<u32> = vec2(0u, 0xffffffffu);
const NONE: vec2<u32> = vec2(0xffffffffu, 0xffffffffu);

// Returns whether `a` comes after `b` in the order of blending: (depth key, slot).
fn is_after(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.x > b.x || (a.x == b.x && a.y > b.y);
}

// Returns the number of tiles along each side of a bin, of the uniform `binning`.
fn bin_side(binning: vec4<u32>) -> u32 {
    return binning.x & 0xffu;
}

// Returns the number of bins across and down a picture of so many tiles.
fn bin_grid(tiles: vec2<u32>, side: u32) -> vec2<u32> {
    return (tiles + side - 1u) / side;
}

// Returns the second word of an entry. `low` and `high` are the first and the last tile in the bin.
fn entry_word(slot: u32, low: vec2<u32>, high: vec2<u32>) -> u32 {
    return slot | (low.x << 24u) | (low.y << 26u) | (high.x << 28u) | (high.y << 30u);
}

// Returns the 16 bits of the stamp of a frame in the four highest bits of each half of a packed rectangle of tiles,
// whose coordinates are below 4096. Splats of other frames have other stamps (src/renderer/tile_bins/stamps.rs).
fn stamp_bits(stamp: u32) -> vec2<u32> {
    let low = ((stamp & 15u) << 12u) | (((stamp >> 4u) & 15u) << 28u);
    return vec2(low, (((stamp >> 8u) & 15u) << 12u) | (((stamp >> 12u) & 15u) << 28u));
}

const STAMP_MASK: u32 = 0xf000f000u;

// Returns a number that increases with the depth. Depths of orthographic cameras may be negative.
fn depth_order(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    return bits ^ select(0x80000000u, 0xffffffffu, (bits >> 31u) == 1u);
}
