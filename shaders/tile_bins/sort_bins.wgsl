// sort_bins: sorts the splats of one bin by depth, one workgroup per bin; the second pass of tile bins.
// In: the unordered bins that `project_bin` or `fill_bins` filled. Out: the pairs of each tile in order of depth, then
// slot, and the range of each tile; the counters of the next frame, cleared. If the buffers are too small for the
// splats of a bin or for the pairs of its tiles, their ranges are NONE: `blend_blocks` searches all splats instead.
//
// The list is sorted in workgroup memory: into buckets, then by rank in each bucket. Most depths of a bin may be close
// together, so the splats are first counted in a histogram of equal steps of depth, and the buckets are chosen to have
// about equal numbers of splats. A list longer than LIST is sorted in rounds of ROUND splats, the nearest first. If
// bins are counted before they are filled (COUNTED), some lists are much longer than others: their entries are first
// copied in order of parts, and read part by part.
#import gs4d::types::{FrameUniforms, BIN_COUNTERS}
#import gs4d::bins::{bin_grid, bin_side, is_after, FIRST, NONE, SLOT_MASK}
#import gs4d::nearest::{begin_search, clear_intervals, count_candidate, next_search}

// Largest number of splats that are sorted at once.
#ifdef LONG_LISTS
const THREADS: u32 = 512u;
const STEP_BITS: u32 = 9u;
const LIST: u32 = 5120u;
#else ifdef MEDIUM_LISTS
const THREADS: u32 = 512u;
const STEP_BITS: u32 = 9u;
const LIST: u32 = 2304u;
#else
const THREADS: u32 = 256u;
const STEP_BITS: u32 = 8u;
const LIST: u32 = 1280u;
#endif
// Largest number of splats of one round.
const ROUND: u32 = LIST / 2u;
// Threads of a group that sums its values first, and number of groups.
const LANES: u32 = 32u;
const GROUPS: u32 = THREADS / LANES;
// Steps of the histogram of depths, one for each thread: two to the power of STEP_BITS.
const STEPS: u32 = THREADS;
// Buckets of the sort, two for each thread. More buckets mean fewer comparisons.
const BUCKETS: u32 = 2u * THREADS;
// Bits of the fraction of a position in the list, and of the factor from positions to buckets.
const FRACTION_BITS: u32 = 16u;
const FACTOR_BITS: u32 = 10u;

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
// The counters of this frame, and those of the next, which are cleared.
@group(0) @binding(1) var<storage, read> bins: array<u32>;
@group(0) @binding(2) var<storage, read_write> next_bins: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read> bin_entries: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> tile_ranges: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> pair_splats: array<u32>;
#ifdef COUNTED
// Room for a copy of each entry.
@group(0) @binding(7) var<storage, read_write> ordered_entries: array<vec2<u32>>;
var<private> is_ordered: bool;
// The end of the last part that fits into a list, and of the first part.
var<workgroup> last_end: atomic<u32>;
var<workgroup> next_end: atomic<u32>;
#endif

// Before sorting: the depth keys of the list, unordered; in rounds also the second words of its entries, from ROUND on.
// After sorting: the second words, in order. The key at LIST is greater than all others.
var<workgroup> list: array<u32, LIST + 1u>;
// Low half: the index of a splat in its bucket, then its rank in the order. High half: the splat at this index of all
// buckets, followed by LIST.
var<workgroup> places: array<atomic<u32>, LIST + 1u>;
// Number of splats of each step, then number of splats in earlier steps.
var<workgroup> steps: array<atomic<u32>, STEPS + 1u>;
// Number of splats of each bucket, then the index of its first splat: two buckets per word.
var<workgroup> buckets: array<atomic<u32>, BUCKETS / 2u + 1u>;
#ifdef SUBGROUPS_OF_32
var<workgroup> group_sums: array<u32, GROUPS>;
var<workgroup> group_pairs: array<vec4<u32>, GROUPS>;
#else
var<workgroup> sums: array<u32, THREADS>;
var<workgroup> group_sums: array<u32, 4u * GROUPS>;
#endif
var<workgroup> listed: atomic<u32>;
var<workgroup> least: atomic<u32>;
var<workgroup> greatest: atomic<u32>;
// Least and greatest key of all entries of a bin that is sorted in rounds.
var<workgroup> least_of_all: atomic<u32>;
var<workgroup> greatest_of_all: atomic<u32>;
// Number of pairs of each tile in the list, and in the bin; the first pair of the bin, and the next pair of each tile.
var<workgroup> totals: array<vec4<u32>, 4>;
var<workgroup> counted: array<u32, 16>;
var<workgroup> first_pair: u32;
var<workgroup> next_pairs: array<u32, 16>;

