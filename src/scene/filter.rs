//! The temporal filter: the Gaussians that are active in each segment of time.
//!
//! In: key-frames at even spacing over the time interval and, for each segment between two of them, a set of Gaussians.
//! Out: [`TemporalFilter`], stored as bits or as intervals, whichever is smaller; drawing skips inactive Gaussians.

use crate::gaussian::{Gaussian, lifespan_reach};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The method by which the sets of a filter were computed. Default: [`Support`](Self::Support).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FilterKind {
    /// The paper's filter: the union of the Gaussians that training cameras see at the two key-frames around a segment.
    /// Misses Gaussians that are visible only between the key-frames.
    KeyFrame,
    /// The key-frame filter, and every Gaussian that any training view inside the segment blends.
    Interval,
    /// Every Gaussian whose marginal is above the cut-off somewhere in the segment: exact by construction, needs no
    /// views.
    #[default]
    Support,
    /// The windows of time in which each Gaussian exists: frames of a sequence, pieces of a path. The filter is part of
    /// the capture: without it, or with another filter, the pictures are different.
    Window,
}

/// Sets of active Gaussians, one for each segment of time.
#[derive(Debug, Clone, PartialEq)]
pub struct TemporalFilter {
    /// How the sets were computed.
    pub kind: FilterKind,
    /// Number of segments: key-frames less one.
    pub segments: u32,
    /// Number of Gaussians.
    pub count: usize,
    /// The sets.
    pub sets: ActiveSets,
}

/// The two ways to store the sets.
#[derive(Debug, Clone, PartialEq)]
pub enum ActiveSets {
    /// Segment by segment, [`TemporalFilter::words`] words each, Gaussian `i` at bit `i % 32` of word `i / 32`.
    Bits(Vec<u32>),
    /// One word for each Gaussian: its first active segment in the low half, its last in the high half; first after
    /// last if it is never active.
    Intervals(Vec<u32>),
}

/// Largest number of segments of a filter.
pub const MAX_SEGMENTS: u32 = u16::MAX as u32;

impl TemporalFilter {
    /// Creates a filter from one set of bits for each segment, stored as bits or as intervals, whichever is smaller;
    /// [windows](FilterKind::Window) without gaps are always intervals.
    ///
    /// # Panics
    /// If the length of `bits` is not `segments` times the number of [`words`](Self::words) of a set.
    pub fn from_bits(kind: FilterKind, segments: u32, count: usize, bits: Vec<u32>) -> Self {
        let words = Self::words(count);
        assert_eq!(bits.len(), words * segments as usize, "one set of bits for each segment");
        let filter = Self { kind, segments, count, sets: ActiveSets::Bits(bits) };
        match filter.intervals() {
            Some(intervals) if kind == FilterKind::Window || intervals.len() < words * segments as usize => {
                Self { sets: ActiveSets::Intervals(intervals), ..filter }
            }
            _ => filter,
        }
    }

    /// Creates the support filter: Gaussian `i` is active in a segment if its marginal exceeds the cut-off anywhere in
    /// it. The marginal has one peak, so these segments are one interval. A margin covers rounding: an additional
    /// active Gaussian changes no pixel. `interval` is the time interval of the capture, `cutoff` its cut-off.
    ///
    /// # Panics
    /// If `segments` is not 1 to [`MAX_SEGMENTS`].
    pub fn support(gaussians: impl Iterator<Item = Gaussian>, interval: [f32; 2], cutoff: f32, segments: u32) -> Self {
        assert!((1..=MAX_SEGMENTS).contains(&segments), "a filter of {segments} segments");
        let reach = lifespan_reach(cutoff);
        let span = f64::from(interval[1]) - f64::from(interval[0]);
        let intervals: Vec<u32> = gaussians
            .map(|gaussian| {
                let half = reach * f64::from(gaussian.sigma_t) + span * 1e-6;
                let unit = |time: f64| (time - f64::from(interval[0])) / span * f64::from(segments);
                let mean = f64::from(gaussian.mean_t);
                let (first, last) = (unit(mean - half).floor(), unit(mean + half).floor());
                // Times outside the interval belong to its end segments.
                let end = f64::from(segments - 1);
                interval_word(first.clamp(0.0, end) as u32, last.clamp(0.0, end) as u32)
            })
            .collect();
        let count = intervals.len();
        let filter = Self { kind: FilterKind::Support, segments, count, sets: ActiveSets::Intervals(intervals) };
        if Self::words(count) * (segments as usize) < count {
            let sets = ActiveSets::Bits(filter.to_bits());
            return Self { sets, ..filter };
        }
        filter
    }

