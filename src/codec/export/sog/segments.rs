//! Segments of a `.sogst`: the Gaussians in groups by time, of which a player draws and loads only some.
//!
//! In: the lifespan of each Gaussian, in seconds. Out: [`Segments`]: the duration of a segment with which players draw
//! the fewest Gaussians, and the group of each Gaussian.

use crate::gaussian::Lifespan;
use rayon::prelude::*;
use std::ops::Range;

/// Half of the time in which a Gaussian is drawn, in temporal deviations.
pub(super) const REACH: f64 = 3.8;
/// Gaussians that are drawn for longer than this many segments belong to no segment.
pub(super) const SPAN: f64 = 3.0;
/// Numbers of segments among which the best is chosen.
const NUMBERS: [usize; 14] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128];

/// The Gaussians in groups.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Segments {
    /// Seconds of a segment.
    pub duration: f64,
    /// All Gaussians: those drawn at every time first, then those of each segment.
    pub order: Vec<u32>,
    /// The Gaussians drawn at every time: the first so many of the order.
    pub persistent: usize,
    pub list: Vec<Segment>,
}

/// A group.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Segment {
    /// First and last second in which one of its Gaussians is drawn.
    pub times: [f64; 2],
    /// Its part of the order.
    pub range: Range<usize>,
}

impl Segments {
    /// Returns the segments of Gaussians in a clip from `first` to `last` second; groups are in the order of `places`.
    pub(super) fn of(lifespans: &[Lifespan], [first, last]: [f64; 2], places: &[u64]) -> Self {
        let candidates: Vec<Self> = NUMBERS
            .par_iter()
            .map(|&number| Self::with(lifespans, first, (last - first) / number as f64, number))
            .collect();
        let cost = |segments: &Self| segments.drawn([first, last]);
        let best = candidates.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
        let mut best = best.unwrap_or_else(|| Self::with(lifespans, first, last - first, 1));
        let (persistent, mut rest) = best.order.split_at_mut(best.persistent);
        let sort = |group: &mut [u32]| group.par_sort_unstable_by_key(|&index| (places[index as usize], index));
        sort(persistent);
        for segment in &best.list {
            let (own, others) = rest.split_at_mut(segment.range.len());
            sort(own);
            rest = others;
        }
        best
    }

    fn with(lifespans: &[Lifespan], first: f64, duration: f64, number: usize) -> Self {
        let group = |lifespan: &Lifespan| {
            if 2.0 * REACH * f64::from(lifespan.sigma_t) > SPAN * duration {
                return 0;
            }
            let segment = ((f64::from(lifespan.mean_t) - first) / duration).floor();
            1 + segment.clamp(0.0, (number - 1) as f64) as usize
        };
        let mut groups: Vec<Vec<u32>> = vec![Vec::new(); number + 1];
        for (index, lifespan) in lifespans.iter().enumerate() {
            groups[group(lifespan)].push(index as u32);
        }
        let persistent = groups[0].len();
        let mut next = persistent;
        let segment = |(index, own): (usize, &Vec<u32>)| {
            let range = next..next + own.len();
            next = range.end;
            let nominal = [index, index + 1].map(|boundary| first + boundary as f64 * duration);
            let times = own.iter().map(|&index| {
                let Lifespan { mean_t, sigma_t } = lifespans[index as usize];
                [f64::from(mean_t) - REACH * f64::from(sigma_t), f64::from(mean_t) + REACH * f64::from(sigma_t)]
            });
            let times = times.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or(nominal);
            Segment { times, range }
        };
        let list = groups[1..].iter().enumerate().map(segment).collect();
        Self { duration, order: groups.concat(), persistent, list }
    }

    /// Returns the mean number of drawn Gaussians: those of every time, and all from the first to the last active
    /// segment.
    fn drawn(&self, [first, last]: [f64; 2]) -> f64 {
        const TIMES: usize = 256;
        let at = |step: usize| {
            let time = first + (last - first) * (step as f64 + 0.5) / TIMES as f64;
            let active = self.list.iter().filter(|segment| segment.times[0] <= time && time <= segment.times[1]);
            let drawn =
                active.map(|segment| segment.range.clone()).reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
            self.persistent + drawn.map_or(0, |range| range.len())
        };
        (0..TIMES).map(at).sum::<usize>() as f64 / TIMES as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lifespans() -> Vec<Lifespan> {
        let lifespan = |i: usize| Lifespan {
            mean_t: 0.5 + 2.0 * (i * 37 % 1000) as f32 / 1000.0,
            sigma_t: if i.is_multiple_of(10) { 5.0 } else { 0.01 + 0.0001 * (i % 100) as f32 },
        };
        (0..5000).map(lifespan).collect()
    }

    #[test]
    fn each_gaussian_is_in_one_group_that_covers_its_lifespan() {
        let lifespans = lifespans();
        let places: Vec<u64> = (0..5000).rev().collect();
        let segments = Segments::of(&lifespans, [0.5, 2.5], &places);
        let mut all = segments.order.clone();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..5000), "each once");
        let mut next = segments.persistent;
        for (number, segment) in segments.list.iter().enumerate() {
            assert_eq!(segment.range.start, next, "segment {number} follows the one before");
            next = segment.range.end;
            let own = &segments.order[segment.range.clone()];
            assert!(own.is_sorted_by_key(|&index| places[index as usize]), "in the order of places");
            for &index in own {
                let Lifespan { mean_t, sigma_t } = lifespans[index as usize];
                let (mean, half) = (f64::from(mean_t), REACH * f64::from(sigma_t));
                assert!(segment.times[0] <= mean - half && mean + half <= segment.times[1], "Gaussian {index}");
                assert!(2.0 * half <= SPAN * segments.duration, "Gaussian {index} is short");
            }
        }
        assert_eq!(next, 5000, "the last segment ends with the last Gaussian");
    }

    #[test]
    fn the_number_of_segments_is_that_with_the_fewest_gaussians_drawn() {
        let segments = Segments::of(&lifespans(), [0.5, 2.5], &vec![0; 5000]);
        assert_eq!(segments.persistent, 500, "those that live longer than the clip");
        let drawn = segments.drawn([0.5, 2.5]);
        assert!(drawn < 500.0 + 4500.0 * 0.2, "short Gaussians are drawn for a short time: {drawn} of 5000");
        for number in NUMBERS {
            let other = Segments::with(&lifespans(), 0.5, 2.0 / number as f64, number);
            assert!(drawn <= other.drawn([0.5, 2.5]), "{number} segments draw no fewer");
        }
    }

    #[test]
    fn a_clip_without_gaussians_has_one_empty_segment() {
        let segments = Segments::of(&[], [0.0, 1.0], &[]);
        assert_eq!((segments.persistent, segments.list.len()), (0, 1), "an empty list is none");
        assert_eq!(segments.list[0], Segment { times: [0.0, 1.0], range: 0..0 }, "with its nominal times");
    }
}
