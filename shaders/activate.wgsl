// activate: the indices of the Gaussians that are active in a segment of time, in ascending order.
// In: the filter of one part of a capture, as bits or intervals. Out: the list; the host computes its length. Runs once
// for all views, only when the segment changes. `count` counts the active Gaussians of each block, `scan` sums the
// counts, `store` fills the list. CPU reference: src/reference/activate.rs.
#import gs4d::types::{Activation, FILTER_BITS}
#import gs4d::scan::{exclusive_scan, scan_total}

const PER_THREAD: u32 = 8u;
const BLOCK: u32 = 2048u;

@group(0) @binding(0) var<uniform> activation: Activation;
@group(0) @binding(1) var<storage, read_write> active_list: array<u32>;
@group(0) @binding(2) var<storage, read_write> blocks: array<u32>;
// Bits: the words of all Gaussians, segment after segment. Intervals: first and last segment of each Gaussian, 16 bits
// each.
@group(1) @binding(0) var<storage, read> sets: array<u32>;

fn is_active(index: u32) -> bool {
    if index >= activation.count {
        return false;
    }
    if activation.filter_mode == FILTER_BITS {
        let words = (activation.count + 31u) / 32u;
        return ((sets[activation.segment * words + index / 32u] >> (index % 32u)) & 1u) == 1u;
    }
    let interval = sets[index];
    return (interval & 0xffffu) <= activation.segment && activation.segment <= (interval >> 16u);
}

fn thread_count(first: u32) -> u32 {
    var sum = 0u;
    for (var i = first; i < first + PER_THREAD; i++) {
        sum += select(0u, 1u, is_active(i));
    }
    return sum;
}

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) block: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    exclusive_scan(thread_count(block.x * BLOCK + thread * PER_THREAD), thread);
    if thread == 0u {
        blocks[block.x] = scan_total();
    }
}

// One workgroup.
@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) thread: u32) {
    let total = (activation.count + BLOCK - 1u) / BLOCK;
    let each = (total + 255u) / 256u;
    let first = min(thread * each, total);
    let last = min((thread + 1u) * each, total);
    var sum = 0u;
    for (var i = first; i < last; i++) {
        sum += blocks[i];
    }
    sum = exclusive_scan(sum, thread);
    for (var i = first; i < last; i++) {
        let item = blocks[i];
        blocks[i] = sum;
        sum += item;
    }
}

@compute @workgroup_size(256)
fn store(@builtin(workgroup_id) block: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let first = block.x * BLOCK + thread * PER_THREAD;
    var at = blocks[block.x] + exclusive_scan(thread_count(first), thread);
    for (var i = first; i < first + PER_THREAD; i++) {
        if is_active(i) {
            active_list[activation.first + at] = i;
            at++;
        }
    }
}
