// sort_blend: collects, sorts and blends the splats of one tile, one workgroup each: the second half of the fast renderer.
// In: the bins that `project_bin` filled (splats of 4 x 4 tiles each, in no order), splats, the depth of opaque surfaces, the
// background. Out: color and transmittance, expected and median depth; the counters of the next frame, cleared.
//
// The list of a tile is sorted by depth, then slot, in workgroup memory. A list that does not fit is processed in rounds,
// the nearest splats first, until every pixel is done or the list ends. If a bin was too small for its splats, its tiles
// search all splats instead. Both give the same picture, in more time.
#import gs4d::types::{SplatRecord, BIN_COUNTERS}
#import gs4d::alpha::ALPHA_MAX
#import gs4d::pixel::{Pixel, begin_pixel, blend_or_skip, blend_splat, finish_pixel, frame, pass_surfaces}
#import gs4d::tile::{energy_of, reaches, TILE_SIZE}

const THREADS: u32 = 256u;
const BATCH: u32 = 128u;
// Number of splats that are sorted at once.
#ifdef LONG_LISTS
const LIST: u32 = 2048u;
#else
const LIST: u32 = 1024u;
#endif
// Blocks of 8 x 4 pixels, one for each 32 threads.
const BLOCKS: u32 = THREADS / 32u;
const WORDS: u32 = BATCH / 32u;
const LOG2_E: f32 = 1.442695;
// A place after that of every splat; also marks what is no splat of this tile.
const NONE: vec2<u32> = vec2(0xffffffffu, 0xffffffffu);

@group(1) @binding(0) var<storage, read> splats: array<SplatRecord>;
@group(1) @binding(1) var<storage, read_write> bins: array<atomic<u32>>;
@group(1) @binding(2) var<storage, read> bin_entries: array<vec2<u32>>;

var<workgroup> keys: array<u32, LIST>;
var<workgroup> slots: array<u32, LIST>;
// Center, opacity, depth; conic scaled for exp2, least exponent that shows; color.
var<workgroup> batch_a: array<vec4<f32>, BATCH>;
var<workgroup> batch_b: array<vec4<f32>, BATCH>;
var<workgroup> batch_c: array<vec4<f32>, BATCH>;
// For each block, one bit for each splat of the batch that reaches it.
var<workgroup> reached: array<atomic<u32>, 32>;
var<workgroup> histogram: array<atomic<u32>, 256>;
var<workgroup> listed: atomic<u32>;
var<workgroup> valid: atomic<u32>;
var<workgroup> finished: atomic<u32>;
var<workgroup> least: atomic<u32>;
var<workgroup> greatest: atomic<u32>;
var<workgroup> bucket: vec2<u32>;

// Whether the candidates are all splats instead of those of the bin; their number; the first of them in `bin_entries`.
var<private> searching: bool;
var<private> candidates: u32;
var<private> first_entry: u32;
var<private> tile: vec2<u32>;

// Whether `a` comes after `b` in the order of blending: (depth key, slot).
fn is_after(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.x > b.x || (a.x == b.x && a.y > b.y);
}

// Returns a number with the order of the depth. Depths of orthographic cameras may be negative.
fn key_of(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    return bits ^ select(0x80000000u, 0xffffffffu, (bits >> 31u) == 1u);
}

// Returns the depth key of a splat; NONE.x if it does not reach this tile.
fn key_in_tile(slot: u32) -> u32 {
    let low = vec2<f32>(tile * TILE_SIZE);
    let energy = energy_of(splats[slot].opacity);
    let depth = splats[slot].depth;
    if !reaches(splats[slot].center, splats[slot].conic, energy, low, low + f32(TILE_SIZE - 1u)) {
        return NONE.x;
    }
    return key_of(depth);
}

// Returns the depth key and slot of candidate `i`; NONE if it is no splat of this tile.
fn candidate(i: u32) -> vec2<u32> {
    var slot = i;
    if !searching {
        let entry = bin_entries[first_entry + i];
        let at = tile % 4u;
        if ((entry.x >> (4u * at.y + at.x)) & 1u) == 0u {
            return NONE;
        }
        slot = entry.y;
    } else {
        let first = splats[slot].tiles_low;
        let last = splats[slot].tiles_high;
        if tile.x < (first & 0xffffu) || tile.y < (first >> 16u) || tile.x >= (last & 0xffffu) || tile.y >= (last >> 16u) {
            return NONE;
        }
    }
    let key = key_in_tile(slot);
    return select(vec2(key, slot), NONE, key == NONE.x);
}

