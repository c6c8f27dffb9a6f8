// sort: one step of a stable radix sort by four bits, for any subgroup size.
// In: keys and values. Out: both, ordered by the digit at `sort_step.shift`; equal digits keep their order. `count`
// counts the digits of a block of 2048 keys, `scan` sums the counts of all blocks, and `scatter` ranks the keys of a
// block and moves them. `visible` writes the number of keys that the first step kept. CPU reference:
// src/reference/sort.rs.
#import gs4d::types::{Counters, FrameUniforms, SortStep, INVISIBLE, SORT_SLOTS, SORT_VISIBLE}
#import gs4d::scan::{exclusive_scan, scan_total}

const KEYS_PER_THREAD: u32 = 8u;
const BLOCK: u32 = 2048u;
const NO_DIGIT: u32 = 16u;

@group(0) @binding(0) var<uniform> sort_step: SortStep;
@group(0) @binding(1) var<uniform> frame: FrameUniforms;
@group(0) @binding(2) var<storage, read_write> counters: Counters;
@group(0) @binding(3) var<storage, read> keys_in: array<u32>;
@group(0) @binding(4) var<storage, read> values_in: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;
// Digit by digit, `sort_step.stride` blocks each; then one total for each digit.
@group(0) @binding(7) var<storage, read_write> histogram: array<u32>;
@group(1) @binding(0) var<storage, read_write> arguments: array<u32>;

// Counts of digits d (low half) and d + 8 (high half) for each thread, digit by digit; 16 threads padded to 17.
var<workgroup> counts: array<u32, 2176>;
// Their sums over 16 threads.
var<workgroup> groups: array<u32, 128>;
// Index in the output of the first key of this block with each digit.
var<workgroup> starts: array<u32, 16>;

fn key_count() -> u32 {
    if sort_step.source == SORT_SLOTS {
        return frame.slots;
    }
    return select(counters.pairs, counters.visible, sort_step.source == SORT_VISIBLE);
}

fn digit_of(at: u32, count: u32) -> u32 {
    if at >= count {
        return NO_DIGIT;
    }
    let key = keys_in[at];
    if sort_step.source == SORT_SLOTS && key == INVISIBLE {
        return NO_DIGIT;
    }
    return (key >> sort_step.shift) & 15u;
}

// Adds a key to four-bit counters of this thread's keys: digits 0-7 in x, 8-15 in y. A thread has at most eight keys.
fn add_digit(packed: vec2<u32>, digit: u32) -> vec2<u32> {
    let one = 1u << (4u * (digit & 7u));
    return packed + select(vec2(0u, one), vec2(one, 0u), digit < 8u);
}

fn get_digit(packed: vec2<u32>, digit: u32) -> u32 {
    return (select(packed.y, packed.x, digit < 8u) >> (4u * (digit & 7u))) & 15u;
}

// Counts this thread's digits and sums the counts over groups of 16 threads; both are in workgroup memory afterwards.
fn count_block(block: u32, thread: u32) {
    let count = key_count();
    let first = block * BLOCK + thread * KEYS_PER_THREAD;
    var packed = vec2(0u);
    for (var i = 0u; i < KEYS_PER_THREAD; i++) {
        let digit = digit_of(first + i, count);
        if digit != NO_DIGIT {
            packed = add_digit(packed, digit);
        }
    }
    let slot = thread + thread / 16u;
    for (var d = 0u; d < 8u; d++) {
        counts[d * 272u + slot] = get_digit(packed, d) | (get_digit(packed, d + 8u) << 16u);
    }
    workgroupBarrier();
    if thread < 128u {
        let at = (thread / 16u) * 272u + (thread % 16u) * 17u;
        var sum = 0u;
        for (var i = 0u; i < 16u; i++) {
            sum += counts[at + i];
        }
        groups[thread] = sum;
    }
    workgroupBarrier();
}

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) block: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    count_block(block.x, thread);
    if thread < 16u {
        var sum = 0u;
        for (var i = 0u; i < 16u; i++) {
            sum += groups[(thread & 7u) * 16u + i];
        }
        histogram[thread * sort_step.stride + block.x] = select(sum >> 16u, sum & 0xffffu, thread < 8u);
    }
}

// One workgroup for each digit.
@compute @workgroup_size(256)
fn scan(@builtin(workgroup_id) digit: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let blocks = (key_count() + BLOCK - 1u) / BLOCK;
    let each = (blocks + 255u) / 256u;
    let first = digit.x * sort_step.stride + min(thread * each, blocks);
    let last = digit.x * sort_step.stride + min((thread + 1u) * each, blocks);
    var sum = 0u;
    for (var i = first; i < last; i++) {
        sum += histogram[i];
    }
    sum = exclusive_scan(sum, thread);
    for (var i = first; i < last; i++) {
        let item = histogram[i];
        histogram[i] = sum;
        sum += item;
    }
    if thread == 0u {
        histogram[16u * sort_step.stride + digit.x] = scan_total();
    }
}

// Writes the number of visible splats and the dispatch size of the later steps, after the scan of the first step.
@compute @workgroup_size(1)
fn visible() {
    var sum = 0u;
    for (var d = 0u; d < 16u; d++) {
        sum += histogram[16u * sort_step.stride + d];
    }
    counters.visible = sum;
    arguments[0] = (sum + BLOCK - 1u) / BLOCK;
    arguments[1] = 1u;
    arguments[2] = 1u;
}

@compute @workgroup_size(256)
fn scatter(@builtin(workgroup_id) block: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    count_block(block.x, thread);
    if thread < 16u {
        var start = histogram[thread * sort_step.stride + block.x];
        for (var d = 0u; d < thread; d++) {
            start += histogram[16u * sort_step.stride + d];
        }
        starts[thread] = start;
    }
    // Replaces counts by ranks: the number of keys of the same digit in earlier threads.
    if thread < 128u {
        let d = thread / 16u;
        var sum = 0u;
        for (var i = 0u; i < thread % 16u; i++) {
            sum += groups[d * 16u + i];
        }
        let at = d * 272u + (thread % 16u) * 17u;
        for (var i = 0u; i < 16u; i++) {
            let item = counts[at + i];
            counts[at + i] = sum;
            sum += item;
        }
    }
    workgroupBarrier();
    let count = key_count();
    let first = block.x * BLOCK + thread * KEYS_PER_THREAD;
    let slot = thread + thread / 16u;
    var packed = vec2(0u);
    for (var i = 0u; i < KEYS_PER_THREAD; i++) {
        let at = first + i;
        let digit = digit_of(at, count);
        if digit != NO_DIGIT {
            let before = counts[(digit & 7u) * 272u + slot];
            let rank = select(before >> 16u, before & 0xffffu, digit < 8u) + get_digit(packed, digit);
            packed = add_digit(packed, digit);
            let to = starts[digit] + rank;
            keys_out[to] = keys_in[at];
            if sort_step.source == SORT_SLOTS {
                values_out[to] = at;
            } else {
                values_out[to] = values_in[at];
            }
        }
    }
}
