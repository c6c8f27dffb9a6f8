// The nearest of many splats that fit a list, by counting splats in intervals of the order of blending (depth key, slot).
// In: for each step, the candidates. Out: the last place up to which those after `lower` fit. At least one does, as no two have the
// same slot.
//
//     var search = begin_search(lower, least, greatest);
//     while !search.found {
//         clear_intervals(thread);
//         for each candidate: count_candidate(search, candidate);
//         search = next_search(search, room, thread);
//     }
//
// Every thread of the workgroup must call these, but for count_candidate.
#define_import_path gs4d::nearest

#import gs4d::bins::is_after

const INTERVALS: u32 = 256u;
// Intervals are summed in groups of as many by a thread each.
const GROUPED: u32 = 16u;

struct Search {
    // The place before all candidates, and the range of keys that is divided; of slots if many splats have one key.
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
// The first interval that does not fit, and the number of candidates before it.
var<workgroup> fitting: vec2<u32>;

// Starts the search among the candidates after `lower`, which have keys from `low` to `high`.
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
        // More splats than fit have one depth: they are told apart by slot.
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