fn list_entry(entry: vec2<u32>, bit: u32) {
    if ((entry.x >> bit) & 1u) == 1u {
        let place = atomicAdd(&listed, 1u);
        if place < LIST {
            slots[place] = entry.y;
        }
    }
}

// Lists all splats of the bin that may reach this tile, in no order, those that do not with the key NONE.x. Returns the
// length of the list and the number of splats that do; more than LIST do not fit.
fn collect_bin(thread: u32) -> vec2<u32> {
    if thread == 0u {
        atomicStore(&listed, 0u);
        atomicStore(&valid, 0u);
    }
    workgroupBarrier();
    let at = tile % 4u;
    let bit = 4u * at.y + at.x;
    // Four loads at a time, to hide their latency.
    let last = max(candidates, 1u) - 1u;
    for (var i = thread; i < candidates; i += 4u * THREADS) {
        let a = bin_entries[first_entry + i];
        let b = bin_entries[first_entry + min(i + THREADS, last)];
        let c = bin_entries[first_entry + min(i + 2u * THREADS, last)];
        let d = bin_entries[first_entry + min(i + 3u * THREADS, last)];
        list_entry(a, bit);
        if i + THREADS < candidates {
            list_entry(b, bit);
        }
        if i + 2u * THREADS < candidates {
            list_entry(c, bit);
        }
        if i + 3u * THREADS < candidates {
            list_entry(d, bit);
        }
    }
    let length = workgroupUniformLoad(&listed);
    if length <= LIST {
        for (var i = thread; i < length; i += THREADS) {
            let key = key_in_tile(slots[i]);
            keys[i] = key;
            if key != NONE.x {
                atomicAdd(&valid, 1u);
            }
        }
    }
    return vec2(length, workgroupUniformLoad(&valid));
}

// Lists the splats of this tile after `lower` and not after `upper`, in no order. Returns how many there are; those that do not fit are
// not listed.
fn collect(lower: vec2<u32>, upper: vec2<u32>, thread: u32) -> u32 {
    workgroupBarrier();
    if thread == 0u {
        atomicStore(&listed, 0u);
        atomicStore(&least, 0xffffffffu);
        atomicStore(&greatest, 0u);
    }
    workgroupBarrier();
    for (var i = thread; i < candidates; i += THREADS) {
        let found = candidate(i);
        if found.y != NONE.y && is_after(found, lower) && !is_after(found, upper) {
            let place = atomicAdd(&listed, 1u);
            if place < LIST {
                keys[place] = found.x;
                slots[place] = found.y;
            }
            atomicMin(&least, found.x);
            atomicMax(&greatest, found.x);
        }
    }
    return workgroupUniformLoad(&listed);
}

// The last place up to which the splats after `lower` fit the list: at least one does, as no two have the same slot.
fn fitting(lower: vec2<u32>, thread: u32) -> vec2<u32> {
    var low = workgroupUniformLoad(&least);
    var high = workgroupUniformLoad(&greatest);
    // Where more splats than fit have one depth, they are told apart by slot.
    var by_slot = false;
    var key = 0u;
    loop {
        let shift = max(32u - countLeadingZeros(high - low), 8u) - 8u;
        for (var i = thread; i < 256u; i += THREADS) {
            atomicStore(&histogram[i], 0u);
        }
        workgroupBarrier();
        for (var i = thread; i < candidates; i += THREADS) {
            let found = candidate(i);
            if found.y != NONE.y && is_after(found, lower) && (!by_slot || found.x == key) {
                let value = select(found.x, found.y, by_slot);
                if value >= low && value <= high {
                    atomicAdd(&histogram[(value - low) >> shift], 1u);
                }
            }
        }
        workgroupBarrier();
        if thread == 0u {
            var sum = 0u;
            var count = 0u;
            for (; count < 256u; count++) {
                let next = sum + atomicLoad(&histogram[count]);
                if next > LIST {
                    break;
                }
                sum = next;
            }
            bucket = vec2(count, sum);
        }
        let chosen = workgroupUniformLoad(&bucket);
        let start = low + (chosen.x << shift);
        if chosen.y > 0u {
            let last = select(start - 1u, high, chosen.x >= 256u || start - 1u > high || start == 0u);
            if by_slot {
                return vec2(key, last);
            }
            return vec2(last, 0xffffffffu);
        }
        if shift == 0u {
            by_slot = true;
            key = start;
            low = 0u;
            high = 0xfffffffeu;
        } else {
            low = start;
            high = min(high, start + ((1u << shift) - 1u));
        }
    }
    return NONE;
}

