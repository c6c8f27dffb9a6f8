//! The clock of a joined capture.
//!
//! In: the time interval of each segment in its own unit, and the seconds that it takes. Out: the [`Place`] of each
//! segment on the clock of all, and the [`Grid`]: so many segments of the temporal filter that every seam is between two
//! of them.

use crate::scene::MAX_SEGMENTS;

/// Segments of the filter for the shortest capture, at least: fewer leave more Gaussians active than are drawn.
const LEAST_PER_CAPTURE: f64 = 10.0;
/// The largest distance between a seam and a boundary of the filter at which the seam is exact, in filter segments:
/// times have single precision.
const EXACT: f64 = 0.01;
/// Relative difference of speeds that is rounding.
const SAME_SPEED: f64 = 1e-6;

/// The times of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    /// First and last timestamp, its own unit.
    pub interval: [f32; 2],
    /// The time of timestamp 0 in the files that it was made from.
    pub origin: f64,
    /// Seconds that the interval takes at speed 1, above 0.
    pub seconds: f64,
}

impl Span {
    /// Returns the length of the interval.
    pub(super) fn length(&self) -> f64 {
        f64::from(self.interval[1]) - f64::from(self.interval[0])
    }

    /// Returns the first timestamp, counted as in the files.
    pub(super) fn begins(&self) -> f64 {
        self.origin + f64::from(self.interval[0])
    }

    /// Returns whether a second is as many timestamp units as in `other`, within single precision.
    pub(super) fn is_as_fast_as(&self, other: &Self) -> bool {
        let (own, other) = (self.length() / self.seconds, other.length() / other.seconds);
        (own - other).abs() <= SAME_SPEED * other
    }
}

/// Where a segment is on the clock of all: it begins at `start` and ends at `end`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Its first timestamp, its own unit.
    pub begin: f64,
    /// Its first timestamp on the clock of all.
    pub start: f64,
    /// Its last timestamp on the clock of all.
    pub end: f64,
    /// Units of the clock of all for each of its own.
    pub scale: f64,
}

impl Place {
    /// Returns the time on the clock of all; the same bits if the clocks are the same.
    pub(super) fn time(&self, own: f32) -> f64 {
        let own = f64::from(own);
        if self.scale == 1.0 {
            return own + (self.start - self.begin);
        }
        self.start + (own - self.begin) * self.scale
    }
}

/// Returns the places of segments that follow one another. The clock is that of the first one: its unit, and its first
/// timestamp.
pub(super) fn following(spans: &[Span]) -> Vec<Place> {
    let Some(first) = spans.first() else { return Vec::new() };
    let rate = first.length() / first.seconds;
    let mut start = f64::from(first.interval[0]);
    let place = |span: &Span| {
        let scale = if span.is_as_fast_as(first) { 1.0 } else { span.seconds * rate / span.length() };
        let begin = f64::from(span.interval[0]);
        let place = Place { begin, start, end: start + span.length() * scale, scale };
        start = place.end;
        place
    };
    spans.iter().map(place).collect()
}

/// Returns the places of segments at their own times, counted as in the files. The clock is that of the first one.
pub(super) fn own(spans: &[Span]) -> Vec<Place> {
    let origin = spans.first().map_or(0.0, |span| span.origin);
    let place = |span: &Span| {
        let begin = f64::from(span.interval[0]);
        let start = begin + (span.origin - origin);
        Place { begin, start, end: start + span.length(), scale: 1.0 }
    };
    spans.iter().map(place).collect()
}

/// The segments of the filter of a joined capture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Grid {
    /// Number of filter segments.
    pub segments: u32,
    /// The first filter segment of each capture, and the one after its last.
    pub edges: Vec<[u32; 2]>,
    /// Whether every seam, and every window of time, is at a boundary of the filter.
    pub is_exact: bool,
}

/// Returns the smallest filter in which every capture has whole segments, and each of them as many as its division, or a
/// multiple. If there is none, the divisions of `needed` are enough, and if these do not fit either, times are rounded.
/// `interval` is that of all; `divisions` and `needed` have a number for each place, 1 for a capture without a filter.
///
/// # Errors
/// The index of a capture that is too short for a segment.
pub(super) fn grid(places: &[Place], interval: [f32; 2], divisions: &[u32], needed: &[u32]) -> Result<Grid, usize> {
    let [first, last] = interval.map(f64::from);
    let unit = |time: f64| (time - first) / (last - first);
    let parts: Vec<[f64; 2]> = places.iter().map(|place| [unit(place.start), unit(place.end)]).collect();
    for divisions in [divisions, needed] {
        let finest = |(part, division): (&[f64; 2], &u32)| LEAST_PER_CAPTURE.max(f64::from(*division)) / length(part);
        let least = parts.iter().zip(divisions).map(finest).fold(1.0, f64::max);
        // Of a capture that is so short that no filter has enough segments, the largest filter is tried.
        let least = least.floor().min(f64::from(MAX_SEGMENTS)) as u32;
        if let Some(segments) = (least..=MAX_SEGMENTS).find(|&segments| fits(&parts, divisions, segments)) {
            return Ok(Grid { segments, edges: edges(&parts, segments)?, is_exact: true });
        }
    }
    Ok(Grid { segments: MAX_SEGMENTS, edges: edges(&parts, MAX_SEGMENTS)?, is_exact: false })
}

