//! Curved paths of Gaussians, split into straight pieces.
//!
//! In: the path, the lifespan and the scale of each Gaussian, a time interval and a tolerance. Out: [`Pieces`]:
//! Gaussians in straight-line motion, each active in segments of time of its own, so that exactly one piece of a path
//! is active at every time at which it is visible.
//!
//! A piece has the lifespan of its path: its opacity changes as before, and its mean lies on the chord of the path
//! between its first and its last time. Neighbors meet at a boundary between two segments of the temporal filter, where
//! both are on the path.

use super::filter::{ActiveSets, FilterKind, TemporalFilter};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Largest number of pieces of one path.
pub(crate) const MOST_OF_ONE: u32 = 256;
/// Largest number of pieces of all paths, about 2 GiB of sliced Gaussians of color degree 0.
pub(crate) const MOST: usize = 1 << 24;

/// Points of a smooth path that are compared with its chord, both ends excluded. The largest distance of a cubic path
/// is at most 2 % larger than at these points.
const SAMPLES: u32 = 16;
const SAMPLED: f64 = 0.98;
/// Number of paths that one parallel task splits.
const CHUNK: usize = 1024;
/// Factor on the tolerance if there are too many pieces. It halves their number.
const COARSER: f64 = 4.0;

/// The path of a Gaussian and its lifespan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Curve<P> {
    /// Its mean at a time, capture space.
    pub position: P,
    /// Temporal mean, timestamp units.
    pub mean_t: f32,
    /// Temporal standard deviation, timestamp units; infinite if the Gaussian is present at every time.
    pub sigma_t: f32,
    /// The times between which the Gaussian exists, rounded to segments; infinite: at every time.
    pub window: [f32; 2],
    /// The scale that the tolerance is relative to, the middle one of the three; capture units.
    pub scale: f32,
}

/// A window that contains every time.
pub(crate) const ALWAYS: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

/// Where a path may bend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bends {
    /// Anywhere, slowly: a polynomial.
    Smoothly,
    /// Only at boundaries between segments of time: straight lines between key-frames.
    AtSegments,
}

/// How paths are split.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Splitting {
    /// First and last timestamp.
    pub interval: [f32; 2],
    /// Number of segments of the filter, from 1 to [`MAX_SEGMENTS`](super::MAX_SEGMENTS).
    pub segments: u32,
    /// Where paths bend.
    pub bends: Bends,
    /// Largest distance between a path and a piece, relative to the scale of the Gaussian.
    pub tolerance: f32,
    /// The marginal at and below which a Gaussian is not drawn.
    pub cutoff: f32,
}

/// A straight piece of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    /// Index of the Gaussian whose path this is.
    pub source: u32,
    /// Mean at the time `mean_t`, capture space.
    pub mean: [f32; 3],
    /// Velocity, capture units per timestamp unit.
    pub velocity: [f32; 3],
    /// Temporal mean, timestamp units.
    pub mean_t: f32,
    /// The first and the last time at which the piece is active, timestamp units.
    pub times: [f32; 2],
}

impl Piece {
    /// Returns the middle of its times.
    pub(crate) fn middle(&self) -> f32 {
        self.times[0].midpoint(self.times[1])
    }
}

/// All pieces of all paths.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pieces {
    /// The pieces, path by path, those of one path in order of time.
    pub pieces: Vec<Piece>,
    /// The segments in which each piece is active.
    pub filter: TemporalFilter,
    /// Largest distance between a path and its piece, capture units.
    pub error: f64,
    /// Largest such distance relative to the scale of the Gaussian.
    pub relative_error: f64,
    /// Number of paths that are farther from their pieces than the given tolerance: they need shorter pieces than
    /// [`MOST_OF_ONE`] or the segments of the filter allow.
    pub coarse: usize,
    /// Number of paths that are never visible within the interval and have no piece.
    pub unseen: usize,
    /// The tolerance that was used: the given one, or a larger one that limits the pieces to [`MOST`].
    pub tolerance: f32,
}