// Four entries of a bin, which a thread loads at once.
struct FourEntries {
    keys: vec4<u32>,
    words: vec4<u32>,
}

// Returns an entry, from the ordered copy if there is one.
fn load_entry(i: u32) -> vec2<u32> {
#ifdef COUNTED
    if is_ordered {
        return ordered_entries[i];
    }
#endif
    return bin_entries[i];
}

// Returns entries `i`, `i + THREADS`, .. of a bin of `count` entries; indices are clamped to the last. The entries are
// loaded at once, so that a thread waits for memory once.
fn four_entries(first: u32, i: u32, count: u32) -> FourEntries {
    let at = first + min(vec4(i) + THREADS * vec4(0u, 1u, 2u, 3u), vec4(count - 1u));
    let a = load_entry(at.x);
    let b = load_entry(at.y);
    let c = load_entry(at.z);
    let d = load_entry(at.w);
    return FourEntries(vec4(a.x, b.x, c.x, d.x), vec4(a.y, b.y, c.y, d.y));
}

// Lists all entries from `first` to `first + count` if `whole`, otherwise the entries after `lower` and not after
// `upper`, which fit into a round. Returns their number.
fn collect(first: u32, count: u32, whole: bool, lower: vec2<u32>, upper: vec2<u32>, thread: u32) -> u32 {
    workgroupBarrier();
    if thread == 0u {
        atomicStore(&listed, select(0u, count, whole));
        atomicStore(&least, 0xffffffffu);
        atomicStore(&greatest, 0u);
    }
    workgroupBarrier();
    var low = 0xffffffffu;
    var high = 0u;
    for (var begin = thread; begin < count; begin += 4u * THREADS) {
        let four = four_entries(first, begin, count);
        for (var k = 0u; k < 4u && begin + k * THREADS < count; k++) {
            let key = four.keys[k];
            if whole {
                list[begin + k * THREADS] = key;
            } else {
                let place = vec2(key, four.words[k] & SLOT_MASK);
                if !is_after(place, lower) || is_after(place, upper) {
                    continue;
                }
                let at = atomicAdd(&listed, 1u);
                list[at] = key;
                list[ROUND + at] = four.words[k];
            }
            low = min(low, key);
            high = max(high, key);
        }
    }
#ifdef SUBGROUPS_OF_32
    low = subgroupMin(low);
    high = subgroupMax(high);
    if thread % LANES == 0u {
        atomicMin(&least, low);
        atomicMax(&greatest, high);
    }
#else
    atomicMin(&least, low);
    atomicMax(&greatest, high);
#endif
    return workgroupUniformLoad(&listed);
}

// Returns the last position up to which the entries of a bin after `lower` fit into a round.
fn last_fitting(first: u32, count: u32, lower: vec2<u32>, thread: u32) -> vec2<u32> {
    let least_key = max(lower.x, workgroupUniformLoad(&least_of_all));
    var search = begin_search(lower, least_key, workgroupUniformLoad(&greatest_of_all));
    while !search.found {
        clear_intervals(thread);
        for (var begin = thread; begin < count; begin += 4u * THREADS) {
            let four = four_entries(first, begin, count);
            for (var k = 0u; k < 4u && begin + k * THREADS < count; k++) {
                count_candidate(search, vec2(four.keys[k], four.words[k] & SLOT_MASK));
            }
        }
        search = next_search(search, ROUND, thread);
    }
    return search.last;
}