    /// Returns whether the filter is part of the capture, so that it may be neither replaced nor removed.
    pub(crate) fn is_of_capture(&self) -> bool {
        self.kind == FilterKind::Window
    }

    /// Checks that it is a filter of `count` Gaussians, and that intervals end within its segments.
    ///
    /// # Errors
    /// A description of the first part that does not fit.
    pub fn check(&self, count: usize) -> Result<(), &'static str> {
        let fits = match &self.sets {
            ActiveSets::Bits(bits) => Self::words(count).checked_mul(self.segments as usize) == Some(bits.len()),
            ActiveSets::Intervals(intervals) => intervals.len() == count,
        };
        if !(1..=MAX_SEGMENTS).contains(&self.segments) {
            return Err("its temporal filter has no segment, or more than are possible");
        }
        if self.count != count || !fits {
            return Err("its temporal filter is that of another number of Gaussians");
        }
        let ends_within = |&word: &u32| {
            let (first, last) = (word & 0xffff, word >> 16);
            first > last || last < self.segments
        };
        match &self.sets {
            ActiveSets::Intervals(intervals) if !intervals.par_iter().all(ends_within) => {
                Err("its temporal filter has an interval that ends after its last segment")
            }
            ActiveSets::Bits(_) | ActiveSets::Intervals(_) => Ok(()),
        }
    }

    /// Returns the number of words of one set of bits for `count` Gaussians.
    pub fn words(count: usize) -> usize {
        count.div_ceil(32)
    }

    /// Returns the first and the last time at which Gaussian `index` exists; all times unless the filter is of
    /// [windows](FilterKind::Window). The end of a segment belongs to the next one, except that of the last. Of bits
    /// with gaps it is the time from the first active segment to the last.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub(crate) fn window(&self, index: usize, interval: [f32; 2]) -> [f64; 2] {
        if self.kind != FilterKind::Window {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let [start, end] = interval.map(f64::from);
        let (first, last) = match &self.sets {
            ActiveSets::Intervals(words) => (words[index] & 0xffff, words[index] >> 16),
            ActiveSets::Bits(_) => {
                let active = |&segment: &u32| self.is_active(segment, index);
                let first = (0..self.segments).find(active);
                // First after last, as of intervals, where it is never active.
                first.map_or((1, 0), |first| (first, (first..self.segments).rev().find(active).unwrap_or(first)))
            }
        };
        let time = |segment: u32| start + (end - start) * f64::from(segment) / f64::from(self.segments);
        let end = time(last + 1);
        [time(first), if last + 1 < self.segments { end.next_down() } else { end }]
    }

    /// Returns the segment of `time`, which is in the capture's unit; see [`segment_of`].
    pub fn segment_of(&self, time: f32, interval: [f32; 2]) -> u32 {
        segment_of(time, interval, self.segments)
    }

    /// Returns whether Gaussian `index` is active in `segment`.
    ///
    /// # Panics
    /// If `index` is out of range, or if the sets are bits and `segment` is.
    pub fn is_active(&self, segment: u32, index: usize) -> bool {
        match &self.sets {
            ActiveSets::Bits(bits) => {
                bits[segment as usize * Self::words(self.count) + index / 32] >> (index % 32) & 1 == 1
            }
            ActiveSets::Intervals(intervals) => {
                let word = intervals[index];
                (word & 0xffff..=word >> 16).contains(&segment)
            }
        }
    }

    /// Returns the number of active Gaussians among the Gaussians in the range `own`, for each segment. `own` begins at
    /// a multiple of 32.
    ///
    /// # Panics
    /// If `own` is out of range.
    pub fn active_counts(&self, own: std::ops::Range<usize>) -> Vec<u32> {
        match &self.sets {
            ActiveSets::Bits(bits) => {
                let words = own.start / 32..own.end.div_ceil(32);
                let last = u32::MAX >> (own.end.next_multiple_of(32) - own.end);
                let count = |set: &[u32]| {
                    let Some((end, whole)) = set[words.clone()].split_last() else { return 0 };
                    whole.iter().map(|word| word.count_ones()).sum::<u32>() + (end & last).count_ones()
                };
                bits.chunks_exact(Self::words(self.count).max(1)).map(count).collect()
            }
            ActiveSets::Intervals(intervals) => {
                let mut steps = vec![0i64; self.segments as usize + 1];
                for word in &intervals[own] {
                    let (first, last) = (word & 0xffff, (word >> 16).min(self.segments.saturating_sub(1)));
                    if first <= last {
                        steps[first as usize] += 1;
                        steps[last as usize + 1] -= 1;
                    }
                }
                let running = steps.iter().take(self.segments as usize).scan(0, |sum, step| {
                    *sum += step;
                    Some(*sum as u32)
                });
                running.collect()
            }
        }
    }

    /// Returns the fraction of active Gaussians, the mean over all segments; 1 for an empty scene.
    pub fn active_share(&self) -> f64 {
        // A filter from a file may have so many segments that testing each Gaussian in each segment would take too
        // long.
        let active: u64 = self.active_counts(0..self.count).into_iter().map(u64::from).sum();
        let all = self.count * self.segments as usize;
        if all == 0 { 1.0 } else { active as f64 / all as f64 }
    }

    /// Returns the filter of the Gaussians kept, in their new order.
    ///
    /// # Panics
    /// If an index in `keep` is out of range.
    pub fn select(&self, keep: &[u32]) -> Self {
        let sets = match &self.sets {
            ActiveSets::Intervals(intervals) => {
                ActiveSets::Intervals(keep.iter().map(|&i| intervals[i as usize]).collect())
            }
            ActiveSets::Bits(_) => {
                let words = Self::words(keep.len());
                let mut bits = vec![0; words * self.segments as usize];
                for segment in 0..self.segments {
                    for (to, &from) in keep.iter().enumerate() {
                        let bit = u32::from(self.is_active(segment, from as usize));
                        bits[segment as usize * words + to / 32] |= bit << (to % 32);
                    }
                }
                ActiveSets::Bits(bits)
            }
        };
        Self { count: keep.len(), sets, ..self.clone() }
    }

    /// Returns the sets as bits, one set for each segment.
    pub fn to_bits(&self) -> Vec<u32> {
        let words = Self::words(self.count);
        let mut bits = vec![0; words * self.segments as usize];
        for segment in 0..self.segments {
            for index in 0..self.count {
                if self.is_active(segment, index) {
                    bits[segment as usize * words + index / 32] |= 1 << (index % 32);
                }
            }
        }
        bits
    }

    /// Returns the intervals of all Gaussians; `None` if the active segments of one are not contiguous.
    pub(crate) fn to_intervals(&self) -> Option<Vec<u32>> {
        match &self.sets {
            ActiveSets::Intervals(intervals) => Some(intervals.clone()),
            ActiveSets::Bits(_) => self.intervals(),
        }
    }

    /// Returns the sets as intervals; `None` if the active segments of a Gaussian are not contiguous.
    fn intervals(&self) -> Option<Vec<u32>> {
        (0..self.count)
            .map(|index| {
                let [mut first, mut last] = [1, 0];
                for segment in (0..self.segments).filter(|&s| self.is_active(s, index)) {
                    if first > last {
                        [first, last] = [segment; 2];
                    } else if segment == last + 1 {
                        last = segment;
                    } else {
                        return None;
                    }
                }
                Some(interval_word(first, last))
            })
            .collect()
    }
}

