// sort_bins: sorts the splats of one bin by depth, one workgroup each: the second pass of the fast renderer.
// In: the bins that `project_bin` filled, in no order. Out: the pairs of each tile in order of depth, then slot, and the range of each
// tile; the counters of the next frame, cleared. If there is no room for the splats of a bin or for the pairs of its tiles, their
// ranges are NONE: `blend_blocks` searches all splats instead.
//
// The list is sorted in workgroup memory: into buckets, then by rank in each bucket. Most depths of a bin may be close together, so
// the splats are counted in steps of equal width first, and the buckets are chosen so that each has about as many splats. A list
// that does not fit is sorted in rounds of half as many splats, the nearest first.
#import gs4d::types::{FrameUniforms, BIN_COUNTERS}
#import gs4d::bins::{covers, is_after, FIRST, NONE, SLOT_MASK}
#import gs4d::nearest::{begin_search, clear_intervals, count_candidate, next_search}

// Splats that are sorted at once.
#ifdef LONG_LISTS
const THREADS: u32 = 512u;
const LIST: u32 = 5120u;
#else ifdef MEDIUM_LISTS
const THREADS: u32 = 512u;
const LIST: u32 = 2304u;
#else
const THREADS: u32 = 256u;
const LIST: u32 = 1280u;
#endif
// Splats of one round.
const ROUND: u32 = LIST / 2u;
const LANES: u32 = 32u;
// Steps and buckets of the sort, one for each thread.
const BUCKETS: u32 = THREADS;

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
// The counters of this frame, and those of the next, which are cleared.
@group(0) @binding(1) var<storage, read> bins: array<u32>;
@group(0) @binding(2) var<storage, read_write> next_bins: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read> bin_entries: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> tile_ranges: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> pair_splats: array<u32>;

// First the depth keys of the list, in no order, and in rounds the second words of its entries from ROUND on; then the second
// words, in order.
var<workgroup> list: array<u32, LIST>;
// Low half: first the place of a splat in its bucket, then its place in the order. High half: the index of the splat at this
// place of all buckets.
var<workgroup> places: array<atomic<u32>, LIST>;
// Number of splats of each step, then of those before it.
var<workgroup> steps: array<atomic<u32>, BUCKETS + 1u>;
// Number of splats of each bucket, then its first place.
var<workgroup> buckets: array<atomic<u32>, BUCKETS + 1u>;
#ifndef SUBGROUPS_OF_32
var<workgroup> sums: array<u32, THREADS>;
#endif
var<workgroup> group_sums: array<u32, THREADS / LANES>;
var<workgroup> listed: atomic<u32>;
var<workgroup> least: atomic<u32>;
var<workgroup> greatest: atomic<u32>;
var<workgroup> own_count: u32;
// Number of pairs of four tiles, two in each word, and the next pair of each.
var<workgroup> totals: vec2<u32>;
var<workgroup> next_pairs: array<vec4<u32>, 4>;