// Returns the sum of the values of all threads before this one. A value may hold two 16-bit numbers whose sums stay
// below 65536.
fn sum_before(value: u32, thread: u32) -> u32 {
#ifdef SUBGROUPS_OF_32
    var sum = subgroupExclusiveAdd(value);
    workgroupBarrier();
    if thread % LANES == LANES - 1u {
        group_sums[thread / LANES] = sum + value;
    }
    workgroupBarrier();
    for (var i = 0u; i < GROUPS; i++) {
        sum += select(0u, group_sums[i], i < thread / LANES);
    }
    return sum;
#else
    workgroupBarrier();
    sums[thread] = value;
    workgroupBarrier();
    if thread < GROUPS {
        var sum = 0u;
        for (var i = LANES * thread; i < LANES * (thread + 1u); i++) {
            let own = sums[i];
            sums[i] = sum;
            sum += own;
        }
        group_sums[thread] = sum;
    }
    workgroupBarrier();
    if thread == 0u {
        sum_groups(0u);
    }
    workgroupBarrier();
    return group_sums[thread / LANES] + sums[thread];
#endif
}

#ifndef SUBGROUPS_OF_32
// Loops of sums begin and end at numbers that depend on the thread, so that no compiler unrolls them: a software driver
// would compile this pass for a minute in place of seconds.

// Replaces the sum of each group by that of the groups before it. `first` is the number of the first group.
fn sum_groups(first: u32) {
    var sum = 0u;
    for (var i = first; i < first + GROUPS; i++) {
        let own = group_sums[i];
        group_sums[i] = sum;
        sum += own;
    }
}

// Returns the sums of four values over all threads before this one. Overwrites `places`.
fn four_before(values: vec4<u32>, thread: u32) -> vec4<u32> {
    workgroupBarrier();
    for (var k = 0u; k < 4u; k++) {
        atomicStore(&places[k * THREADS + thread], values[k]);
    }
    workgroupBarrier();
    if thread < 4u * GROUPS {
        var sum = 0u;
        for (var i = LANES * thread; i < LANES * (thread + 1u); i++) {
            let own = atomicLoad(&places[i]);
            atomicStore(&places[i], sum);
            sum += own;
        }
        group_sums[thread] = sum;
    }
    workgroupBarrier();
    if thread < 4u {
        sum_groups(GROUPS * thread);
    }
    workgroupBarrier();
    var before: vec4<u32>;
    for (var k = 0u; k < 4u; k++) {
        before[k] = group_sums[k * GROUPS + thread / LANES] + atomicLoad(&places[k * THREADS + thread]);
    }
    return before;
}
#endif

// Returns the width of a step as a power of two: the least with which keys up to `range` above the least key are in
// STEPS steps.
fn step_width(range: u32) -> u32 {
    return max(32u - countLeadingZeros(range), STEP_BITS) - STEP_BITS;
}

// Returns the bucket of a key that is `offset` above the least key, below BUCKETS. It increases monotonically with the
// key. `width` is the result of `step_width`, `factor` is (BUCKETS << FACTOR_BITS) / the number of keys. The bucket is
// computed from integers: drivers may round floating-point expressions differently in each place where they inline this
// function.
fn bucket_of(offset: u32, width: u32, factor: u32) -> u32 {
    let first = atomicLoad(&steps[offset >> width]);
    let count = atomicLoad(&steps[(offset >> width) + 1u]) - first;
    // The position of the key in its step, from 0 to 1.
    let wider = max(width, FRACTION_BITS);
    let fraction = ((offset & ((1u << width) - 1u)) << (wider - width)) >> (wider - FRACTION_BITS);
    // Less than the number of keys. Six bits fewer, so that the product is below 2^32.
    let position = ((first << FRACTION_BITS) + fraction * count) >> 6u;
    return (position * factor) >> (FRACTION_BITS - 6u + FACTOR_BITS);
}

// Adds a splat to the count of a bucket. Returns the previous count.
fn count_in(bucket: u32) -> u32 {
    let half = 16u * (bucket & 1u);
    return (atomicAdd(&buckets[bucket / 2u], 1u << half) >> half) & 0xffffu;
}