fn interval_word(first: u32, last: u32) -> u32 {
    first | last << 16
}

/// Returns the segment of a time: `min(floor(p s), s − 1)` with `s` segments and `p` the position of the time in the
/// interval, clamped to 0..1.
pub fn segment_of(time: f32, interval: [f32; 2], segments: u32) -> u32 {
    let place = ((time - interval[0]) / (interval[1] - interval[0])).clamp(0.0, 1.0);
    ((place * segments as f32) as u32).min(segments.saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::MARGINAL_CUTOFF;

    #[test]
    fn the_end_of_a_window_belongs_to_the_next() {
        let sets = ActiveSets::Intervals(vec![0, 1 | 1 << 16]);
        let filter = TemporalFilter { kind: FilterKind::Window, segments: 2, count: 2, sets };
        let [before, after] = [0, 1].map(|index| filter.window(index, [0.0, 1.0]));
        assert!(before[1] < 0.5 && before[1] > 0.499_999, "the first ends before the border: {before:?}");
        assert_eq!(after, [0.5, 1.0], "the second has it, and the end of all");
        assert_eq!(filter.segment_of(0.5, [0.0, 1.0]), 1, "as it is drawn");
    }

    #[test]
    fn windows_of_few_segments_are_intervals_and_bits_with_gaps_have_their_ends() {
        let times = |bits: [u32; 4]| {
            let filter = TemporalFilter::from_bits(FilterKind::Window, 4, 2, bits.to_vec());
            (matches!(filter.sets, ActiveSets::Intervals(_)), [0, 1].map(|index| filter.window(index, [0.0, 4.0])))
        };
        let (intervals, [early, late]) = times([1, 1, 2, 2]);
        assert!(intervals, "the times of a window are needed outside of drawing, too");
        assert_eq!((early[0], late), (0.0, [2.0, 4.0]), "the two windows");
        assert!(early[1] < 2.0 && early[1] > 1.999, "the first ends before the border: {early:?}");
        let (intervals, [gap, late]) = times([1, 2, 3, 2]);
        assert!(!intervals, "a gap is no interval");
        assert_eq!((gap[0], late), (0.0, [1.0, 4.0]), "from the first active segment");
        assert!(gap[1] < 3.0 && gap[1] > 2.999, "to the last: {gap:?}");
    }

    #[test]
    fn filters_without_segments_are_said_to_have_none() {
        let sets = ActiveSets::Intervals(vec![0]);
        let filter = TemporalFilter { kind: FilterKind::Support, segments: 0, count: 1, sets };
        let told = filter.check(1).expect_err("no segment");
        assert!(told.contains("no segment"), "not another number of Gaussians: {told}");
    }

    fn gaussian(mean_t: f32, sigma_t: f32) -> Gaussian {
        Gaussian { mean_t, sigma_t, opacity: 0.5, ..bytemuck::Zeroable::zeroed() }
    }

    #[test]
    fn support_is_active_wherever_the_marginal_is_above_the_cutoff() {
        let gaussians: Vec<_> =
            (0..200).map(|i| gaussian(i as f32 / 150.0 - 0.1, 0.003 * (1 + i % 40) as f32)).collect();
        for segments in [1, 5, 10, 40] {
            let filter = TemporalFilter::support(gaussians.iter().copied(), [0.0, 1.0], MARGINAL_CUTOFF, segments);
            for step in 0..=500 {
                let time = step as f32 / 500.0;
                let segment = filter.segment_of(time, [0.0, 1.0]);
                for (index, gaussian) in gaussians.iter().enumerate() {
                    let drawn = gaussian.marginal(time) > MARGINAL_CUTOFF;
                    assert!(
                        !drawn || filter.is_active(segment, index),
                        "Gaussian {index} is drawn at {time} and must be active"
                    );
                }
            }
            assert_eq!(filter.active_share() < 1.0, segments > 1, "with several segments, some Gaussians are inactive");
        }
    }

    #[test]
    fn bits_and_intervals_store_the_same_sets() {
        let gaussians: Vec<_> = (0..70).map(|i| gaussian(i as f32 / 70.0, 0.05)).collect();
        let filter = TemporalFilter::support(gaussians.into_iter(), [0.0, 1.0], MARGINAL_CUTOFF, 40);
        assert!(matches!(filter.sets, ActiveSets::Intervals(_)), "forty segments are smaller as intervals");
        let bits = TemporalFilter { sets: ActiveSets::Bits(filter.to_bits()), ..filter.clone() };
        assert_eq!(bits.to_bits(), filter.to_bits(), "the same sets");
        let each = (0..40).map(|segment| (0..70).filter(|&i| filter.is_active(segment, i)).count()).sum::<usize>();
        assert_eq!(
            (filter.active_share(), bits.active_share()),
            (each as f64 / 2800.0, each as f64 / 2800.0),
            "the fraction of active Gaussians"
        );
        let back = TemporalFilter::from_bits(FilterKind::Support, 40, 70, filter.to_bits());
        assert_eq!(back, filter, "bits are stored as intervals again");
        for own in [0..70, 0..64, 64..70, 32..33] {
            let counts = filter.active_counts(own.clone());
            let expected = |segment| own.clone().filter(|&i| filter.is_active(segment, i)).count() as u32;
            assert_eq!(
                counts,
                (0..40).map(expected).collect::<Vec<_>>(),
                "the counts of {own:?} are those of single tests"
            );
            assert_eq!(counts, bits.active_counts(own), "bits give the same counts");
        }
        let keep: Vec<u32> = (0..70).step_by(3).collect();
        let (a, b) = (filter.select(&keep), bits.select(&keep));
        assert_eq!(a.to_bits(), b.to_bits(), "both forms select the same sets");
    }
}
