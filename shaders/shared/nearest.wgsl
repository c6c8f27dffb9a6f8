// Selection of the nearest splats that fit into a list, by counting splats in intervals of the order of blending (depth
// key, slot).
// In: for each step, the candidates. Out: the last position up to which the candidates after `lower` fit. At least one
// candidate fits, as slots are unique.
//
//     var search = begin_search(lower, least, greatest);
//     while !search.found {
//         clear_intervals(thread);
//         for each candidate: count_candidate(search, candidate);
//         search = next_search(search, room, thread);
//     }
//
// Every thread of the workgroup must call these functions, except count_candidate.
#define_import_path gs4d::nearest

#import gs4d::bins::is_after

const INTERVALS: u32 = 256u;
// Intervals are summed in groups of this number, one thread per group.
const GROUPED: u32 = 16u;

struct Search {
    // The position before all candidates, and the range that is divided: of depth keys, or of slots if more splats than
    // fit have key `key`.
    lower: vec2<u32>,
    low: u32,
    high: u32,
    by_slot: bool,
    key: u32,
    // Whether `last` is the result.
    found: bool,
    last: vec2<u32>,
}

var<workgroup> intervals: array<atomic<u32>, INTERVALS>;
var<workgroup> grouped: array<u32, INTERVALS / GROUPED>;
// The first interval that does not fit, and the number of candidates in earlier intervals.
var<workgroup> fitting: vec2<u32>;

// Returns the initial search among the candidates after `lower`, which have keys from `low` to `high`.
fn begin_search(lower: vec2<u32>, low: u32, high: u32) -> Search {
    return Search(lower, low, high, false, 0u, false, vec2(0u));
}

// Returns the width of an interval as a power of two.
fn interval_bits(search: Search) -> u32 {
    return max(32u - countLeadingZeros(search.high - search.low), 8u) - 8u;
}

fn clear_intervals(thread: u32) {
    if thread < INTERVALS {
        atomicStore(&intervals[thread], 0u);
    }
    workgroupBarrier();
}

fn count_candidate(search: Search, candidate: vec2<u32>) {
    if !is_after(candidate, search.lower) || (search.by_slot && candidate.x != search.key) {
        return;
    }
    let value = select(candidate.x, candidate.y, search.by_slot);
    if value >= search.low && value <= search.high {
        atomicAdd(&intervals[(value - search.low) >> interval_bits(search)], 1u);
    }
}

// Returns the search with the result, or with the range that the next step divides.
fn next_search(search: Search, room: u32, thread: u32) -> Search {
    workgroupBarrier();
    if thread < INTERVALS / GROUPED {
        var sum = 0u;
        for (var i = 0u; i < GROUPED; i++) {
            sum += atomicLoad(&intervals[thread * GROUPED + i]);
        }
        grouped[thread] = sum;
    }
    workgroupBarrier();
    if thread == 0u {
        var sum = 0u;
        var count = 0u;
        for (; count < INTERVALS; count += GROUPED) {
            let next = sum + grouped[count / GROUPED];
            if next > room {
                break;
            }
            sum = next;
        }
        for (; count < INTERVALS; count++) {
            let next = sum + atomicLoad(&intervals[count]);
            if next > room {
                break;
            }
            sum = next;
        }
        fitting = vec2(count, sum);
    }
    let fits = workgroupUniformLoad(&fitting);
    let bits = interval_bits(search);
    let start = search.low + (fits.x << bits);
    var next = search;
    if fits.y > 0u {
        let all = fits.x >= INTERVALS || start - 1u > search.high || start == 0u;
        let last = select(start - 1u, search.high, all);
        next.found = true;
        next.last = select(vec2(last, 0xffffffffu), vec2(search.key, last), search.by_slot);
    } else if bits == 0u {
        // More splats than fit have the same depth: the search continues by slot.
        next.by_slot = true;
        next.key = start;
        next.low = 0u;
        next.high = 0xfffffffeu;
    } else {
        next.low = start;
        next.high = min(search.high, start + ((1u << bits) - 1u));
    }
    return next;
}
