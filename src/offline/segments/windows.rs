//! The filter segments in which the Gaussians of a segment may be drawn.
//!
//! In: Gaussians and their temporal filter, the place of their segment on the clock of all. Out: a word for each, as in
//! the intervals of a temporal filter: never outside the segment, so that no lifespan leaks over a seam, and as short as
//! the lifespan and the filter of the segment allow.

use super::clock::Place;
use crate::gaussian::{Gaussian, lifespan_reach};
use crate::scene::TemporalFilter;
use rayon::prelude::*;

/// The filter of the capture of all segments, as one segment sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    /// The time interval of all.
    pub interval: [f32; 2],
    /// The number of filter segments of all.
    pub segments: u32,
    /// The first filter segment of the segment, and the one after its last.
    pub edges: [u32; 2],
}

/// Returns the word of each Gaussian, which is in the time unit of its segment. `own` is the filter of the segment.
/// `None` if it is part of the capture and has Gaussians in several windows.
pub(super) fn windows(
    gaussians: &[Gaussian],
    own: Option<&TemporalFilter>,
    place: &Place,
    frame: &Frame,
    cutoff: f32,
) -> Option<Vec<u32>> {
    let own = match own {
        Some(filter) => Some((filter, intervals(filter)?)),
        None => None,
    };
    let [first, last] = frame.interval.map(f64::from);
    let (span, segments) = (last - first, f64::from(frame.segments));
    let reach = lifespan_reach(cutoff);
    let word = |(index, gaussian): (usize, &Gaussian)| {
        // As in the support filter: a margin covers rounding.
        let half = reach * f64::from(gaussian.sigma_t) * place.scale + span * 1e-6;
        let mean = place.time(gaussian.mean_t);
        let segment = |time: f64| ((time - first) / span * segments).floor().clamp(0.0, segments - 1.0) as u32;
        let seen = [segment(mean - half), segment(mean + half) + 1];
        let [opens, closes] = match &own {
            Some((filter, words)) => within(words[index], filter, frame.edges),
            None => frame.edges,
        };
        interval_word(opens.max(seen[0]).max(frame.edges[0]), closes.min(seen[1]).min(frame.edges[1]), frame.edges[0])
    };
    Some(gaussians.par_iter().enumerate().map(word).collect())
}

/// Returns the intervals of a filter, one word for each Gaussian. Gaussians of several intervals are active between
/// them, too, unless the filter is part of the capture: then there is no result.
pub(super) fn intervals(filter: &TemporalFilter) -> Option<Vec<u32>> {
    match filter.to_intervals() {
        None if filter.is_of_capture() => None,
        found => Some(found.unwrap_or_else(|| hulls(filter))),
    }
}

/// Returns the interval from the first to the last active segment of each Gaussian.
pub(super) fn hulls(filter: &TemporalFilter) -> Vec<u32> {
    let hull = |index: usize| {
        let mut active = (0..filter.segments).filter(|&segment| filter.is_active(segment, index));
        let first = active.next();
        first.map_or(1, |first| first | active.next_back().unwrap_or(first) << 16)
    };
    (0..filter.count).into_par_iter().map(hull).collect()
}

/// Returns an interval of a filter of one segment in the filter of all: the first filter segment and the one after the
/// last. Windows are rounded to the nearest boundaries, other filters outward.
fn within(word: u32, filter: &TemporalFilter, edges: [u32; 2]) -> [u32; 2] {
    let (first, last) = (u64::from(word & 0xffff), u64::from(word >> 16));
    if first > last {
        return [edges[0]; 2];
    }
    let (count, own) = (u64::from(edges[1] - edges[0]), u64::from(filter.segments.max(1)));
    let nearest = |boundary: u64| (2 * boundary * count + own) / (2 * own);
    let [opens, closes] = match filter.is_of_capture() {
        true => [nearest(first), nearest(last + 1)],
        false => [first * count / own, ((last + 1) * count).div_ceil(own)],
    };
    [edges[0] + opens.min(count) as u32, edges[0] + closes.min(count) as u32]
}

/// Returns the word of an interval, given the segment after its last. An empty one is never active; its word says in
/// which segment it would be.
fn interval_word(first: u32, end: u32, at: u32) -> u32 {
    if first < end { first | (end - 1) << 16 } else { (at + 1) | at << 16 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::MARGINAL_CUTOFF;
    use crate::scene::{ActiveSets, FilterKind};

    const FRAME: Frame = Frame { interval: [0.0, 3.0], segments: 30, edges: [10, 20] };
    const PLACE: Place = Place { begin: 0.0, start: 1.0, end: 2.0, scale: 1.0 };

    fn gaussian(mean_t: f32, sigma_t: f32) -> Gaussian {
        Gaussian { mean_t, sigma_t, opacity: 0.5, ..bytemuck::Zeroable::zeroed() }
    }

    fn ends(words: &[u32]) -> Vec<(u32, u32)> {
        words.iter().map(|word| (word & 0xffff, word >> 16)).collect()
    }

    #[test]
    fn lifespans_that_leak_over_a_seam_are_cut() {
        let gaussians = [gaussian(0.55, 0.01), gaussian(0.0, 0.1), gaussian(9.0, f32::INFINITY), gaussian(-1.0, 0.1)];
        let words = windows(&gaussians, None, &PLACE, &FRAME, MARGINAL_CUTOFF).expect("no filter");
        assert_eq!(
            ends(&words),
            [(15, 15), (10, 12), (10, 19), (11, 10)],
            "inside, over the first seam, present at every time, and only before the segment"
        );
    }

    #[test]
    fn the_filter_of_a_segment_is_kept_within_it() {
        let filter = |kind, sets| TemporalFilter { kind, segments: 4, count: 2, sets };
        let words = ActiveSets::Intervals(vec![1 | 1 << 16, 3 | 3 << 16]);
        let always = [gaussian(0.5, f32::INFINITY); 2];
        let cut = |filter| windows(&always, Some(&filter), &PLACE, &FRAME, MARGINAL_CUTOFF).map(|words| ends(&words));
        let outward = cut(filter(FilterKind::KeyFrame, words.clone()));
        assert_eq!(outward, Some(vec![(12, 14), (17, 19)]), "2.5 to 5 and 7.5 to 10 of ten, outward");
        let nearest = cut(filter(FilterKind::Window, words));
        assert_eq!(nearest, Some(vec![(13, 14), (18, 19)]), "rounded to the nearest boundaries");
        let scattered = ActiveSets::Bits(vec![0b01, 0b10, 0b10, 0b01]);
        assert_eq!(
            cut(filter(FilterKind::Interval, scattered.clone())),
            Some(vec![(10, 19), (12, 17)]),
            "between two intervals a Gaussian is active, too"
        );
        assert_eq!(cut(filter(FilterKind::Window, scattered)), None, "two windows of one Gaussian cannot be one");
    }
}