// Sorts the first `count` of the list by depth, then slot.
fn sort_list(count: u32, thread: u32) {
    var size = 2u;
    while size < count {
        size *= 2u;
    }
    for (var i = count + thread; i < size; i += THREADS) {
        keys[i] = NONE.x;
        slots[i] = NONE.y;
    }
    workgroupBarrier();
    for (var run = 2u; run <= size; run *= 2u) {
        for (var step = run / 2u; step > 0u; step /= 2u) {
            for (var i = thread; i < size / 2u; i += THREADS) {
                let a = 2u * i - (i & (step - 1u));
                let b = a + step;
                let one = vec2(keys[a], slots[a]);
                let other = vec2(keys[b], slots[b]);
                if is_after(one, other) == ((a & run) == 0u) {
                    keys[a] = other.x;
                    slots[a] = other.y;
                    keys[b] = one.x;
                    slots[b] = one.y;
                }
            }
            workgroupBarrier();
        }
    }
}

// Loads splats of the sorted list, `first` and up to BATCH - 1 after it, and marks the blocks that they reach.
fn load_batch(first: u32, count: u32, thread: u32) {
    if thread < BLOCKS * WORDS {
        atomicStore(&reached[thread], 0u);
    }
    workgroupBarrier();
    if thread < BATCH && first + thread < count {
        let splat = splats[slots[first + thread]];
        let energy = energy_of(splat.opacity);
        batch_a[thread] = vec4(splat.center, splat.opacity, splat.depth);
        batch_b[thread] = vec4(vec3(-0.5, -1.0, -0.5) * LOG2_E * splat.conic, -0.5 * LOG2_E * energy);
        batch_c[thread] = vec4(splat.color, 0.0);
        for (var block = 0u; block < BLOCKS; block++) {
            let low = vec2<f32>(tile * TILE_SIZE + corner_of(block));
            if reaches(splat.center, splat.conic, energy, low, low + vec2(7.0, 3.0)) {
                atomicOr(&reached[block * WORDS + thread / 32u], 1u << (thread % 32u));
            }
        }
    }
    workgroupBarrier();
}

// Returns the first pixel of a block in its tile.
fn corner_of(block: u32) -> vec2<u32> {
    return vec2(block % (TILE_SIZE / 8u) * 8u, block / (TILE_SIZE / 8u) * 4u);
}

// Returns the alpha of a splat of the batch, as alpha_at does, with the conic scaled for exp2; 0 if it is skipped.
fn batch_alpha(i: u32, position: vec2<f32>) -> f32 {
    let a = batch_a[i];
    let b = batch_b[i];
    let d = a.xy - position;
    let exponent = b.x * d.x * d.x + b.z * d.y * d.y + b.y * d.x * d.y;
    return select(min(ALPHA_MAX, a.z * exp2(exponent)), 0.0, exponent > 0.0 || exponent < b.w);
}

// Blends four splats of the batch; those with alpha 0 are skipped.
fn blend_four(pixel: ptr<function, Pixel>, alphas: vec4<f32>, four: vec4<u32>) {
    let depths = vec4(batch_a[four.x].w, batch_a[four.y].w, batch_a[four.z].w, batch_a[four.w].w);
    if any(depths > vec4((*pixel).limit)) {
        for (var i = 0u; i < 4u; i++) {
            if alphas[i] > 0.0 && !(*pixel).done {
                if depths[i] > (*pixel).limit {
                    pass_surfaces(pixel, depths[i]);
                }
                if !(*pixel).done {
                    blend_splat(pixel, alphas[i], batch_c[four[i]].xyz, depths[i]);
                }
            }
        }
        return;
    }
    blend_or_skip(pixel, alphas.x, batch_c[four.x].xyz, depths.x);
    blend_or_skip(pixel, alphas.y, batch_c[four.y].xyz, depths.y);
    blend_or_skip(pixel, alphas.z, batch_c[four.z].xyz, depths.z);
    blend_or_skip(pixel, alphas.w, batch_c[four.w].xyz, depths.w);
}