impl Splitting {
    /// Splits `count` paths.
    pub(crate) fn split<P: Fn(f64) -> DVec3>(&self, count: usize, curve: impl Fn(usize) -> Curve<P> + Sync) -> Pieces {
        self.split_into(count, curve, MOST)
    }

    fn split_into<P: Fn(f64) -> DVec3>(
        &self,
        count: usize,
        curve: impl Fn(usize) -> Curve<P> + Sync,
        most: usize,
    ) -> Pieces {
        let mut tolerance = f64::from(self.tolerance);
        loop {
            let total = AtomicUsize::new(0);
            let is_too_many = || total.load(Ordering::Relaxed) > most && tolerance.is_finite();
            let chunks: Vec<Found> = (0..count.div_ceil(CHUNK))
                .into_par_iter()
                .map(|chunk| {
                    let mut found = Found::default();
                    for index in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                        if is_too_many() {
                            return Found::default();
                        }
                        let before = found.pieces.len();
                        self.split_one(index as u32, &curve(index), tolerance, &mut found);
                        total.fetch_add(found.pieces.len() - before, Ordering::Relaxed);
                    }
                    found
                })
                .collect();
            if !is_too_many() {
                return self.collected(chunks, tolerance);
            }
            // At an infinite tolerance each path has one piece, and no fewer are possible.
            let coarser = tolerance * COARSER;
            tolerance = if coarser < 1e9 { coarser } else { f64::INFINITY };
        }
    }

    /// Adds the pieces of one path.
    fn split_one<P: Fn(f64) -> DVec3>(&self, source: u32, curve: &Curve<P>, tolerance: f64, found: &mut Found) {
        let Some(visible) = self.visible(curve) else {
            found.unseen += 1;
            return;
        };
        let (mut first, end) = (*visible.start(), *visible.end() + 1);
        let shortest = (end - first).div_ceil(MOST_OF_ONE);
        let scale = f64::from(curve.scale);
        let allowed = if tolerance.is_finite() { tolerance * scale } else { f64::INFINITY };
        let (mut length, mut largest) = (end - first, 0.0_f64);
        while first < end {
            let chord = |length| self.chord(&curve.position, first, first + length);
            let fits = |length| chord(length).error <= allowed;
            length = longest(shortest.min(end - first)..=end - first, length, fits);
            let Chord { begins, velocity, error, times } = chord(length);
            largest = largest.max(error);
            let mean_t = if curve.sigma_t.is_finite() { curve.mean_t } else { times[0].midpoint(times[1]) as f32 };
            let mean = (begins + velocity * (f64::from(mean_t) - times[0])).as_vec3().to_array();
            let (velocity, times) = (velocity.as_vec3().to_array(), times.map(|time| time as f32));
            found.pieces.push(Piece { source, mean, velocity, mean_t, times });
            found.intervals.push(first | (first + length - 1) << 16);
            first += length;
        }
        found.error = found.error.max(largest);
        let relative = if largest == 0.0 { 0.0 } else { largest / scale };
        found.relative_error = found.relative_error.max(relative);
        found.coarse += usize::from(relative > f64::from(self.tolerance));
    }

    /// Returns the segments in which a Gaussian is visible; `None` if it is visible in none.
    fn visible<P>(&self, curve: &Curve<P>) -> Option<RangeInclusive<u32>> {
        let [begin, end] = self.interval.map(f64::from);
        let span = end - begin;
        let segments = f64::from(self.segments);
        let position = |time: f64| (time - begin) / span * segments;
        let [opens, closes] = curve.window.map(|time| position(f64::from(time)).round().clamp(0.0, segments));
        // A window with a NaN has no segment.
        if opens.partial_cmp(&closes).is_none_or(|order| order.is_ge()) {
            return None;
        }
        let (opens, closes) = (opens as u32, closes as u32 - 1);
        if !curve.sigma_t.is_finite() {
            return Some(opens..=closes);
        }
        // A margin covers the rounding of times.
        let reach = (-2.0 * f64::from(self.cutoff).ln()).sqrt() * 1.0001;
        let half = reach * f64::from(curve.sigma_t) + span * 1e-6;
        let mean = f64::from(curve.mean_t);
        if mean + half < begin || mean - half > end {
            return None;
        }
        let segment = |time: f64| position(time).floor().clamp(0.0, segments - 1.0) as u32;
        let (first, last) = (segment(mean - half).max(opens), segment(mean + half).min(closes));
        (first <= last).then_some(first..=last)
    }

    /// Returns the chord of a path between two boundaries of segments.
    fn chord(&self, position: &impl Fn(f64) -> DVec3, from: u32, to: u32) -> Chord {
        let times = [from, to].map(|boundary| self.time(f64::from(boundary)));
        let [begins, ends] = times.map(position);
        let velocity = (ends - begins) / (times[1] - times[0]);
        let (steps, factor) = match self.bends {
            Bends::Smoothly => (SAMPLES + 1, SAMPLED.recip()),
            Bends::AtSegments => (to - from, 1.0),
        };
        let distance = |step: u32| {
            let part = f64::from(step) / f64::from(steps);
            let path = position(self.time(f64::from(from) + f64::from(to - from) * part));
            path.distance(begins.lerp(ends, part))
        };
        let error = (1..steps).map(distance).fold(0.0, f64::max) * factor;
        Chord { begins, velocity, error, times }
    }

    /// Returns the time of a position counted in segments.
    fn time(&self, position: f64) -> f64 {
        let [begin, end] = self.interval.map(f64::from);
        begin + (end - begin) * (position / f64::from(self.segments))
    }

    fn collected(&self, chunks: Vec<Found>, tolerance: f64) -> Pieces {
        let count = chunks.iter().map(|chunk| chunk.pieces.len()).sum();
        let mut all =
            Found { pieces: Vec::with_capacity(count), intervals: Vec::with_capacity(count), ..Found::default() };
        for chunk in chunks {
            all.pieces.extend(chunk.pieces);
            all.intervals.extend(chunk.intervals);
            all.error = all.error.max(chunk.error);
            all.relative_error = all.relative_error.max(chunk.relative_error);
            all.coarse += chunk.coarse;
            all.unseen += chunk.unseen;
        }
        let Found { pieces, intervals, error, relative_error, coarse, unseen } = all;
        let sets = ActiveSets::Intervals(intervals);
        let filter = TemporalFilter { kind: FilterKind::Window, segments: self.segments, count, sets };
        Pieces { pieces, filter, error, relative_error, coarse, unseen, tolerance: tolerance as f32 }
    }
}