// Returns the index of the first splat of a bucket.
fn first_of(bucket: u32) -> u32 {
    return (atomicLoad(&buckets[bucket / 2u]) >> (16u * (bucket & 1u))) & 0xffffu;
}

// Returns the second word of the entry of a splat in the list, as `collect` listed it.
fn word_of(i: u32, first: u32, whole: bool) -> u32 {
    if whole {
        return load_entry(first + i).y;
    }
    return list[ROUND + i];
}

// Sorts the first `count` keys of the list and replaces them by the second words of their entries, in order.
fn sort_list(first: u32, count: u32, whole: bool, thread: u32) {
    atomicStore(&steps[thread], 0u);
    atomicStore(&buckets[thread], 0u);
    if thread == 0u {
        list[LIST] = 0xffffffffu;
        atomicStore(&places[count], LIST << 16u);
    }
    let low = workgroupUniformLoad(&least);
    let width = step_width(workgroupUniformLoad(&greatest) - low);
    let factor = (BUCKETS << FACTOR_BITS) / count;
    for (var i = thread; i < count; i += THREADS) {
        atomicAdd(&steps[(list[i] - low) >> width], 1u);
    }
    workgroupBarrier();
    let before_step = sum_before(atomicLoad(&steps[thread]), thread);
    atomicStore(&steps[thread], before_step);
    if thread == 0u {
        atomicStore(&steps[STEPS], count);
        atomicStore(&buckets[BUCKETS / 2u], count);
    }
    workgroupBarrier();
    for (var i = thread; i < count; i += THREADS) {
        atomicStore(&places[i], count_in(bucket_of(list[i] - low, width, factor)));
    }
    workgroupBarrier();
    let two = atomicLoad(&buckets[thread]);
    let before_two = sum_before((two & 0xffffu) + (two >> 16u), thread);
    atomicStore(&buckets[thread], before_two * 0x10001u + (two << 16u));
    workgroupBarrier();
    for (var i = thread; i < count; i += THREADS) {
        let bucket = bucket_of(list[i] - low, width, factor);
        let place = first_of(bucket) + (atomicLoad(&places[i]) & 0xffffu);
        atomicOr(&places[place], i << 16u);
    }
    workgroupBarrier();
    for (var i = thread; i < count; i += THREADS) {
        let own = list[i];
        let bucket = bucket_of(own - low, width, factor);
        let begin = first_of(bucket);
        let end = first_of(bucket + 1u);
        // Two at a time, which halves the number of waits for memory. The element after the last has a greater key.
        var less = vec2(0u);
        var same = vec2(0u);
        for (var k = begin; k < end; k += 2u) {
            let others = vec2(atomicLoad(&places[k]), atomicLoad(&places[k + 1u])) >> vec2(16u);
            let keys = vec2(list[others.x], list[others.y]);
            less += select(vec2(0u), vec2(1u), keys < vec2(own));
            same += select(vec2(0u), vec2(1u), keys == vec2(own));
        }
        var place = begin + less.x + less.y;
        // The splat itself is one of the equal keys.
        if same.x + same.y > 1u {
            for (var k = begin; k < end; k++) {
                let other = atomicLoad(&places[k]) >> 16u;
                if list[other] == own && other != i && comes_before(other, i, first, whole) {
                    place++;
                }
            }
        }
        // Only this thread writes the low half; other threads read the high half.
        atomicStore(&places[i], (atomicLoad(&places[i]) & 0xffff0000u) | place);
    }
    workgroupBarrier();
    if whole {
        for (var begin = thread; begin < count; begin += 4u * THREADS) {
            let four = four_entries(first, begin, count);
            for (var k = 0u; k < 4u && begin + k * THREADS < count; k++) {
                list[atomicLoad(&places[begin + k * THREADS]) & 0xffffu] = four.words[k];
            }
        }
    } else {
        for (var i = thread; i < count; i += THREADS) {
            list[atomicLoad(&places[i]) & 0xffffu] = list[ROUND + i];
        }
    }
    workgroupBarrier();
}

