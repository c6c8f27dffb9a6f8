// Entries of tile bins: a depth key, and a word with the slot of a splat and the tiles of the bin that it covers.
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

// Returns the second word of an entry. `low` and `high` are the first and the last tile in the bin.
fn entry_word(slot: u32, low: vec2<u32>, high: vec2<u32>) -> u32 {
    return slot | (low.x << 24u) | (low.y << 26u) | (high.x << 28u) | (high.y << 30u);
}

// Returns a stamp of the frame in the four highest bits of each half of a packed rectangle of tiles; tile coordinates
// are below 4096. Splats of other frames have other stamps.
fn stamp(frame: u32) -> vec2<u32> {
    let low = ((frame & 15u) << 12u) | (((frame >> 4u) & 15u) << 28u);
    return vec2(low, (((frame >> 8u) & 15u) << 12u) | (((frame >> 12u) & 15u) << 28u));
}

const STAMP_MASK: u32 = 0xf000f000u;

// Returns a number that increases with the depth. Depths of orthographic cameras may be negative.
fn depth_order(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    return bits ^ select(0x80000000u, 0xffffffffu, (bits >> 31u) == 1u);
}
