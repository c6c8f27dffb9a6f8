//! A clip: a part of a capture, at a time of a timeline.
//!
//! In: a capture, a range of the capture, a start and a speed. Out: whether the clip is shown at a time, its fade, and
//! the [`Playback`] of its entity.

use super::error::InvalidTimeline;
use crate::plugin::component::GaussianCapture;
use crate::plugin::playback::component::Playback;
use crate::plugin::playback::repeat::Repeat;
use bevy::asset::{Handle, VisitAssetDependencies};

/// A part of a capture, at a time of a timeline.
#[derive(VisitAssetDependencies, Debug, Clone, PartialEq)]
pub struct Clip {
    /// The capture.
    #[dependency]
    pub capture: Handle<GaussianCapture>,
    /// The start of the clip, in seconds of the timeline: 0 or later.
    pub start: f32,
    /// The first and the last played moment, in seconds of the capture. Beyond the capture's end, its last moment is
    /// shown; a backward clip begins with it.
    pub range: [f32; 2],
    /// Seconds of the capture per second of the timeline; negative plays from the last moment to the first. Not 0.
    pub speed: f32,
    /// Durations of fading in and fading out, in seconds of the timeline; 0 for none.
    pub fade: [f32; 2],
}

/// Seconds by which consecutive clips may overlap or be apart, because speeds and ends are rounded. A clip is shown
/// this much early, so that no such gap is visible.
pub(super) const TOUCH: f32 = 1e-4;

impl Clip {
    /// Returns the duration of the clip, in seconds of the timeline.
    pub fn duration(&self) -> f32 {
        (self.range[1] - self.range[0]) / self.speed.abs()
    }

    /// Returns the end of the clip, in seconds of the timeline.
    pub fn end(&self) -> f32 {
        self.start + self.duration()
    }

    /// Returns whether the clip is shown at `time`, in seconds of the timeline: from its start until just before its
    /// end, and at its end if the timeline, which lasts `duration` seconds, also ends there.
    pub fn shows(&self, time: f64, duration: f32) -> bool {
        let end = f64::from(self.end());
        self.has_begun(time) && (time < end || self.end() >= duration - TOUCH && time <= f64::from(duration))
    }

    pub(super) fn has_begun(&self, time: f64) -> bool {
        f64::from(self.start) - f64::from(TOUCH) <= time
    }

    /// Returns the factor on the clip's opacity at `time`, in seconds of the timeline: 0 to 1.
    pub fn fade_at(&self, time: f64) -> f32 {
        let fraction = |passed: f64, fade: f32| {
            if fade > 0.0 { (passed / f64::from(fade)).clamp(0.0, 1.0) as f32 } else { 1.0 }
        };
        let (start, end) = (f64::from(self.start), f64::from(self.end()));
        fraction(time - start, self.fade[0]).min(fraction(end - time, self.fade[1]))
    }

    /// Returns the playback that shows this clip while it follows the timeline's clock. `duration` is the duration of
    /// the capture in seconds, `None` until the capture has been loaded.
    pub(super) fn playback(&self, duration: Option<f32>) -> Playback {
        let ([start, end], backwards) = (self.range, self.speed < 0.0);
        // Without this offset, playback would begin at the capture's end immediately.
        let beyond = duration.filter(|_| backwards).map_or(0.0, |duration| (end - duration).max(0.0));
        Playback {
            // If the whole clip is beyond the capture, this time stays and the capture's end is drawn.
            time: if backwards { end } else { start },
            start,
            end,
            speed: self.speed,
            offset: -self.start * self.speed.abs() - beyond,
            repeat: Repeat::Once,
            ..Playback::default()
        }
    }

    /// Checks the numbers of the clip. `track` and `clip` name the clip in errors.
    pub(super) fn check(&self, track: &str, clip: usize) -> Result<(), InvalidTimeline> {
        let ([first, last], [fade_in, fade_out]) = (self.range, self.fade);
        let numbers = [
            ("start", self.start, is_time(self.start), "0 or later, in seconds of the timeline"),
            ("in", first, is_time(first), "0 or later, in seconds of the capture"),
            ("out", last, last.is_finite() && last > first, "later than in, in seconds of the capture"),
            ("speed", self.speed, self.speed.is_normal(), "a number other than 0"),
            ("fade_in", fade_in, is_time(fade_in), "0 or longer, in seconds"),
            ("fade_out", fade_out, is_time(fade_out), "0 or longer, in seconds"),
        ];
        if let Some(&(field, value, _, must)) = numbers.iter().find(|(.., fine, _)| !fine) {
            return Err(InvalidTimeline::Number { track: track.to_owned(), clip, field, value, must });
        }
        let (fades, lasts) = (fade_in + fade_out, self.duration());
        if !self.end().is_finite() {
            let must = "fast enough for the clip to end";
            return Err(InvalidTimeline::Number {
                track: track.to_owned(),
                clip,
                field: "speed",
                value: self.speed,
                must,
            });
        }
        if fades > lasts + TOUCH {
            return Err(InvalidTimeline::Fades { track: track.to_owned(), clip, fades, lasts });
        }
        Ok(())
    }
}

/// Returns whether a number is a time of a timeline or a capture.
pub(super) fn is_time(seconds: f32) -> bool {
    seconds.is_finite() && seconds >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(start: f32, range: [f32; 2], speed: f32) -> Clip {
        Clip { capture: Handle::default(), start, range, speed, fade: [0.0; 2] }
    }

    #[test]
    fn the_duration_of_a_clip_depends_on_its_speed() {
        assert_eq!(clip(1.0, [0.5, 2.5], 1.0).end(), 3.0, "at speed 1 a clip lasts as long as its range");
        assert_eq!(clip(1.0, [0.5, 2.5], -0.5).end(), 5.0, "at speed -0.5 a clip lasts twice as long");
    }

    #[test]
    fn a_backward_clip_waits_for_the_seconds_beyond_its_capture() {
        let backwards = clip(2.0, [0.0, 5.0], -2.0);
        assert_eq!(
            backwards.playback(Some(4.0)).offset,
            -5.0,
            "a backward clip waits for the missing second of the capture"
        );
        assert_eq!(backwards.playback(Some(9.0)).offset, -4.0, "a clip within its capture does not wait");
        assert_eq!(backwards.playback(None).offset, -4.0, "a clip whose capture is not loaded does not wait");
        assert_eq!(clip(2.0, [0.0, 5.0], 2.0).playback(Some(4.0)).offset, -4.0, "a forward clip does not wait");
    }

    #[test]
    fn fades_rise_and_fall_within_the_clip() {
        let faded = Clip { fade: [0.5, 1.0], ..clip(1.0, [0.0, 4.0], 2.0) };
        let fades = [0.0, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 9.0].map(|time| faded.fade_at(time));
        assert_eq!(fades, [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0], "the fades in and out are linear");
        assert_eq!(clip(1.0, [0.0, 4.0], 2.0).fade_at(1.0), 1.0, "a clip without fades has the factor 1");
    }
}