@compute @workgroup_size(THREADS)
fn sort_blend(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    tile = group.xy;
    let across = frame.binning.x;
    let capacity = frame.binning.y;
    let counters = frame.binning.z;
    let bin = tile.y / 4u * across + tile.x / 4u;
    let binned = atomicLoad(&bins[counters + BIN_COUNTERS + bin]);
    searching = binned > capacity;
    candidates = select(binned, frame.slots, searching);
    first_entry = bin * capacity;

    let block = thread / 32u;
    let at = tile * TILE_SIZE + corner_of(block) + vec2(thread % 8u, thread % 32u / 8u);
    let position = vec2<f32>(at);
    var pixel = begin_pixel(at);
    if thread == 0u {
        atomicStore(&finished, 0u);
        if all(tile % 4u == vec2(0u)) {
            atomicMax(&bins[counters + 2u], binned);
            atomicStore(&bins[frame.binning.w + BIN_COUNTERS + bin], 0u);
            if bin == 0u {
                for (var i = 0u; i < BIN_COUNTERS; i++) {
                    atomicStore(&bins[frame.binning.w + i], 0u);
                }
            }
        }
    }
    workgroupBarrier();
    if pixel.done {
        atomicAdd(&finished, 1u);
    }

    // The last place that has been blended.
    var lower = vec2(0u, 0xffffffffu);
    var first_round = !searching;
    loop {
        var total = 0u;
        var length = 0u;
        var count = 0u;
        var upper = NONE;
        if first_round {
            let found = collect_bin(thread);
            length = found.x;
            count = found.y;
            total = found.x;
        }
        if !first_round || length > LIST {
            total = collect(lower, NONE, thread);
            count = total;
            if total > LIST {
                upper = fitting(lower, thread);
                count = collect(lower, upper, thread);
            }
            length = count;
        }
        first_round = false;
        if thread == 0u && lower.x == 0u {
            atomicAdd(&bins[counters + 1u], count);
        }
        sort_list(length, thread);
        for (var first = 0u; first < count; first += BATCH) {
            if workgroupUniformLoad(&finished) == THREADS {
                break;
            }
            load_batch(first, count, thread);
            if !pixel.done {
                for (var word = 0u; word < WORDS; word++) {
                    var bits = atomicLoad(&reached[block * WORDS + word]);
                    while bits != 0u && !pixel.done {
                        // Four at a time: their exponentials do not wait for each other's blends.
                        let first_bit = firstTrailingBit(bits);
                        bits &= bits - 1u;
                        let second_bit = select(first_bit, firstTrailingBit(bits), bits != 0u);
                        let second = bits != 0u;
                        bits &= bits - 1u;
                        let third_bit = select(first_bit, firstTrailingBit(bits), bits != 0u);
                        let third = bits != 0u;
                        bits &= bits - 1u;
                        let fourth_bit = select(first_bit, firstTrailingBit(bits), bits != 0u);
                        let fourth = bits != 0u;
                        bits &= bits - 1u;
                        let four = word * 32u + vec4(first_bit, second_bit, third_bit, fourth_bit);
                        let alphas = vec4(
                            batch_alpha(four.x, position),
                            select(0.0, batch_alpha(four.y, position), second),
                            select(0.0, batch_alpha(four.z, position), third),
                            select(0.0, batch_alpha(four.w, position), fourth),
                        );
                        blend_four(&pixel, alphas, four);
                    }
                }
                if pixel.done {
                    atomicAdd(&finished, 1u);
                }
            }
        }
        if total <= LIST || workgroupUniformLoad(&finished) == THREADS {
            break;
        }
        lower = upper;
    }
    finish_pixel(pixel, at);
}
