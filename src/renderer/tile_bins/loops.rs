//! The iterations of the passes of tile bins, on software drivers that end long loops.
//!
//! In: the counts of a frame. Out: whether the passes draw the frame completely.

use super::variant::Lists;
use crate::renderer::iterations::{MOST_ITERATIONS, OTHERS};

/// Scans of all candidates that find the splats of a batch or a round: a step divides a range of 32 bits by 2^8, first of depths, then of slots.
const STEPS: u64 = 8;
/// An upper bound of the iterations of a step apart from the scan.
const OF_STEP: u64 = 60;

/// An upper bound of the iterations of the four sums over threads in a round of `sort_bins`: of the values of a group of threads, then of groups.
const SUMS: u64 = 4 * (32 + 16);

/// Returns the number of iterations of a thread of `blend_blocks`, with the smallest batches.
fn of_blend_blocks(slots: u32, fullest: u32, searches: bool) -> u64 {
    const BATCH: u64 = 128;
    const THREADS: u64 = 256;
    let batches = u64::from(fullest) / BATCH + 1;
    // Two more scans list the splats of a batch, which are then ordered.
    let search = (2 + STEPS) * (u64::from(slots) / THREADS + OF_STEP) + BATCH;
    // Queues, and four splats at once.
    batches * (64 + BATCH / 4 + if searches { search } else { 0 })
}

/// Returns the number of iterations of a thread of `sort_bins`, if all splats of the bin have the same depth: each is compared with all others.
fn of_sort_bins(fullest: u32, lists: Lists) -> u64 {
    let (fullest, [list, threads]) = (u64::from(fullest), lists.sizes().map(u64::from));
    let sort = |count: u64| (count / threads + 1) * (count + count / 2);
    if fullest <= list {
        return sort(fullest) + SUMS;
    }
    let round = list / 2;
    // A loop over entries has an inner loop over four of them.
    let scan = 5 * fullest / (4 * threads) + OF_STEP;
    // Bins that are counted first are ordered by four scans.
    4 * scan + (fullest / round + 1) * ((1 + STEPS) * scan + sort(round) + 100 + SUMS)
}

/// Returns whether tile bins draw every frame of so many slots completely, on a device with these limits.
pub(in crate::renderer) fn is_always_complete(limits: &wgpu::Limits, slots: u32) -> bool {
    // The fullest bin may contain all splats.
    is_complete(slots, slots, true, Lists::suiting(limits, slots))
}

/// Returns whether tile bins draw a frame of so many slots completely, with so many splats in the fullest bin and this variant of `sort_bins`.
/// `searches`: pairs or entries of bins may not fit into their buffers, so that `blend_blocks` searches splats.
pub(super) fn is_complete(slots: u32, fullest: u32, searches: bool, lists: Lists) -> bool {
    of_blend_blocks(slots, fullest, searches).max(of_sort_bins(fullest, lists)) + OTHERS <= MOST_ITERATIONS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_complete_up_to_a_number_of_splats_in_a_bin() {
        let complete = |slots, fullest, searches| is_complete(slots, fullest, searches, Lists::Medium);
        assert!(complete(1_000_000, 2_304, false), "a bin that is sorted at once");
        assert!(complete(1_000_000, 6_000, false), "a bin that is sorted in six rounds");
        assert!(!complete(45_000, 45_000, false), "a bin that is sorted in 40 rounds");
        assert!(complete(6_000, 6_000, true), "47 searches among 6,000 splats");
        assert!(!complete(40_000, 40_000, true), "313 searches among 40,000 splats");
        assert!(!complete(u32::MAX, u32::MAX, true), "the count of iterations does not overflow");
    }
}