// Returns whether splat `a` comes before splat `b` of the same depth: the order of their slots.
fn comes_before(a: u32, b: u32, first: u32, whole: bool) -> bool {
    return (word_of(a, first, whole) & SLOT_MASK) < (word_of(b, first, whole) & SLOT_MASK);
}

// Returns the number of tiles along each side of a bin.
fn side() -> u32 {
    return bin_side(frame.binning);
}

// Returns the coordinates of a tile in its bin. Tiles are numbered row by row.
fn tile_in_bin(number: u32) -> vec2<u32> {
    return vec2(number % side(), number / side());
}

// Returns the tiles of a bin that an entry covers, one bit per tile.
fn tiles_covered(word: u32) -> u32 {
    let columns = (1u << (((word >> 28u) & 3u) + 1u)) - (1u << ((word >> 24u) & 3u));
    let rows = (1u << (side() * ((word >> 30u) + 1u))) - (1u << (side() * ((word >> 26u) & 3u)));
    // The first tile of each row.
    return columns * (rows & select(0x5u, 0x1111u, side() == 4u));
}

// Expands sixteen bits to sixteen bytes, four per word. A thread sums fewer than 256 of them.
fn in_bytes(bits: u32) -> vec4<u32> {
    let fours = (vec4(bits) >> vec4(0u, 4u, 8u, 12u)) & vec4(15u);
    // Four copies of the four bits, seven bits apart: bit k of copy k is the lowest bit of byte k.
    return (fours * 0x00204081u) & vec4(0x01010101u);
}

// Expands the eight bytes of two words to 16-bit numbers, two per word.
fn halves(bytes: vec2<u32>) -> vec4<u32> {
    let pairs = vec4(bytes.x, bytes.x >> 16u, bytes.y, bytes.y >> 16u);
    return (pairs & vec4(0xffu)) | ((pairs & vec4(0xff00u)) << vec4(8u));
}

// Returns the four 16-bit numbers of two words.
fn quarters(low: u32, high: u32) -> vec4<u32> {
    return vec4(low & 0xffffu, low >> 16u, high & 0xffffu, high >> 16u);
}

// Returns the sums of eight 16-bit numbers, two per word, over all threads before this one. Writes the sums over all
// threads to the totals of tiles `number` to `number + 8`.
fn sums_before(eight: vec4<u32>, number: u32, thread: u32) -> vec4<u32> {
    var before: vec4<u32>;
#ifdef SUBGROUPS_OF_32
    before = subgroupExclusiveAdd(eight);
    let own_group = thread / LANES;
    if thread % LANES == LANES - 1u {
        group_pairs[own_group] = before + eight;
    }
    workgroupBarrier();
    for (var i = 0u; i < own_group; i++) {
        before += group_pairs[i];
    }
#else
    before = four_before(eight, thread);
#endif
    if thread == THREADS - 1u {
        let all = before + eight;
        totals[number / 4u] = quarters(all.x, all.y);
        totals[number / 4u + 1u] = quarters(all.z, all.w);
    }
    workgroupBarrier();
    return before;
}

// Returns the number of pairs of earlier threads with each tile of the bin, two per word: tiles 0 to 7, then 8 to 15.
// `own` is the number of pairs of this thread, one byte per tile.
fn pairs_before(own: vec4<u32>, thread: u32) -> array<vec4<u32>, 2> {
    var before = array(sums_before(halves(own.xy), 0u, thread), vec4(0u));
    if side() == 4u {
        before[1] = sums_before(halves(own.zw), 8u, thread);
    }
    return before;
}

// Reserves room for pairs. Returns the first pair; NONE if there is too little room. The counter cannot wrap:
// `project_bin` has counted the pairs of the frame, and none are written if they are 2^32 or more. A loop of compare
// and exchange would make all bins wait for one another.
fn reserve_pairs(count: u32) -> u32 {
    if bins[1] > 0u {
        return NONE.x;
    }
    let first = atomicAdd(&next_bins[6], count);
    let fits = count <= frame.pair_capacity && first <= frame.pair_capacity - count;
    return select(NONE.x, first, fits);
}