// Lists entries `first` to `first + count` of the bin if `whole`, else those after `lower` and not after `upper`. Returns how
// many there are; those that do not fit a round are not listed.
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
    for (var i = thread; i < count; i += THREADS) {
        let entry = bin_entries[first + i];
        let place = vec2(entry.x, entry.y & SLOT_MASK);
        var at = i;
        if !whole {
            if !is_after(place, lower) || is_after(place, upper) {
                continue;
            }
            at = atomicAdd(&listed, 1u);
        }
        low = min(low, entry.x);
        high = max(high, entry.x);
        if whole {
            list[at] = entry.x;
        } else if at < ROUND {
            list[at] = entry.x;
            list[ROUND + at] = entry.y;
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

// The last place up to which the entries of a bin after `lower` fit a round.
fn last_fitting(first: u32, count: u32, lower: vec2<u32>, thread: u32) -> vec2<u32> {
    var search = begin_search(lower, workgroupUniformLoad(&least), workgroupUniformLoad(&greatest));
    while !search.found {
        clear_intervals(thread);
        for (var i = thread; i < count; i += THREADS) {
            let entry = bin_entries[first + i];
            count_candidate(search, vec2(entry.x, entry.y & SLOT_MASK));
        }
        search = next_search(search, ROUND, thread);
    }
    return search.last;
}

// Returns the sum of the values of all threads before this one. Two numbers below 65536 in one value do not disturb each other.
fn sum_before(value: u32, thread: u32) -> u32 {
    var sum = 0u;
#ifdef SUBGROUPS_OF_32
    sum = subgroupExclusiveAdd(value);
    workgroupBarrier();
    if thread % LANES == LANES - 1u {
        group_sums[thread / LANES] = sum + value;
    }
    workgroupBarrier();
    for (var i = 0u; i < THREADS / LANES; i++) {
        sum += select(0u, group_sums[i], i < thread / LANES);
    }
#else
    workgroupBarrier();
    sums[thread] = value;
    workgroupBarrier();
    if thread < THREADS / LANES {
        var group = 0u;
        for (var i = 0u; i < LANES; i++) {
            group += sums[LANES * thread + i];
        }
        group_sums[thread] = group;
    }
    workgroupBarrier();
    for (var i = 0u; i < THREADS / LANES; i++) {
        sum += select(0u, group_sums[i], i < thread / LANES);
    }
    for (var i = 0u; i < LANES; i++) {
        sum += select(0u, sums[thread / LANES * LANES + i], i < thread % LANES);
    }
#endif
    return sum;
}

// Returns the step of a key, and how far in it the key is.
fn step_of(key: u32, low: u32, scale: f32) -> vec2<f32> {
    let at = f32(key - low) * scale;
    return vec2(floor(at), fract(at));
}

// Returns the bucket of a key; greater keys have the same or greater buckets.
fn bucket_of(key: u32, low: u32, scale: f32, share: f32) -> u32 {
    let step = step_of(key, low, scale);
    let first = atomicLoad(&steps[u32(step.x)]);
    let count = atomicLoad(&steps[u32(step.x) + 1u]) - first;
    return min(u32((f32(first) + step.y * f32(count)) * share), BUCKETS - 1u);
}

// Returns the second word of the entry of a splat in the list, as `collect` listed it.
fn word_of(i: u32, first: u32, whole: bool) -> u32 {
    if whole {
        return bin_entries[first + i].y;
    }
    return list[ROUND + i];
}

// Sorts the first `count` of the list: it becomes the second words of their entries, in order.
fn sort_list(first: u32, count: u32, whole: bool, thread: u32) {
    atomicStore(&steps[thread], 0u);
    atomicStore(&buckets[thread], 0u);
    let low = workgroupUniformLoad(&least);
    let scale = f32(BUCKETS - 1u) / max(f32(workgroupUniformLoad(&greatest) - low), 1.0);
    let share = f32(BUCKETS) / f32(count);
    for (var i = thread; i < count; i += THREADS) {
        atomicAdd(&steps[u32(step_of(list[i], low, scale).x)], 1u);
    }
    workgroupBarrier();
    let before_step = sum_before(atomicLoad(&steps[thread]), thread);
    atomicStore(&steps[thread], before_step);
    if thread == 0u {
        atomicStore(&steps[BUCKETS], count);
        atomicStore(&buckets[BUCKETS], count);
    }
    workgroupBarrier();
    for (var i = thread; i < count; i += THREADS) {
        atomicStore(&places[i], atomicAdd(&buckets[bucket_of(list[i], low, scale, share)], 1u));
    }
    workgroupBarrier();
    let before_bucket = sum_before(atomicLoad(&buckets[thread]), thread);
    atomicStore(&buckets[thread], before_bucket);
    workgroupBarrier();
    for (var i = thread; i < count; i += THREADS) {
        let bucket = bucket_of(list[i], low, scale, share);
        let place = atomicLoad(&buckets[bucket]) + (atomicLoad(&places[i]) & 0xffffu);
        atomicOr(&places[place], i << 16u);
    }
    workgroupBarrier();
    for (var i = thread; i < count; i += THREADS) {
        let own = list[i];
        let bucket = bucket_of(own, low, scale, share);
        let begin = atomicLoad(&buckets[bucket]);
        let end = atomicLoad(&buckets[bucket + 1u]);
        var place = begin;
        for (var k = begin; k < end; k++) {
            let other = atomicLoad(&places[k]) >> 16u;
            let key = list[other];
            if key < own || (key == own && other != i && comes_before(other, i, first, whole)) {
                place++;
            }
        }
        // Only this thread changes this half; the others read the high one.
        atomicStore(&places[i], (atomicLoad(&places[i]) & 0xffff0000u) | place);
    }
    workgroupBarrier();
    if whole {
        for (var i = thread; i < count; i += THREADS) {
            list[atomicLoad(&places[i]) & 0xffffu] = bin_entries[first + i].y;
        }
    } else {
        for (var i = thread; i < count; i += THREADS) {
            list[atomicLoad(&places[i]) & 0xffffu] = list[ROUND + i];
        }
    }
    workgroupBarrier();
}

// Whether one of two splats of the same depth comes before the other: by slot.
fn comes_before(a: u32, b: u32, first: u32, whole: bool) -> bool {
    return (word_of(a, first, whole) & SLOT_MASK) < (word_of(b, first, whole) & SLOT_MASK);
}

// Returns the number of tiles along each side of a bin.
fn side() -> u32 {
    return frame.binning.x & 0xffu;
}

// Returns a tile of a bin; they are numbered row by row.
fn tile_in_bin(number: u32) -> vec2<u32> {
    return vec2(number % side(), number / side());
}

// Returns which of four tiles from `number` on an entry covers, 0 or 1.
fn covered(word: u32, number: u32) -> vec4<u32> {
    let hit = vec4(
        covers(word, tile_in_bin(number)),
        covers(word, tile_in_bin(number + 1u)),
        covers(word, tile_in_bin(number + 2u)),
        covers(word, tile_in_bin(number + 3u)),
    );
    return select(vec4(0u), vec4(1u), hit);
}

fn halves(four: vec4<u32>) -> vec2<u32> {
    return four.xz | (four.yw << vec2(16u));
}

fn whole(two: vec2<u32>) -> vec4<u32> {
    return vec4(two.x & 0xffffu, two.x >> 16u, two.y & 0xffffu, two.y >> 16u);
}

// Returns the sums of four small numbers over all threads before this one, and over all threads in `totals`.
fn sums_before(four: vec4<u32>, thread: u32) -> vec4<u32> {
    let two = halves(four);
    let before = vec2(sum_before(two.x, thread), sum_before(two.y, thread));
    if thread == THREADS - 1u {
        totals = before + two;
    }
    return whole(before);
}

// Reserves room for pairs of four tiles from `number` on, of the bin with the first tile `corner`, and writes their ranges.
fn reserve(counts: vec4<u32>, corner: vec2<u32>, number: u32) {
    let before = vec4(0u, counts.x, counts.x + counts.y, counts.x + counts.y + counts.z);
    let total = before.w + counts.w;
    let first = atomicAdd(&next_bins[5], total);
    let fits = first + total <= frame.pair_capacity;
    let firsts = first + before;
    for (var i = 0u; i < 4u; i++) {
        write_range(corner, number + i, select(NONE, vec2(firsts[i], firsts[i] + counts[i]), fits));
    }
    next_pairs[number / 4u] = select(vec4(NONE.x), firsts, fits);
}

fn write_range(corner: vec2<u32>, number: u32, range: vec2<u32>) {
    let tile = corner + tile_in_bin(number);
    if number < side() * side() && all(tile < frame.tiles) {
        tile_ranges[tile.y * frame.tiles.x + tile.x] = range;
    }
}

// Writes the pairs of the sorted list of all tiles of a bin, after reserving room for them if there is none.
fn write_pairs(count: u32, corner: vec2<u32>, reserved: bool, thread: u32) {
    let each = (count + THREADS - 1u) / THREADS;
    let first = min(thread * each, count);
    let end = min(first + each, count);
    for (var number = 0u; number < side() * side(); number += 4u) {
        var own = vec4(0u);
        for (var i = first; i < end; i++) {
            own += covered(list[i], number);
        }
        let before = sums_before(own, thread);
        workgroupBarrier();
        if !reserved && thread == 0u {
            reserve(whole(totals), corner, number);
        }
        workgroupBarrier();
        let firsts = next_pairs[number / 4u];
        if firsts.x != NONE.x {
            var pairs = firsts + before;
            for (var i = first; i < end; i++) {
                let word = list[i];
                let hit = covered(word, number);
                for (var k = 0u; k < 4u; k++) {
                    if hit[k] == 1u {
                        pair_splats[pairs[k]] = word & SLOT_MASK;
                    }
                }
                pairs += hit;
            }
        }
        workgroupBarrier();
        if thread == 0u && firsts.x != NONE.x {
            next_pairs[number / 4u] = firsts + whole(totals);
        }
    }
}

// Reserves room for the pairs of all entries of a bin.
fn reserve_all(first: u32, count: u32, corner: vec2<u32>, thread: u32) {
    for (var number = 0u; number < side() * side(); number += 4u) {
        var counts = vec4(0u);
        // As many as the halves of words have room for.
        for (var begin = 0u; begin < count; begin += 32768u) {
            var own = vec4(0u);
            for (var i = begin + thread; i < min(count, begin + 32768u); i += THREADS) {
                own += covered(bin_entries[first + i].y, number);
            }
            sums_before(own, thread);
            workgroupBarrier();
            counts += whole(totals);
            workgroupBarrier();
        }
        if thread == 0u {
            reserve(counts, corner, number);
        }
    }
    workgroupBarrier();
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
    let capacity = frame.binning.y;
    let first_bin = BIN_COUNTERS + frame.binning.w;
    let bin = group.y * ((frame.tiles.x + side() - 1u) / side()) + group.x;
    if thread == 0u {
        own_count = bins[first_bin + bin];
        atomicMax(&next_bins[4], own_count);
        atomicStore(&next_bins[first_bin + bin], 0u);
        if bin == 0u {
            atomicStore(&next_bins[0], 0u);
            atomicStore(&next_bins[1], 0u);
            atomicStore(&next_bins[2], bins[0]);
            atomicStore(&next_bins[3], bins[1]);
            for (var part = 0u; part < frame.binning.w; part++) {
                atomicStore(&next_bins[BIN_COUNTERS + part], 0u);
            }
        }
    }
    let binned = workgroupUniformLoad(&own_count);
    let corner = side() * group.xy;
    if binned == 0u || binned > capacity {
        if thread < side() * side() {
            write_range(corner, thread, select(NONE, vec2(0u), binned == 0u));
        }
        return;
    }
    let first = bin * capacity;
    if binned <= LIST {
        sort_list(first, collect(first, binned, true, FIRST, NONE, thread), true, thread);
        write_pairs(binned, corner, false, thread);
        return;
    }
    reserve_all(first, binned, corner, thread);
    // The last place that has been sorted, and the number of entries up to there.
    var lower = FIRST;
    var done = 0u;
    while done < binned {
        var upper = NONE;
        if collect(first, binned, false, lower, NONE, thread) > ROUND {
            upper = last_fitting(first, binned, lower, thread);
        }
        let count = collect(first, binned, false, lower, upper, thread);
        sort_list(first, count, false, thread);
        write_pairs(count, corner, true, thread);
        done += count;
        lower = upper;
    }
}
