//! Runs: the Gaussians of a capture by the stretch of time in which they are alive.
//!
//! In: the first and the last chunk in which each Gaussian may be drawn. Out: [`Run`]s, each Gaussian in one. A run
//! covers 1, 2, 4, ... chunks and begins at a multiple of half its length, so that at any time few runs are needed and
//! no Gaussian is stored twice: one that lives for a moment is in a short run, one that is always there in the run of
//! all chunks.

use std::collections::BTreeMap;
use std::ops::Bound;

/// The Gaussians of some chunks that follow one another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Run {
    /// The first and the last chunk.
    pub chunks: [u32; 2],
    /// The indices of the Gaussians, ascending.
    pub gaussians: Vec<u32>,
}

/// Returns the runs of Gaussians that are alive in these chunks, from the first to the last; by their first chunk, the
/// shorter before the longer. `count` is the number of chunks. Runs of fewer Gaussians than `least` become part of
/// longer ones.
pub(super) fn runs(lives: impl Iterator<Item = [u32; 2]>, count: u32, least: usize) -> Vec<Run> {
    // By length, then by first chunk.
    let mut runs = BTreeMap::<(u32, u32), Vec<u32>>::new();
    for (index, life) in lives.enumerate() {
        runs.entry(key(cover(life, count, 1))).or_default().push(index as u32);
    }
    let mut before = (0, 0);
    let next = |runs: &BTreeMap<(u32, u32), Vec<u32>>, before| {
        let mut later = runs.range((Bound::Excluded(before), Bound::Unbounded));
        later.next().map(|(&at, gaussians)| (at, gaussians.len()))
    };
    while let Some((at, gaussians)) = next(&runs, before) {
        before = at;
        if gaussians >= least || at.0 == count {
            continue;
        }
        let few = runs.remove(&at).unwrap_or_default();
        runs.entry(key(longer(at, count))).or_default().extend(few);
    }
    let run = |((length, first), mut gaussians): ((u32, u32), Vec<u32>)| {
        gaussians.sort_unstable();
        Run { chunks: [first, first + length - 1], gaussians }
    };
    let mut runs: Vec<Run> = runs.into_iter().map(run).collect();
    runs.sort_by_key(|run| run.chunks);
    runs
}

/// Returns the length and the first chunk of a cover.
fn key([first, last]: [u32; 2]) -> (u32, u32) {
    (last - first + 1, first)
}

/// Returns the smallest cover of a life whose length is at least `least`, a power of two: first and last chunk.
fn cover([first, last]: [u32; 2], count: u32, least: u32) -> [u32; 2] {
    let mut length = least;
    while length < count {
        let start = first - first % (length / 2).max(1);
        if last < start + length {
            return [start, (start + length).min(count) - 1];
        }
        length *= 2;
    }
    [0, count - 1]
}

/// Returns the smallest cover that is longer than another and contains it.
fn longer((length, first): (u32, u32), count: u32) -> [u32; 2] {
    let life = [first, first + length - 1];
    let mut least = length.next_power_of_two() * 2;
    loop {
        let found = cover(life, count, least);
        // Covers that end after the last chunk are shorter.
        if found != life {
            return found;
        }
        least *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: usize = 256;

    #[test]
    fn a_cover_is_at_most_four_times_as_long_as_a_life() {
        for count in [1, 2, 7, 8, 30] {
            for first in 0..count {
                for last in first..count {
                    let [start, end] = cover([first, last], count, 1);
                    let found = format!("{first} to {last} of {count}: {start} to {end}");
                    assert!(start <= first && last <= end && end < count, "{found}");
                    assert!([start, end] == [0, count - 1] || end - start < 4 * (last - first + 1), "{found}");
                }
            }
        }
    }

    #[test]
    fn few_runs_are_needed_at_a_time_and_each_gaussian_is_in_one() {
        let lives: Vec<[u32; 2]> = (0..64 * LEAST as u32)
            .map(|index| {
                let first = index % 32;
                [first, (first + index / 32 % 9).min(31)]
            })
            .collect();
        let runs = runs(lives.iter().copied(), 32, LEAST);
        let mut all: Vec<u32> = runs.iter().flat_map(|run| run.gaussians.clone()).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..lives.len() as u32), "each Gaussian once");
        for run in &runs {
            let [first, last] = run.chunks;
            let fits = |index: &u32| first <= lives[*index as usize][0] && lives[*index as usize][1] <= last;
            assert!(run.gaussians.iter().all(fits), "{first} to {last} covers the lives of its Gaussians");
            assert!(run.gaussians.len() >= LEAST || run.chunks == [0, 31], "no run is small but that of all chunks");
        }
        for chunk in 0..32 {
            let needed = runs.iter().filter(|run| run.chunks[0] <= chunk && chunk <= run.chunks[1]).count();
            assert!(needed <= 2 * 5 + 1, "{needed} runs at chunk {chunk}");
        }
        assert!(runs.is_sorted_by_key(|run| run.chunks), "by their first chunk");
    }

    #[test]
    fn small_runs_become_part_of_longer_ones() {
        let lives = [[6, 6], [0, 0], [3, 4]];
        let runs = runs(lives.into_iter(), 7, LEAST);
        assert_eq!(runs, [Run { chunks: [0, 6], gaussians: vec![0, 1, 2] }], "three Gaussians are one run");
    }
}
