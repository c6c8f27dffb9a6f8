// activate: the indices of the Gaussians that are active in a segment of time, in ascending order; of a capture in
// pages, in the order in which its pages are listed.
// In: the filter of one part of a capture, as bits or intervals; the pages that are listed. Out: the list; the host
// computes its length. Runs once for all views, only when the segment or the pages change. `count` counts the active
// Gaussians of each block, `scan` sums the counts, `store` fills the list. CPU reference: src/reference/activate.rs.
#import gs4d::types::{Activation, FILTER_ALL, FILTER_BITS, PAGE}
#import gs4d::scan::{exclusive_scan, scan_total}

const PER_THREAD: u32 = 8u;
const BLOCK: u32 = 2048u;

@group(0) @binding(0) var<uniform> activation: Activation;
@group(0) @binding(1) var<storage, read_write> active_list: array<u32>;
@group(0) @binding(2) var<storage, read_write> blocks: array<u32>;
// The pages that are listed, part after part.
@group(0) @binding(3) var<storage, read> pages: array<u32>;
// Bits: the words of all Gaussians, segment after segment; in pages, those of each page, segment after segment.
// Intervals: first and last segment of each Gaussian, 16 bits each.
@group(1) @binding(0) var<storage, read> sets: array<u32>;

// Returns the index of a Gaussian in the buffers of the part; `index` counts the Gaussians of the pages that are listed.
fn place_of(index: u32) -> u32 {
    if activation.paged == 0u {
        return index;
    }
    return pages[activation.first_page + index / PAGE] * PAGE + index % PAGE;
}

// Returns the index of the word of bits that has the Gaussian at this place.
fn word_of(place: u32) -> u32 {
    if activation.paged == 0u {
        return activation.segment * ((activation.count + 31u) / 32u) + place / 32u;
    }
    return (place / PAGE * activation.segments + activation.segment) * (PAGE / 32u) + place % PAGE / 32u;
}

fn is_active(index: u32) -> bool {
    if index >= activation.count {
        return false;
    }
    if activation.filter_mode == FILTER_ALL {
        return true;
    }
    let place = place_of(index);
    if activation.filter_mode == FILTER_BITS {
        return ((sets[word_of(place)] >> (place % 32u)) & 1u) == 1u;
    }
    let interval = sets[place];
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
            active_list[activation.first + at] = place_of(i);
            at++;
        }
    }
}
