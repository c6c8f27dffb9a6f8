//! Bounding boxes of a capture, over its whole time interval and over stretches of that interval.
//!
//! In: runtime Gaussians. Out: [`Bounds`] and [`BoundsOverTime`] in capture space.

use super::filter::TemporalFilter;
use crate::gaussian::{Gaussian, lifespan_reach};
use glam::{DVec3, Vec3};

/// Number of stretches of time, each with a box.
const TIME_SPANS: usize = 32;
/// Relative margin of the boxes: more than the `f32` rounding of drawing.
const ROUNDING: f64 = 1e-6;
/// Distance from the border of two stretches, in stretches, within which a time belongs to both.
const BORDER: f64 = 1e-6;

/// An axis-aligned box in capture space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Bounds {
    /// Returns the box that holds three standard deviations of every Gaussian wherever it is drawn within `interval`;
    /// `None` if no Gaussian is drawn. A Gaussian is drawn while its marginal is above `cutoff`, and in its window if
    /// `filter` is one of [windows](super::FilterKind::Window). Gaussians that cannot be drawn ([`Gaussian::check`])
    /// are ignored.
    pub fn of(
        gaussians: impl Iterator<Item = Gaussian>,
        interval: [f32; 2],
        cutoff: f32,
        filter: Option<&TemporalFilter>,
    ) -> Option<Self> {
        BoundsOverTime::with_stretches(gaussians, interval, cutoff, filter, 1).map(|bounds| bounds.whole)
    }

    /// Returns the box around the middle nine tenths of the means, each at its own temporal mean, along each axis:
    /// where to point a camera, without stray Gaussians. `None` if there is no Gaussian.
    pub fn core(gaussians: impl Iterator<Item = Gaussian>) -> Option<Self> {
        let means: Vec<[f32; 3]> = gaussians.map(|gaussian| gaussian.mean).collect();
        Self::core_of(&means)
    }

    /// Returns the [`core`](Self::core) of Gaussians with these means.
    pub(crate) fn core_of(means: &[[f32; 3]]) -> Option<Self> {
        let (low, high) = (means.len() / 20, means.len().checked_sub(1 + means.len() / 20)?);
        let (mut min, mut max) = (Vec3::ZERO, Vec3::ZERO);
        for axis in 0..3 {
            let mut values: Vec<f32> = means.iter().map(|mean| mean[axis]).collect();
            min[axis] = *values.select_nth_unstable_by(low, f32::total_cmp).1;
            max[axis] = *values.select_nth_unstable_by(high, f32::total_cmp).1;
        }
        Some(Self { min, max })
    }

    /// Returns the box around both boxes.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Returns its center.
    pub fn center(self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Returns half its diagonal.
    pub fn radius(self) -> f32 {
        (self.max - self.min).length() * 0.5
    }

    /// Returns the box of `factor` times the size around the same center.
    pub fn scaled(self, factor: f32) -> Self {
        let (center, half) = (self.center(), (self.max - self.min) * (0.5 * factor));
        Self { min: center - half, max: center + half }
    }

    /// Returns the distance at which a ray enters the box, in lengths of `direction` from `origin`: 0 if it starts
    /// inside, `None` if it misses the box.
    pub fn entry(self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let (mut from, mut to) = (0.0f32, f32::INFINITY);
        for axis in 0..3 {
            if direction[axis] == 0.0 {
                if origin[axis] < self.min[axis] || origin[axis] > self.max[axis] {
                    return None;
                }
                continue;
            }
            let [a, b] = [self.min[axis], self.max[axis]].map(|side| (side - origin[axis]) / direction[axis]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        (from <= to).then_some(from)
    }
}

/// The boxes of a capture over equal stretches of its time.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundsOverTime {
    interval: [f32; 2],
    /// The box of each stretch; `None` if no Gaussian is drawn in it. At least one stretch.
    stretches: Vec<Option<Bounds>>,
    whole: Bounds,
}

impl BoundsOverTime {
    /// Returns the boxes that hold three standard deviations of every Gaussian wherever it is drawn, for 32 stretches
    /// of `interval` (one, if the interval has no length); `None` if no Gaussian is drawn. Gaussians that cannot be
    /// drawn ([`Gaussian::check`]) are ignored. A Gaussian is drawn as in [`Bounds::of`].
    pub fn of(
        gaussians: impl Iterator<Item = Gaussian>,
        interval: [f32; 2],
        cutoff: f32,
        filter: Option<&TemporalFilter>,
    ) -> Option<Self> {
        Self::with_stretches(gaussians, interval, cutoff, filter, TIME_SPANS)
    }

    fn with_stretches(
        gaussians: impl Iterator<Item = Gaussian>,
        interval: [f32; 2],
        cutoff: f32,
        filter: Option<&TemporalFilter>,
        stretches: usize,
    ) -> Option<Self> {
        let reach = lifespan_reach(cutoff);
        let count = if interval[0] < interval[1] { stretches } else { 1 };
        let mut extents = vec![Extent::EMPTY; count];
        for (index, gaussian) in gaussians.enumerate().filter(|(_, gaussian)| gaussian.check().is_ok()) {
            let half = reach * f64::from(gaussian.sigma_t);
            let [mut from, mut to] = [-half, half].map(|way| f64::from(gaussian.mean_t) + way);
            if let Some(filter) = filter {
                let [first, last] = filter.window(index, interval);
                (from, to) = (from.max(first), to.min(last));
            }
            cover(&mut extents, &gaussian, [from, to], interval.map(f64::from));
        }
        let stretches: Vec<_> = extents.into_iter().map(Extent::bounds).collect();
        let whole = stretches.iter().flatten().copied().reduce(Bounds::union)?;
        Some(Self { interval, stretches, whole })
    }

    /// Returns the box around all Gaussians that are drawn at any time.
    pub fn whole(&self) -> Bounds {
        self.whole
    }

    /// Returns the box around all Gaussians that are drawn in the stretch that contains `time`, a timestamp of the
    /// capture (around both stretches at a border); `None` if no Gaussian is drawn. A time outside the interval is
    /// clamped to it.
    pub fn at(&self, time: f32) -> Option<Bounds> {
        let [start, end] = self.interval.map(f64::from);
        let place = (f64::from(time) - start) / (end - start) * self.stretches.len() as f64;
        // Negative values and NaN become 0.
        let stretch = |place: f64| (place as usize).min(self.stretches.len() - 1);
        let near = &self.stretches[stretch(place - BORDER)..=stretch(place + BORDER)];
        near.iter().flatten().copied().reduce(Bounds::union)
    }
}

/// Grows the boxes of all stretches in which a Gaussian is drawn, from time `from` to time `to`. The Gaussian moves in
/// a straight line, so its positions at both ends of its time in a stretch bound those in between.
fn cover(extents: &mut [Extent], gaussian: &Gaussian, [from, to]: [f64; 2], [start, end]: [f64; 2]) {
    let mean_t = f64::from(gaussian.mean_t);
    let (first, last) = (start.max(from), end.min(to));
    if first > last {
        return;
    }
    let [mean, velocity] = [gaussian.mean, gaussian.velocity].map(|vector| DVec3::from(vector.map(f64::from)));
    let [xx, _, _, yy, _, zz] = gaussian.covariance.map(f64::from);
    let reach = 3.0 * DVec3::new(xx, yy, zz).max(DVec3::ZERO).map(f64::sqrt);
    let farthest = (first - mean_t).abs().max((last - mean_t).abs());
    let reach = reach + ROUNDING * (mean.abs() + velocity.abs() * farthest + reach);
    let length = (end - start) / extents.len() as f64;
    let stretch = |time: f64| (((time - start) / length) as usize).min(extents.len() - 1);
    let drawn_in = stretch(first)..=stretch(last);
    for index in drawn_in {
        let from = first.max(start + index as f64 * length);
        let to = last.min(start + (index + 1) as f64 * length);
        for time in [from, to] {
            extents[index].add(mean + velocity * (time - mean_t), reach);
        }
    }
}

/// A box that grows.
#[derive(Clone, Copy)]
struct Extent {
    min: DVec3,
    max: DVec3,
}

impl Extent {
    const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    fn add(&mut self, center: DVec3, reach: DVec3) {
        self.min = self.min.min(center - reach);
        self.max = self.max.max(center + reach);
    }

    /// Returns the box; `None` if it is empty. Coordinates beyond the range of `f32` are clamped to it.
    fn bounds(self) -> Option<Bounds> {
        let clamped =
            |corner: DVec3| corner.clamp(DVec3::splat(f32::MIN.into()), DVec3::splat(f32::MAX.into())).as_vec3();
        (self.min.x <= self.max.x).then(|| Bounds { min: clamped(self.min), max: clamped(self.max) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::MARGINAL_CUTOFF;
    use crate::scene::{ActiveSets, FilterKind};
    use proptest::array::uniform3;
    use proptest::collection::vec;
    use proptest::prelude::*;

    /// Returns a round Gaussian.
    fn gaussian(mean: Vec3, velocity: Vec3, mean_t: f32, sigma_t: f32, scale: f32) -> Gaussian {
        let variance = scale * scale;
        Gaussian {
            mean: mean.to_array(),
            mean_t,
            velocity: velocity.to_array(),
            sigma_t,
            covariance: [variance, 0.0, 0.0, variance, 0.0, variance],
            opacity: 0.5,
            padding: 0.0,
        }
    }

    /// Returns a Gaussian that moves along x from 0 to 10 within the interval [0, 1].
    fn runner() -> Gaussian {
        gaussian(Vec3::new(5.0, 0.0, 0.0), Vec3::new(10.0, 0.0, 0.0), 0.5, f32::INFINITY, 0.01)
    }

    fn over_time(gaussians: &[Gaussian], interval: [f32; 2]) -> Option<BoundsOverTime> {
        BoundsOverTime::of(gaussians.iter().copied(), interval, MARGINAL_CUTOFF, None)
    }

    fn holds(outer: Bounds, inner: Bounds) -> bool {
        outer.min.cmple(inner.min).all() && outer.max.cmpge(inner.max).all()
    }

    /// Generates Gaussians that are short-lived or permanent, at rest or fast, points or large.
    fn any_gaussian() -> impl Strategy<Value = Gaussian> {
        let lifespan = prop_oneof![1e-6f32..0.01, 0.01f32..3.0, Just(f32::INFINITY)];
        (uniform3(-50.0f32..50.0), uniform3(-30.0f32..30.0), -1.0f32..2.0, lifespan, 0.0f32..2.0).prop_map(
            |(mean, velocity, mean_t, sigma_t, scale)| gaussian(mean.into(), velocity.into(), mean_t, sigma_t, scale),
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn drawn_gaussians_are_inside_the_box_of_the_time(
            gaussians in vec(any_gaussian(), 1..12),
            start in -1.0f32..1.0,
            span in 0.01f32..4.0,
            moments in vec(0.0f32..=1.0, 20),
        ) {
            let bounds = over_time(&gaussians, [start, start + span]);
            // The borders between stretches are tested too.
            let borders = (0..=TIME_SPANS).map(|index| index as f32 / TIME_SPANS as f32);
            for time in moments.into_iter().chain(borders).map(|moment| start + moment * span) {
                for gaussian in gaussians.iter().filter(|gaussian| gaussian.marginal(time) > MARGINAL_CUTOFF) {
                    let (mean, reach) = (gaussian.mean_at(time), 3.0 * gaussian.covariance[0].sqrt());
                    let drawn = Bounds { min: mean - reach, max: mean + reach };
                    let bounds = bounds.as_ref().expect("a Gaussian is drawn");
                    let now = bounds.at(time).expect("a Gaussian is drawn at this time");
                    prop_assert!(holds(now, drawn), "at {time}, {drawn:?} is inside {now:?}");
                    prop_assert!(holds(bounds.whole(), now), "the whole box contains the box at {time}");
                }
            }
        }
    }

    #[test]
    fn a_gaussian_is_bounded_in_its_window_only() {
        let sets = ActiveSets::Intervals(vec![5 | 5 << 16]);
        let window = TemporalFilter { kind: FilterKind::Window, segments: 10, count: 1, sets };
        let bounds = |filter| Bounds::of([runner()].into_iter(), [0.0, 1.0], MARGINAL_CUTOFF, filter).expect("drawn");
        let found = bounds(Some(&window));
        assert!(
            (found.min.x - 5.0).abs() < 0.1 && (found.max.x - 6.0).abs() < 0.1,
            "drawn from time 0.5 to 0.6: {found:?}"
        );
        let other = TemporalFilter { kind: FilterKind::Interval, ..window.clone() };
        assert_eq!(bounds(Some(&other)), bounds(None), "a filter of another kind does not change the box");
    }

    #[test]
    fn the_box_of_a_stretch_is_smaller_than_the_whole_box() {
        let bounds = over_time(&[runner()], [0.0, 1.0]).expect("drawn");
        assert!(bounds.whole().max.x - bounds.whole().min.x > 10.0, "the whole box contains a motion of ten units");
        for time in [0.0, 0.3, 0.5, 1.0] {
            let now = bounds.at(time).expect("drawn at every time");
            let [length, most] = [now.max.x - now.min.x, 2.0 * 10.0 / TIME_SPANS as f32 + 0.07];
            assert!(length < most, "at {time} the box is {length} long; two stretches are {most}");
        }
        assert_eq!(bounds.at(-9.0), bounds.at(0.0), "a time before the start is clamped to the start");
        assert_eq!(bounds.at(f32::INFINITY), bounds.at(1.0), "a time after the end is clamped to the end");
        assert_eq!(bounds.at(f32::NAN), bounds.at(0.0), "NaN is treated as the start");
    }

    #[test]
    fn the_box_at_a_border_covers_both_stretches() {
        let bounds = over_time(&[runner()], [0.0, 1.0]).expect("drawn");
        let step = 1.0 / TIME_SPANS as f32;
        let [before, border, after] =
            [0.5, 1.0, 1.5].map(|place| bounds.at(place * step).expect("drawn at every time"));
        assert_eq!(border, before.union(after), "the box at a border is the box around both stretches");
    }

    #[test]
    fn a_time_at_which_no_gaussian_is_drawn_has_no_box() {
        let flash = gaussian(Vec3::ZERO, Vec3::ZERO, 0.5, 0.01, 0.1);
        let bounds = over_time(&[flash], [0.0, 1.0]).expect("drawn at one time");
        assert_eq!(bounds.at(0.1), None, "no Gaussian is drawn before the flash");
        assert_eq!(bounds.at(0.5), Some(bounds.whole()), "the flash is drawn at its temporal mean");
        assert_eq!(over_time(&[flash], [2.0, 3.0]), None, "no Gaussian is drawn within the interval");
        assert_eq!(over_time(&[], [0.0, 1.0]), None, "an empty scene has no box");
    }

    #[test]
    fn an_interval_of_length_zero_has_one_stretch() {
        let bounds = over_time(&[runner()], [0.25, 0.25]).expect("drawn");
        assert_eq!(bounds.stretches.len(), 1, "an interval of length zero has one stretch");
        for time in [0.0, 0.25, 1.0] {
            assert_eq!(bounds.at(time), Some(bounds.whole()), "the same box at {time}");
        }
        let [low, high] = [bounds.whole().min.x, bounds.whole().max.x];
        assert!(
            low < 2.5 && high > 2.5 && high - low < 0.1,
            "the box is around the position at that time: {low} to {high}"
        );
    }

    #[test]
    fn gaussians_that_cannot_be_drawn_are_ignored() {
        let good = runner();
        let expected = over_time(&[good], [0.0, 1.0]);
        for poison in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let poisoned = [
                Gaussian { mean: [poison, 0.0, 0.0], ..good },
                Gaussian { velocity: [0.0, poison, 0.0], ..good },
                Gaussian { mean_t: poison, ..good },
                Gaussian { covariance: [poison; 6], ..good },
                Gaussian { sigma_t: -poison.abs(), ..good },
            ];
            for bad in poisoned {
                assert_eq!(over_time(&[bad, good, bad], [0.0, 1.0]), expected, "{bad:?} is ignored");
                assert_eq!(over_time(&[bad], [0.0, 1.0]), None, "{bad:?} alone has no box");
            }
        }
        let far = Gaussian { velocity: [f32::MAX, f32::MIN, 0.0], ..good };
        let bounds = over_time(&[far], [0.0, 10.0]).expect("drawn");
        assert!(
            bounds.whole().min.is_finite() && bounds.whole().max.is_finite(),
            "a box of extreme coordinates is finite"
        );
    }

    #[test]
    fn a_ray_enters_the_box_at_its_surface() {
        let unit = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let entry = |origin: [f32; 3], direction: [f32; 3]| unit.entry(origin.into(), direction.into());
        assert_eq!(entry([0.0, 0.0, -5.0], [0.0, 0.0, 2.0]), Some(2.0), "the distance is in lengths of the direction");
        assert_eq!(entry([0.5, 0.5, 0.5], [1.0, 0.0, 0.0]), Some(0.0), "a ray from inside enters at distance 0");
        assert_eq!(entry([0.0, 0.0, 5.0], [0.0, 0.0, 2.0]), None, "a box behind the origin is missed");
        assert_eq!(entry([0.0, 1.5, -5.0], [0.0, 0.0, 1.0]), None, "a ray outside and parallel to a side misses");
        assert_eq!(entry([-3.0, 0.0, 0.0], [1.0, 1.0, 0.0]), None, "a ray past a corner misses");
        assert_eq!(entry([-2.0, -1.0, 0.0], [1.0, 1.0, 0.0]), Some(1.0), "a ray through a corner enters there");
        let grown = unit.scaled(2.0);
        assert_eq!((grown.min, grown.max), (Vec3::splat(-2.0), Vec3::splat(2.0)), "the box has twice the size");
    }
}
