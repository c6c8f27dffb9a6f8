//! The time of a capture, divided.
//!
//! In: its time interval, its seconds at speed 1, the rate of stretches. Out: the number of stretches of equal length,
//! and the moments at which they are looked at ([`Clip`]).

use super::error::CollideError;
use crate::scene::{Colliders, GaussianScene};

/// Number of moments at which a stretch is looked at, its beginning included and its end not.
const MOMENTS: usize = 4;

/// The time of a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Clip {
    /// First time, timestamp units.
    first: f64,
    /// Length, timestamp units; 0 for a still.
    pub span: f64,
    /// Number of stretches; 0 for a still.
    pub stretches: usize,
}

impl Clip {
    /// Returns the time of a capture with so many stretches in a second.
    ///
    /// # Errors
    /// More stretches than a capture may have.
    pub(super) fn of(scene: &GaussianScene, rate: f32) -> Result<Self, CollideError> {
        let [first, last] = scene.trained_with.time_interval.map(f64::from);
        let (span, seconds) = (last - first, f64::from(scene.playback.duration_seconds));
        // NaN is no length either.
        let has_length = |length: f64| length > 0.0 && length.is_finite();
        if !has_length(span) || !has_length(seconds) {
            return Ok(Self { first, span: 0.0, stretches: 0 });
        }
        // A whole number of stretches has no further one for rounding.
        let stretches = (seconds * f64::from(rate) - 1e-4).ceil().max(1.0) as usize;
        if stretches > Colliders::MOST_STRETCHES {
            return Err(CollideError::TooManyStretches { stretches });
        }
        Ok(Self { first, span, stretches })
    }

    /// Returns the time of every moment: those of all stretches, and the end.
    pub(super) fn moments(&self) -> impl Iterator<Item = f32> {
        (0..=MOMENTS * self.stretches).map(move |index| self.time(index as f64 / MOMENTS as f64))
    }

    /// Returns the moments of a stretch without its beginning, and with its end.
    pub(super) fn moments_after(&self, stretch: usize) -> impl Iterator<Item = f32> {
        (1..=MOMENTS).map(move |index| self.time(stretch as f64 + index as f64 / MOMENTS as f64))
    }

    /// Returns the time so many stretches after the beginning, timestamp units.
    pub(super) fn time(&self, stretches: f64) -> f32 {
        (self.first + self.span * stretches / self.stretches.max(1) as f64) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};

    fn clip(time_interval: [f32; 2], duration_seconds: f32, rate: f32) -> Result<Clip, CollideError> {
        let mut scene = synthesize(&SynthSettings { count: 1, ..SynthSettings::default() });
        scene.trained_with.time_interval = time_interval;
        scene.playback.duration_seconds = duration_seconds;
        Clip::of(&scene, rate)
    }

    #[test]
    fn stretches_cover_the_time_and_meet_at_moments() {
        let clip = clip([2.0, 5.0], 0.3, 10.0).expect("three stretches");
        assert_eq!((clip.stretches, clip.span), (3, 3.0), "a tenth of a second each");
        let all: Vec<f32> = clip.moments().collect();
        assert_eq!(all.len(), 13, "four moments each, and the end");
        assert_eq!([all[0], all[4], all[12]], [2.0, 3.0, 5.0], "from the beginning to the end");
        let second: Vec<f32> = clip.moments_after(1).collect();
        assert_eq!(second, all[5..9], "the moments of the second stretch, with the beginning of the third");
        assert_eq!([clip.time(0.0), clip.time(3.0)], [2.0, 5.0], "times of borders");
    }

    #[test]
    fn stills_have_no_stretches_and_one_moment() {
        for (interval, seconds) in [([0.5, 0.5], 1.0), ([0.5, 1.0], 0.0), ([0.5, 1.0], f32::INFINITY)] {
            let still = clip(interval, seconds, 10.0).expect("a still");
            let moments: Vec<f32> = still.moments().collect();
            assert_eq!((still.stretches, still.span, moments), (0, 0.0, vec![0.5]), "{interval:?} in {seconds} s");
        }
    }

    #[test]
    fn part_of_a_stretch_is_a_stretch_and_too_many_are_refused() {
        assert_eq!(clip([0.0, 1.0], 0.01, 10.0).expect("short").stretches, 1, "at least one");
        assert_eq!(clip([0.0, 1.0], 1.05, 10.0).expect("longer").stretches, 11, "rounded up");
        let long = clip([0.0, 1.0], 3600.0, 10.0);
        assert!(matches!(long, Err(CollideError::TooManyStretches { stretches: 36_000 })), "an hour: {long:?}");
    }
}