// Reserves room for `counted` pairs of each tile of the bin with the first tile `corner`, and writes their ranges.
fn reserve(corner: vec2<u32>, thread: u32) {
    let tiles = side() * side();
    var before = 0u;
    var total = 0u;
    // A constant count, so that all sixteen are loaded at once.
    for (var number = 0u; number < 16u; number++) {
        let more = select(0u, counted[number], number < tiles);
        before += select(0u, more, number < thread);
        total += more;
    }
    if thread == 0u {
        first_pair = reserve_pairs(total);
    }
    let reserved = workgroupUniformLoad(&first_pair);
    if thread < tiles {
        let own = select(reserved + before, NONE.x, reserved == NONE.x);
        next_pairs[thread] = own;
        write_range(corner, thread, select(vec2(own, own + counted[thread]), NONE, reserved == NONE.x));
    }
    workgroupBarrier();
}

fn write_range(corner: vec2<u32>, number: u32, range: vec2<u32>) {
    let tile = corner + tile_in_bin(number);
    if number < side() * side() && all(tile < frame.tiles) {
        // As `tile_index`, whose module has functions that compute with floats.
        tile_ranges[tile.y * frame.tiles.x + tile.x] = range;
    }
}

// Writes a pair for each of four tiles whose bit is set in `bits`, and advances the index of the next pair of the tile.
fn put_pairs(pairs: ptr<function, vec4<u32>>, bits: u32, slot: u32) {
    let hit = (vec4(bits) >> vec4(0u, 1u, 2u, 3u)) & vec4(1u);
    for (var k = 0u; k < 4u; k++) {
        if hit[k] == 1u {
            pair_splats[(*pairs)[k]] = slot;
        }
    }
    *pairs += hit;
}

// Returns the indices of the next pairs of four tiles.
fn next_four(number: u32) -> vec4<u32> {
    return vec4(next_pairs[number], next_pairs[number + 1u], next_pairs[number + 2u], next_pairs[number + 3u]);
}

// Writes the pairs of the sorted list with all tiles of a bin. Reserves space for them first unless `reserved`.
fn write_pairs(count: u32, corner: vec2<u32>, reserved: bool, thread: u32) {
    let each = (count + THREADS - 1u) / THREADS;
    let first = min(thread * each, count);
    let end = min(first + each, count);
    var own = vec4(0u);
    for (var i = first; i < end; i++) {
        own += in_bytes(tiles_covered(list[i]));
    }
    let before = pairs_before(own, thread);
    if !reserved {
        count_all(thread, true);
        reserve(corner, thread);
    }
    if next_pairs[0] != NONE.x {
        var pairs0 = next_four(0u) + quarters(before[0].x, before[0].y);
        var pairs1 = next_four(4u) + quarters(before[0].z, before[0].w);
        var pairs2 = next_four(8u) + quarters(before[1].x, before[1].y);
        var pairs3 = next_four(12u) + quarters(before[1].z, before[1].w);
        for (var i = first; i < end; i++) {
            let slot = list[i] & SLOT_MASK;
            let covered = tiles_covered(list[i]);
            put_pairs(&pairs0, covered, slot);
            if side() == 4u {
                put_pairs(&pairs1, covered >> 4u, slot);
                put_pairs(&pairs2, covered >> 8u, slot);
                put_pairs(&pairs3, covered >> 12u, slot);
            }
        }
    }
    workgroupBarrier();
    if thread < side() * side() && next_pairs[thread] != NONE.x {
        next_pairs[thread] += totals[thread / 4u][thread % 4u];
    }
}

// Adds the totals of `pairs_before` to the number of pairs of each tile. `start`: the number is reset first.
fn count_all(thread: u32, start: bool) {
    if thread < side() * side() {
        let more = totals[thread / 4u][thread % 4u];
        counted[thread] = select(counted[thread], 0u, start) + more;
    }
    workgroupBarrier();
}

