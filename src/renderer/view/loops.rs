//! Software drivers that end loops: Mesa's driver ends all loops of a thread after 65,535 iterations in all of its loops together.
//!
//! In: the number of slots of a frame, the counters of a frame. Out: which variant of `blend` and which design draw the frame completely.
//! Hardware has no such limit.

use crate::renderer::shaders::{AtOnce, Lists};

/// Iterations after which the driver ends the loops of a thread.
const MOST_ITERATIONS: u64 = 65_535;
/// Splats of a list that `blend` blends in an iteration each, whatever the variant: `ONE_BY_ONE` of the shader.
const ONE_BY_ONE: u64 = 8192;
/// An upper bound of the iterations of a thread outside the loops over splats.
const OTHERS: u64 = 400;

/// Returns an upper bound of the iterations of a thread of `blend`, if all splats of the slots cover its tile and some have no pair. In each
/// iteration many splats are blended; batches have 256 splats, and the loop over a batch ends in an iteration without a splat.
fn of_blend(slots: u64, at_once: AtOnce) -> u64 {
    let (batches, each) = (slots.div_ceil(256), u64::from(at_once.splats()));
    slots.div_ceil(each) + 3 * batches + ONE_BY_ONE.min(slots) + OTHERS
}

/// Returns the variant of `blend` that draws this number of slots completely: the smallest one. `None` if there are too many slots.
pub(super) fn at_once(slots: usize) -> Option<AtOnce> {
    AtOnce::ALL.into_iter().find(|&at_once| of_blend(slots as u64, at_once) <= MOST_ITERATIONS)
}

/// The counts on which the iterations of the fast design depend.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crowd {
    /// Number of slots.
    pub slots: u32,
    /// Number of splats of the fullest bin.
    pub fullest: u32,
    /// Whether pairs or entries of bins may not fit into their buffers, so that `blend_blocks` searches splats.
    pub searches: bool,
    /// The variant of `sort_bins`.
    pub lists: Lists,
}

/// Scans of all candidates that find the splats of a batch or a round: a step divides a range of 32 bits by 2^8, first of depths, then of slots.
const STEPS: u64 = 8;
/// An upper bound of the iterations of a step apart from the scan.
const OF_STEP: u64 = 60;

/// Returns the number of iterations of a thread of `blend_blocks`, with the smallest batches.
fn of_blend_blocks(crowd: Crowd) -> u64 {
    const BATCH: u64 = 128;
    const THREADS: u64 = 256;
    let batches = u64::from(crowd.fullest) / BATCH + 1;
    // Two more scans list the splats of a batch, which are then ordered.
    let search = (2 + STEPS) * (u64::from(crowd.slots) / THREADS + OF_STEP) + BATCH;
    // Queues, and four splats at once.
    batches * (64 + BATCH / 4 + if crowd.searches { search } else { 0 })
}

/// Returns the number of iterations of a thread of `sort_bins`, if all splats of the bin have the same depth: each is compared with all others.
fn of_sort_bins(crowd: Crowd) -> u64 {
    let (fullest, [list, threads]) = (u64::from(crowd.fullest), crowd.lists.sizes().map(u64::from));
    let sort = |count: u64| (count / threads + 1) * (count + count / 2);
    if fullest <= list {
        return sort(fullest);
    }
    let round = list / 2;
    // A loop over entries has an inner loop over four of them.
    let scan = 5 * fullest / (4 * threads) + OF_STEP;
    (fullest / round + 1) * ((1 + STEPS) * scan + sort(round) + 100)
}

/// Returns whether the fast design draws a frame with these counts completely.
pub(super) fn fast_is_complete(crowd: Crowd) -> bool {
    of_blend_blocks(crowd).max(of_sort_bins(crowd)) + OTHERS <= MOST_ITERATIONS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_splats_are_blended_at_once_the_more_slots_there_are() {
        for (slots, expected) in [
            (0, Some(AtOnce::One)),
            (45_000, Some(AtOnce::One)),
            (70_000, Some(AtOnce::Sixteen)),
            (700_000, Some(AtOnce::Sixteen)),
            (2_000_000, Some(AtOnce::SixtyFour)),
            (2_500_000, None),
        ] {
            assert_eq!(at_once(slots), expected, "{slots} slots");
        }
    }

    #[test]
    fn the_fast_design_is_complete_up_to_a_number_of_splats_in_a_bin() {
        let complete =
            |slots, fullest, searches| fast_is_complete(Crowd { slots, fullest, searches, lists: Lists::Medium });
        assert!(complete(1_000_000, 2_304, false), "a bin that is sorted at once");
        assert!(complete(1_000_000, 6_000, false), "a bin that is sorted in six rounds");
        assert!(!complete(45_000, 45_000, false), "a bin that is sorted in 40 rounds");
        assert!(complete(6_000, 6_000, true), "47 searches among 6,000 splats");
        assert!(!complete(40_000, 40_000, true), "313 searches among 40,000 splats");
        assert!(!complete(u32::MAX, u32::MAX, true), "the count of iterations does not overflow");
    }
}