fn length(part: &[f64; 2]) -> f64 {
    part[1] - part[0]
}

/// Returns whether every part begins and ends at a boundary of the filter, with a multiple of its division between.
fn fits(parts: &[[f64; 2]], divisions: &[u32], segments: u32) -> bool {
    parts.iter().zip(divisions).all(|(part, &division)| {
        let [first, last] = part.map(|edge| edge * f64::from(segments));
        let is_at = |edge: f64| (edge - edge.round()).abs() <= EXACT;
        let count = last.round() - first.round();
        is_at(first) && is_at(last) && count >= 1.0 && count % f64::from(division.max(1)) == 0.0
    })
}

/// Returns the boundaries nearest to the ends of each part.
fn edges(parts: &[[f64; 2]], segments: u32) -> Result<Vec<[u32; 2]>, usize> {
    let edge = |at: f64| (at * f64::from(segments)).round().clamp(0.0, f64::from(segments)) as u32;
    let edges = |(index, part): (usize, &[f64; 2])| {
        let [first, last] = part.map(edge);
        if first < last { Ok([first, last]) } else { Err(index) }
    };
    parts.iter().enumerate().map(edges).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(interval: [f32; 2], seconds: f64) -> Span {
        Span { interval, origin: 0.0, seconds }
    }

    #[test]
    fn segments_follow_one_another_on_the_clock_of_the_first() {
        let places = following(&[span([1.0, 3.0], 4.0), span([0.0, 1.0], 2.0), span([0.0, 1.0], 1.0)]);
        let ends: Vec<_> = places.iter().map(|place| [place.start, place.end]).collect();
        assert_eq!(ends, [[1.0, 3.0], [3.0, 4.0], [4.0, 4.5]], "half a unit for each second");
        assert_eq!(places[0].time(0.1), f64::from(0.1_f32), "the times of the first keep their bits");
        assert_eq!(places[1].time(0.5), 3.5, "moved");
        assert_eq!((places[2].time(1.0), places[2].scale), (4.5, 0.5), "moved and shortened");
    }

    #[test]
    fn own_times_are_counted_as_in_the_files() {
        let late = Span { origin: 1.7e9 + 4.0, ..span([0.0, 2.0], 2.0) };
        let places = own(&[Span { origin: 1.7e9, ..span([1.0, 3.0], 2.0) }, late]);
        assert_eq!([places[0].start, places[1].start, places[1].end], [1.0, 4.0, 6.0], "a gap of one unit");
    }

    #[test]
    fn every_seam_is_a_boundary_of_the_filter() {
        let places = following(&[span([0.0, 10.0], 10.0), span([0.0, 10.0], 10.0), span([0.0, 5.0], 5.0)]);
        let grid = grid(&places, [0.0, 25.0], &[30, 1, 10], &[1; 3]).expect("no capture is too short");
        assert!(grid.is_exact, "boundaries fit: {grid:?}");
        let counts: Vec<u32> = grid.edges.iter().map(|[first, last]| last - first).collect();
        assert_eq!(counts, [60, 60, 30], "the smallest filter with multiples of 30 and 10 and equal lengths");
        assert_eq!((grid.segments, grid.edges[1]), (150, [60, 120]), "the seams");
    }

    #[test]
    fn lengths_without_a_common_measure_are_rounded_to_the_finest_filter() {
        let places = following(&[span([0.0, 1.0], 1.0), span([0.0, std::f32::consts::SQRT_2], 2.0_f64.sqrt())]);
        let end = places[1].end as f32;
        let rounded = grid(&places, [0.0, end], &[40_000; 2], &[40_000; 2]).expect("no capture is too short");
        assert_eq!((rounded.is_exact, rounded.segments), (false, MAX_SEGMENTS), "two filters of 40,000 do not fit");
        assert_eq!(rounded.edges[0][1], rounded.edges[1][0], "no time is of both or of none");
        let places = following(&[span([0.0, 1e6], 1e6), span([0.0, 1.0], 1.0)]);
        assert_eq!(grid(&places, [0.0, 1e6 + 1.0], &[1; 2], &[1; 2]), Err(1), "the second is too short");
    }
}
