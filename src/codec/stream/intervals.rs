//! An index of intervals: which of them contain a stretch, and which a player enters on its way.
//!
//! In: numbered intervals of stretches, first and last, in any order and of any length. Out: the numbers of those that
//! meet a way from one stretch to another, without a look at most of the others.

use std::ops::Range;

/// Numbered intervals of stretches.
#[derive(Debug, Clone)]
pub(super) struct Intervals {
    /// The first stretch and the number of each interval, ascending.
    by_first: Vec<(u32, usize)>,
    /// The last stretch and the number of each interval, ascending.
    by_last: Vec<(u32, usize)>,
    /// A binary tree: node 1 is its root, nodes 2 n and 2 n + 1 are below node n, and the second half are leaves, in the
    /// order of `by_first`. A node has the greatest end of the intervals below, the stretch after the last; 0 without.
    ends: Vec<u32>,
}

impl Intervals {
    /// Sorts intervals, each its number, its first and its last stretch.
    pub(super) fn new(intervals: impl IntoIterator<Item = (usize, [u32; 2])>) -> Self {
        let mut sorted: Vec<(u32, usize, u32)> =
            intervals.into_iter().map(|(number, [first, last])| (first, number, last)).collect();
        sorted.sort_unstable();
        let leaves = sorted.len().next_power_of_two();
        let mut ends = vec![0; 2 * leaves];
        for (leaf, (_, _, last)) in sorted.iter().enumerate() {
            ends[leaves + leaf] = last.saturating_add(1);
        }
        for node in (1..leaves).rev() {
            ends[node] = ends[2 * node].max(ends[2 * node + 1]);
        }
        let by_first = sorted.iter().map(|(first, number, _)| (*first, *number)).collect();
        let mut by_last: Vec<(u32, usize)> = sorted.iter().map(|(_, number, last)| (*last, *number)).collect();
        by_last.sort_unstable();
        Self { by_first, by_last, ends }
    }

    /// Returns the intervals that contain a stretch, in the order of their first stretches.
    pub(super) fn containing(&self, stretch: u32) -> Vec<usize> {
        let begun = self.by_first.partition_point(|(first, _)| *first <= stretch);
        let mut found = Vec::new();
        // Nodes, each with its first leaf and its number of leaves.
        let mut open = vec![(1, 0, self.ends.len() / 2)];
        while let Some((node, leaf, leaves)) = open.pop() {
            if leaf >= begun || self.ends[node] <= stretch {
                continue;
            }
            if leaves == 1 {
                found.push(self.by_first[leaf].1);
                continue;
            }
            let half = leaves / 2;
            open.push((2 * node + 1, leaf + half, half));
            open.push((2 * node, leaf, half));
        }
        found
    }

    /// Returns the intervals that a way from one stretch to another meets, forwards or backwards, in the order in which
    /// the way enters them.
    pub(super) fn along(&self, from: u32, to: u32) -> impl Iterator<Item = usize> {
        let forwards = part(&self.by_first, from.saturating_add(1)..to.saturating_add(1));
        let backwards = part(&self.by_last, to..from);
        let entered = forwards.iter().chain(backwards.iter().rev()).map(|(_, number)| *number);
        self.containing(from).into_iter().chain(entered)
    }
}

/// Returns the entries of a sorted list whose stretches are in a range; none if the range is in descending order.
fn part(sorted: &[(u32, usize)], range: Range<u32>) -> &[(u32, usize)] {
    let [start, end] = [range.start, range.end].map(|bound| sorted.partition_point(|(stretch, _)| *stretch < bound));
    &sorted[start..end.max(start)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    fn sorted(numbers: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let mut numbers: Vec<usize> = numbers.into_iter().collect();
        numbers.sort_unstable();
        numbers
    }

    #[test]
    fn a_way_meets_intervals_in_the_order_in_which_it_enters_them() {
        let index = Intervals::new([(0, [0, 9]), (1, [4, 5]), (2, [2, 3]), (3, [3, 4]), (4, [6, 6])]);
        assert_eq!(index.along(3, 6).collect::<Vec<_>>(), [0, 2, 3, 1, 4], "forwards");
        assert_eq!(index.along(5, 2).collect::<Vec<_>>(), [0, 1, 3, 2], "backwards");
        assert_eq!(index.along(7, 7).collect::<Vec<_>>(), [0], "a single stretch");
        assert_eq!(index.along(u32::MAX, u32::MAX).count(), 0, "beyond the end");
    }

    #[test]
    fn the_intervals_found_are_those_of_a_search_through_all() {
        let mut random = Random::new(8);
        for round in 0..300 {
            let stretches = 1 + random.below(20);
            let intervals: Vec<[u32; 2]> = (0..random.below(40))
                .map(|_| {
                    let first = random.below(stretches);
                    [first as u32, (first + random.below(stretches - first)) as u32]
                })
                .collect();
            let index = Intervals::new(intervals.iter().copied().enumerate());
            let [from, to] = [random.below(stretches), random.below(stretches)].map(|stretch| stretch as u32);
            let meets = |low: u32, high: u32| {
                let met = intervals.iter().enumerate().filter(|(_, [first, last])| *first <= high && *last >= low);
                met.map(|(number, _)| number).collect::<Vec<usize>>()
            };
            assert_eq!(sorted(index.containing(from)), meets(from, from), "round {round}: {from} of {intervals:?}");
            let met = meets(from.min(to), from.max(to));
            assert_eq!(sorted(index.along(from, to)), met, "round {round}: {from} to {to} of {intervals:?}");
        }
    }
}