/// The straight line between two points of a path.
struct Chord {
    begins: DVec3,
    velocity: DVec3,
    error: f64,
    times: [f64; 2],
}

/// The pieces of some paths.
#[derive(Default)]
struct Found {
    pieces: Vec<Piece>,
    intervals: Vec<u32>,
    error: f64,
    relative_error: f64,
    coarse: usize,
    unseen: usize,
}

/// Returns the largest length in a range that fits, to within 1/64 of it; the smallest if none fits. Tries `guess`
/// first.
fn longest(range: RangeInclusive<u32>, guess: u32, fits: impl Fn(u32) -> bool) -> u32 {
    let (mut fitting, most) = range.into_inner();
    let mut length = guess.clamp(fitting, most);
    let mut too_long = most + 1;
    while length < too_long {
        if fits(length) {
            fitting = length;
            length = length.saturating_mul(2).min(most).max(length + 1);
        } else {
            too_long = length;
        }
    }
    while too_long - fitting > (fitting / 64).max(1) {
        let between = fitting + (too_long - fitting) / 2;
        if fits(between) {
            fitting = between;
        } else {
            too_long = between;
        }
    }
    fitting
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Gaussian;
    use crate::scene::MAX_SEGMENTS;
    use proptest::prelude::*;

    const CUTOFF: f32 = 0.01;

    fn splitting(segments: u32, tolerance: f32) -> Splitting {
        Splitting { interval: [-1.0, 3.0], segments, bends: Bends::Smoothly, tolerance, cutoff: CUTOFF }
    }

    fn gaussian(piece: &Piece, sigma_t: f32) -> Gaussian {
        let Piece { mean, velocity, mean_t, .. } = *piece;
        Gaussian { mean, velocity, mean_t, sigma_t, ..bytemuck::Zeroable::zeroed() }
    }

    /// Returns the only active piece at a time.
    fn active(pieces: &Pieces, interval: [f32; 2], time: f32) -> Option<&Piece> {
        let segment = pieces.filter.segment_of(time, interval);
        let mut active = (0..pieces.pieces.len()).filter(|&index| pieces.filter.is_active(segment, index));
        let found = active.next();
        assert_eq!(active.next(), None, "at {time} no second piece is active");
        found.map(|index| &pieces.pieces[index])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn one_piece_within_the_tolerance_is_active_wherever_a_cubic_path_is_visible(
            coefficients in prop::array::uniform4(prop::array::uniform3(-5.0f64..5.0)),
            mean_t in -2.0f32..4.0,
            sigma in prop_oneof![Just(f32::INFINITY), 0.001f32..2.0],
            scale in 0.01f32..1.0,
            segments in prop_oneof![Just(MAX_SEGMENTS), 20_000u32..MAX_SEGMENTS],
        ) {
            let splitting = splitting(segments, 0.25);
            let position = |time: f64| {
                let since = time - f64::from(mean_t);
                coefficients.iter().rev().fold(DVec3::ZERO, |sum, &c| sum * since + DVec3::from(c))
            };
            let pieces = splitting.split(1, |_| Curve { position, mean_t, sigma_t: sigma, window: ALWAYS, scale });
            prop_assert!(pieces.filter.check(pieces.pieces.len()).is_ok(), "the filter is that of the pieces");
            prop_assert!(pieces.pieces.len() <= MOST_OF_ONE as usize, "the number of pieces is bounded");
            let allowed = if pieces.coarse == 0 { 0.25 * f64::from(scale) } else { pieces.error };
            for step in 0..=2000 {
                let time = -1.0 + 4.0 * (step as f32 / 2000.0);
                let found = active(&pieces, splitting.interval, time);
                let is_visible = Gaussian { mean_t, sigma_t: sigma, ..bytemuck::Zeroable::zeroed() }.marginal(time) > CUTOFF;
                prop_assert!(found.is_some() || !is_visible, "visible at {time} without a piece");
                let Some(piece) = found else { continue };
                let own = gaussian(piece, sigma);
                prop_assert!(sigma.is_infinite() || own.mean_t == mean_t, "the lifespan is that of the path");
                let distance = own.mean_at(time).as_dvec3().distance(position(f64::from(time)));
                // Single precision of positions up to some hundred units.
                prop_assert!(distance <= allowed * 1.001 + 5e-3, "{distance} from the path at {time}, allowed {allowed}");
            }
        }

        #[test]
        fn a_path_of_straight_lines_between_key_frames_is_split_only_where_it_bends(
            bends in prop::collection::btree_set(1usize..40, 0..6),
            speeds in prop::collection::vec(prop::array::uniform3(-3.0f64..3.0), 7),
        ) {
            let mut points = vec![DVec3::ZERO];
            let mut speed = 0;
            for frame in 0..40 {
                speed += usize::from(bends.contains(&frame));
                points.push(points[frame] + DVec3::from(speeds[speed]));
            }
            let position = |time: f64| {
                let frame = ((time + 1.0) / 4.0 * 40.0).clamp(0.0, 40.0);
                let before = (frame as usize).min(39);
                points[before].lerp(points[before + 1], frame - before as f64)
            };
            let splitting = Splitting { bends: Bends::AtSegments, ..splitting(40, 1e-6) };
            let pieces = splitting.split(1, |_| Curve { position, mean_t: 0.0, sigma_t: f32::INFINITY, window: ALWAYS, scale: 1.0 });
            prop_assert!(pieces.pieces.len() <= bends.len() + 1, "a straight line is one piece");
            prop_assert!(pieces.relative_error <= 1e-6 && pieces.coarse == 0, "the pieces pass through the key-frames");
        }
    }

    fn circle(time: f64) -> DVec3 {
        DVec3::new(time.cos(), time.sin(), 0.0)
    }

    #[test]
    fn pieces_of_many_paths_are_in_the_order_of_their_gaussians() {
        let curve = |index: usize| Curve {
            position: move |time: f64| circle(time * index as f64),
            mean_t: 1.0,
            sigma_t: if index == 7 { f32::INFINITY } else { 0.2 },
            window: ALWAYS,
            scale: 0.1,
        };
        let pieces = splitting(MAX_SEGMENTS, 0.25).split(3000, curve);
        let sources: Vec<u32> = pieces.pieces.iter().map(|piece| piece.source).collect();
        assert!(sources.is_sorted() && sources.last() == Some(&2999), "pieces are in the order of their paths");
        assert_eq!(sources.iter().filter(|&&source| source == 0).count(), 1, "a Gaussian at rest is one piece");
        assert!(pieces.coarse > 0, "fast paths need more pieces than are allowed");
    }

    #[test]
    fn a_limit_on_all_pieces_raises_the_tolerance() {
        let curve = |_| Curve { position: circle, mean_t: 1.0, sigma_t: f32::INFINITY, window: ALWAYS, scale: 0.01 };
        let splitting = splitting(MAX_SEGMENTS, 0.25);
        let free = splitting.split_into(100, curve, usize::MAX);
        let limited = splitting.split_into(100, curve, free.pieces.len() - 1);
        assert!(limited.pieces.len() < free.pieces.len(), "a limit leaves fewer pieces");
        assert_eq!((free.tolerance, limited.tolerance), (0.25, 1.0), "the raised tolerance is returned");
        assert_eq!((free.coarse, limited.coarse), (0, 100), "paths beyond the given tolerance are counted");
        assert_eq!(splitting.split_into(100, curve, 3).pieces.len(), 100, "each path keeps one piece");
    }

    #[test]
    fn a_path_outside_the_interval_has_no_piece() {
        let curve = |_| Curve { position: circle, mean_t: 9.0, sigma_t: 0.1, window: ALWAYS, scale: 0.01 };
        let pieces = splitting(100, 0.25).split(5, curve);
        assert_eq!((pieces.pieces.len(), pieces.unseen), (0, 5), "every path is unseen");
    }

    #[test]
    fn a_window_limits_when_a_path_is_active() {
        let windows = [[-1.0, 0.0], [0.0, 1.0], [2.5, 9.0], [5.0, 6.0], [1.001, 1.002]];
        let curve = |index: usize| {
            let sigma_t = if index == 0 { 0.1 } else { f32::INFINITY };
            Curve { position: |_| DVec3::ONE, mean_t: 0.05, sigma_t, window: windows[index], scale: 0.1 }
        };
        let pieces = splitting(40, 0.25).split(windows.len(), curve);
        let ActiveSets::Intervals(intervals) = &pieces.filter.sets else { panic!("intervals") };
        let ends: Vec<_> = intervals.iter().map(|word| (word & 0xffff, word >> 16)).collect();
        assert_eq!(
            ends,
            [(7, 9), (10, 19), (35, 39)],
            "windows in segments of a tenth of a unit; the lifespan also limits the first path"
        );
        assert_eq!(pieces.unseen, 2, "windows outside the interval, or shorter than half a segment");
    }

    #[test]
    fn a_path_that_is_not_finite_ends_in_a_bounded_number_of_pieces() {
        let curve =
            |_| Curve { position: |_| DVec3::NAN, mean_t: 1.0, sigma_t: f32::INFINITY, window: ALWAYS, scale: 0.0 };
        let pieces = splitting(MAX_SEGMENTS, 0.25).split(1, curve);
        assert!(pieces.pieces.len() <= MOST_OF_ONE as usize, "the number of pieces is bounded");
    }
}