// Reserves space for the pairs of all entries of a bin, and finds the least and the greatest key.
fn reserve_all(first: u32, count: u32, corner: vec2<u32>, thread: u32) {
    if thread == 0u {
        atomicStore(&least_of_all, 0xffffffffu);
        atomicStore(&greatest_of_all, 0u);
    }
    workgroupBarrier();
    var least_key = 0xffffffffu;
    var greatest_key = 0u;
    // In chunks whose counts fit into 16 bits.
    for (var begin = 0u; begin < count; begin += 32768u) {
        let end = min(count, begin + 32768u);
        var own = vec4(0u);
        for (var i = begin + thread; i < end; i += 4u * THREADS) {
            let four = four_entries(first, i, end);
            for (var k = 0u; k < 4u && i + k * THREADS < end; k++) {
                least_key = min(least_key, four.keys[k]);
                greatest_key = max(greatest_key, four.keys[k]);
                own += in_bytes(tiles_covered(four.words[k]));
            }
        }
        pairs_before(own, thread);
        count_all(thread, begin == 0u);
    }
    atomicMin(&least_of_all, least_key);
    atomicMax(&greatest_of_all, greatest_key);
    reserve(corner, thread);
}

#ifdef COUNTED
// Returns the number, below THREADS, of the part of a bin that contains the key `offset` above the least key. A part
// has about `each` splats; parts are in order of depth. `steps` has the numbers of splats in earlier steps.
fn part_of(offset: u32, width: u32, each: u32) -> u32 {
    let before = atomicLoad(&steps[offset >> width]);
    let count = atomicLoad(&steps[(offset >> width) + 1u]) - before;
    // The position of the key in its step, from 0 to 1, with as many bits as the product has room for.
    let bits = min(min(countLeadingZeros(count), width), 16u);
    let fraction = (offset & ((1u << width) - 1u)) >> (width - bits);
    return (before + ((fraction * count) >> bits)) / each;
}

// Copies the entries of a bin in order of parts. Returns the end of the part that has the number of the thread.
fn order_parts(first: u32, count: u32, thread: u32) -> u32 {
    atomicStore(&steps[thread], 0u);
    atomicStore(&buckets[thread], 0u);
    let low = workgroupUniformLoad(&least_of_all);
    let width = step_width(workgroupUniformLoad(&greatest_of_all) - low);
    for (var begin = thread; begin < count; begin += 4u * THREADS) {
        let four = four_entries(first, begin, count);
        for (var k = 0u; k < 4u && begin + k * THREADS < count; k++) {
            atomicAdd(&steps[(four.keys[k] - low) >> width], 1u);
        }
    }
    workgroupBarrier();
    let before_step = sum_before(atomicLoad(&steps[thread]), thread);
    atomicStore(&steps[thread], before_step);
    if thread == 0u {
        atomicStore(&steps[STEPS], count);
    }
    workgroupBarrier();
    let each = count / THREADS + 1u;
    for (var begin = thread; begin < count; begin += 4u * THREADS) {
        let four = four_entries(first, begin, count);
        for (var k = 0u; k < 4u && begin + k * THREADS < count; k++) {
            atomicAdd(&buckets[part_of(four.keys[k] - low, width, each)], 1u);
        }
    }
    workgroupBarrier();
    let own = atomicLoad(&buckets[thread]);
    let before = sum_before(own, thread);
    atomicStore(&buckets[thread], before);
    workgroupBarrier();
    for (var begin = thread; begin < count; begin += 4u * THREADS) {
        let four = four_entries(first, begin, count);
        for (var k = 0u; k < 4u && begin + k * THREADS < count; k++) {
            let place = atomicAdd(&buckets[part_of(four.keys[k] - low, width, each)], 1u);
            ordered_entries[first + place] = vec2(four.keys[k], four.words[k]);
        }
    }
    storageBarrier();
    workgroupBarrier();
    is_ordered = true;
    return before + own;
}

// Returns the end of the last part after `begin` up to which the entries fit into a list; if none fits, of the first.
// `end` is the end of the part that has the number of the thread.
fn end_of_round(begin: u32, end: u32, thread: u32) -> u32 {
    if thread == 0u {
        atomicStore(&last_end, 0u);
        atomicStore(&next_end, 0xffffffffu);
    }
    workgroupBarrier();
    if end > begin {
        atomicMin(&next_end, end);
        if end - begin <= LIST {
            atomicMax(&last_end, end);
        }
    }
    return max(workgroupUniformLoad(&last_end), workgroupUniformLoad(&next_end));
}
#endif

// Sorts entries of a bin and writes their pairs, all at once if `whole`, otherwise in rounds, for which pairs have been
// reserved.
fn sort_in_rounds(first: u32, all: u32, whole: bool, corner: vec2<u32>, reserved: bool, thread: u32) {
    // The last position that has been sorted, and the number of entries up to it.
    var lower = FIRST;
    var done = 0u;
    while done < all {
        var upper = NONE;
        if !whole && all - done > ROUND {
            upper = last_fitting(first, all, lower, thread);
        }
        let count = collect(first, all, whole, lower, upper, thread);
        sort_list(first, count, whole, thread);
        write_pairs(count, corner, reserved, thread);
        done += count;
        lower = upper;
    }
}

// Sorts entries of a bin and writes their pairs. `reserved`: pairs have been reserved, as they must be for more than
// LIST entries. With subgroups, lists have a copy of the code without rounds, which saves 0.6 % of a frame; a software
// driver would compile that copy for seconds.
fn sort_entries(first: u32, all: u32, corner: vec2<u32>, reserved: bool, thread: u32) {
#ifdef SUBGROUPS_OF_32
    if all <= LIST {
        sort_list(first, collect(first, all, true, FIRST, NONE, thread), true, thread);
        write_pairs(all, corner, reserved, thread);
    } else {
        sort_in_rounds(first, all, false, corner, true, thread);
    }
#else
    sort_in_rounds(first, all, all <= LIST, corner, reserved, thread);
#endif
}

@compute @workgroup_size(THREADS)
#ifdef SUBGROUPS_OF_32
fn sort_bins(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(subgroup_id) subgroup: u32,
    @builtin(subgroup_invocation_id) lane: u32,
) {
    let thread = LANES * subgroup + lane;
#else
fn sort_bins(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
#endif
    let first_bin = BIN_COUNTERS + frame.binning.w;
    let grid = bin_grid(frame.tiles, side());
    let bin = group.y * grid.x + group.x;
    let binned = bins[first_bin + bin];
    if thread == 0u {
        atomicMax(&next_bins[5], binned);
        atomicStore(&next_bins[first_bin + bin], 0u);
        if bin == 0u {
            atomicStore(&next_bins[0], 0u);
            atomicStore(&next_bins[1], 0u);
            atomicStore(&next_bins[2], 0u);
            var visible = 0u;
            for (var part = 0u; part < frame.binning.w; part++) {
                visible += bins[BIN_COUNTERS + part];
                atomicStore(&next_bins[BIN_COUNTERS + part], 0u);
            }
            atomicStore(&next_bins[3], visible);
            atomicStore(&next_bins[4], select(bins[0], 0xffffffffu, bins[1] > 0u));
        }
    }
#ifdef COUNTED
    // The place of the bin is after its last entry.
    let last = bins[first_bin + grid.x * grid.y + bin];
    let first = last - binned;
    let fits = last <= min(arrayLength(&bin_entries), arrayLength(&ordered_entries));
#else
    let first = bin * frame.binning.y;
    let fits = binned <= frame.binning.y;
#endif
    let corner = side() * group.xy;
    if binned == 0u || !fits {
        if thread < side() * side() {
            write_range(corner, thread, select(NONE, vec2(0u), binned == 0u));
        }
        return;
    }
#ifdef COUNTED
    let is_long = binned > LIST;
    var end_of_part = binned;
    if is_long {
        reserve_all(first, binned, corner, thread);
        end_of_part = order_parts(first, binned, thread);
    }
    var begin = 0u;
    while begin < binned {
        var end = binned;
        if is_long {
            end = end_of_round(begin, end_of_part, thread);
        }
        sort_entries(first + begin, end - begin, corner, is_long, thread);
        begin = end;
    }
#else
    let is_long = binned > LIST;
    if is_long {
        reserve_all(first, binned, corner, thread);
    }
    sort_entries(first, binned, corner, is_long, thread);
#endif
}
