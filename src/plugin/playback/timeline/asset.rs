//! The timeline in memory: tracks of clips, and markers.
//!
//! In: tracks and markers, in any order. Out: a [`Timeline`] that makes sense, or an [`InvalidTimeline`]; and what a clip shows at
//! a time.

use crate::plugin::asset::GaussianCapture;
use crate::plugin::playback::{Playback, Repeat};
use bevy::asset::{Asset, Handle, VisitAssetDependencies};
use bevy::reflect::TypePath;
use std::collections::HashSet;

/// When which capture plays. Play it with a [`TimelinePlayer`](super::TimelinePlayer).
#[derive(Asset, TypePath, Debug, Clone, PartialEq)]
pub struct Timeline {
    #[dependency]
    tracks: Vec<Track>,
    markers: Vec<Marker>,
    duration: f32,
}

/// A place for captures that play one after the other.
#[derive(VisitAssetDependencies, Debug, Clone, PartialEq)]
pub struct Track {
    /// Which [`TimelineTrack`](super::TimelineTrack) plays it; unique in the timeline.
    pub name: String,
    /// What is played. None overlaps another.
    #[dependency]
    pub clips: Vec<Clip>,
}

/// A part of a capture, at a time.
#[derive(VisitAssetDependencies, Debug, Clone, PartialEq)]
pub struct Clip {
    /// What is played.
    #[dependency]
    pub capture: Handle<GaussianCapture>,
    /// When it begins, in seconds of the timeline.
    pub start: f32,
    /// The first and the last moment of the capture that are played, in its seconds. Beyond its end it stands still at its last
    /// moment: backwards, that is where it begins.
    pub range: [f32; 2],
    /// Seconds of the capture per second of the timeline; negative plays from the last moment to the first.
    pub speed: f32,
    /// How long fading in and out take, in seconds of the timeline.
    pub fade: [f32; 2],
}

/// A moment with a name, told by [`MarkerReached`](crate::plugin::playback::MarkerReached).
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// When it is, in seconds of the timeline.
    pub time: f32,
    /// What the message says.
    pub name: String,
}

/// What is wrong with a timeline. Clips and markers are counted from 1, in the order in which they are written.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InvalidTimeline {
    /// There is nothing to play.
    #[error("the timeline has neither clips nor markers nor a duration; give it at least one clip")]
    Empty,
    /// Two tracks have one name.
    #[error("two tracks are named {0:?}; a track's name says which entity plays it, so give each its own")]
    SameName(String),
    /// A number cannot be what it stands for.
    #[error("track {track:?}, clip {clip}: {field} is {value}, but must be {must}")]
    Number {
        /// The track's name.
        track: String,
        /// The clip.
        clip: usize,
        /// As it is called in files.
        field: &'static str,
        /// What it is.
        value: f32,
        /// What it should be.
        must: &'static str,
    },
    /// A clip fades in and out for longer than it lasts.
    #[error(
        "track {track:?}, clip {clip}: fades take {fades} s, but the clip lasts {lasts} s; shorten fade_in or fade_out"
    )]
    Fades {
        /// The track's name.
        track: String,
        /// The clip.
        clip: usize,
        /// Seconds of both fades.
        fades: f32,
        /// Seconds of the clip.
        lasts: f32,
    },
    /// Two clips of a track are to play at once.
    #[error(
        "track {track:?}: clip {second} starts at {start} s, before clip {first} ends at {end} s; move one to another track"
    )]
    Overlap {
        /// The track's name.
        track: String,
        /// The clip that starts earlier.
        first: usize,
        /// When it ends.
        end: f32,
        /// The clip that starts too early.
        second: usize,
        /// When it starts.
        start: f32,
    },
    /// A marker is at no possible time.
    #[error("marker {marker} ({name:?}): time is {time}, but must be 0 or later, in seconds")]
    MarkerTime {
        /// The marker.
        marker: usize,
        /// Its name.
        name: String,
        /// When it is.
        time: f32,
    },
    /// The duration given leaves no time for everything.
    #[error("duration is {given} s, but the last clip or marker ends at {needed} s; leave duration out or lengthen it")]
    Duration {
        /// What was given.
        given: f32,
        /// What it takes.
        needed: f32,
    },
}

/// Clips that follow each other may overlap by this much, in seconds, or leave this much between them: rounding of speeds and
/// ends. So that nothing is seen of it, a clip is taken on this much early.
const TOUCH: f32 = 1e-4;

impl Timeline {
    /// A timeline that lasts until its last clip or marker, or for `duration` seconds, if given.
    ///
    /// # Errors
    /// The first thing that makes no sense.
    pub fn new(
        mut tracks: Vec<Track>,
        mut markers: Vec<Marker>,
        duration: Option<f32>,
    ) -> Result<Self, InvalidTimeline> {
        let mut needed = 0.0f32;
        let mut names = HashSet::new();
        for track in &mut tracks {
            if !names.insert(track.name.clone()) {
                return Err(InvalidTimeline::SameName(track.name.clone()));
            }
            needed = needed.max(track.check()?);
        }
        for (index, Marker { time, name }) in markers.iter().enumerate() {
            if !is_time(*time) {
                return Err(InvalidTimeline::MarkerTime { marker: index + 1, name: name.clone(), time: *time });
            }
            needed = needed.max(*time);
        }
        markers.sort_by(|a, b| a.time.total_cmp(&b.time));
        let duration = match duration {
            Some(given) if !(given.is_finite() && given >= needed - TOUCH) => {
                return Err(InvalidTimeline::Duration { given, needed });
            }
            Some(given) => given,
            None => needed,
        };
        if duration <= 0.0 && markers.is_empty() {
            return Err(InvalidTimeline::Empty);
        }
        Ok(Self { tracks, markers, duration })
    }

    /// The tracks, each with its clips in the order in which they play.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// The markers, in the order of time.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// How long it lasts, in seconds.
    pub fn duration_seconds(&self) -> f32 {
        self.duration
    }

    /// The track with a name.
    pub fn track(&self, name: &str) -> Option<&Track> {
        self.tracks.iter().find(|track| track.name == name)
    }
}

impl Track {
    /// The clip that plays at a time or has played last before it; before the first, the first.
    pub fn clip_at(&self, time: f64) -> Option<&Clip> {
        self.clips.iter().rev().find(|clip| clip.has_begun(time)).or(self.clips.first())
    }

    /// Checks the clips, puts them in order, and says when the last one ends.
    fn check(&mut self) -> Result<f32, InvalidTimeline> {
        for (index, clip) in self.clips.iter().enumerate() {
            clip.check(&self.name, index + 1)?;
        }
        let mut order: Vec<usize> = (0..self.clips.len()).collect();
        order.sort_by(|&a, &b| self.clips[a].start.total_cmp(&self.clips[b].start));
        for pair in order.windows(2) {
            let (first, second) = (&self.clips[pair[0]], &self.clips[pair[1]]);
            if second.start < first.end() - TOUCH {
                return Err(InvalidTimeline::Overlap {
                    track: self.name.clone(),
                    first: pair[0] + 1,
                    end: first.end(),
                    second: pair[1] + 1,
                    start: second.start,
                });
            }
        }
        self.clips.sort_by(|a, b| a.start.total_cmp(&b.start));
        Ok(self.clips.iter().map(Clip::end).fold(0.0, f32::max))
    }
}

impl Clip {
    /// How long it plays, in seconds of the timeline.
    pub fn duration(&self) -> f32 {
        (self.range[1] - self.range[0]) / self.speed.abs()
    }

    /// When it ends, in seconds of the timeline.
    pub fn end(&self) -> f32 {
        self.start + self.duration()
    }

    /// Whether it is shown at a time: from its start until before its end, and at its end if the timeline, which lasts `duration`
    /// seconds, ends there, too.
    pub fn shows(&self, time: f64, duration: f32) -> bool {
        let end = f64::from(self.end());
        self.has_begun(time) && (time < end || self.end() >= duration - TOUCH && time <= f64::from(duration))
    }

    fn has_begun(&self, time: f64) -> bool {
        f64::from(self.start) - f64::from(TOUCH) <= time
    }

    /// How much of it shows at a time, 0 to 1.
    pub fn fade_at(&self, time: f64) -> f32 {
        let share = |passed: f64, fade: f32| {
            if fade > 0.0 { (passed / f64::from(fade)).clamp(0.0, 1.0) as f32 } else { 1.0 }
        };
        let (start, end) = (f64::from(self.start), f64::from(self.end()));
        share(time - start, self.fade[0]).min(share(end - time, self.fade[1]))
    }

    /// The playback that shows the right moment while it follows the timeline's clock. `duration` is that of the capture, once it
    /// is known.
    pub(super) fn playback(&self, duration: Option<f32>) -> Playback {
        let ([start, end], backwards) = (self.range, self.speed < 0.0);
        // Playback would begin at the capture's end at once.
        let beyond = duration.filter(|_| backwards).map_or(0.0, |duration| (end - duration).max(0.0));
        Playback {
            // Stays where the clip is all beyond the capture, and its end is drawn.
            time: if backwards { end } else { start },
            start,
            end,
            speed: self.speed,
            offset: -self.start * self.speed.abs() - beyond,
            repeat: Repeat::Once,
            ..Playback::default()
        }
    }

    fn check(&self, track: &str, clip: usize) -> Result<(), InvalidTimeline> {
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

fn is_time(seconds: f32) -> bool {
    seconds.is_finite() && seconds >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(start: f32, range: [f32; 2], speed: f32) -> Clip {
        Clip { capture: Handle::default(), start, range, speed, fade: [0.0; 2] }
    }

    fn track(name: &str, clips: Vec<Clip>) -> Track {
        Track { name: name.into(), clips }
    }

    fn refused(clips: Vec<Clip>) -> String {
        Timeline::new(vec![track("left", clips)], Vec::new(), None).expect_err("makes no sense").to_string()
    }

    #[test]
    fn a_clip_lasts_as_its_speed_says() {
        assert_eq!(clip(1.0, [0.5, 2.5], 1.0).end(), 3.0, "as long as its range");
        assert_eq!(clip(1.0, [0.5, 2.5], -0.5).end(), 5.0, "backwards at half speed, twice as long");
    }

    #[test]
    fn a_timeline_is_put_in_order_and_lasts_until_all_is_over() {
        let clips = vec![clip(2.0, [0.0, 1.0], 1.0), clip(0.0, [0.0, 4.0], 2.0)];
        let markers = [(3.5, "b"), (0.5, "a")].map(|(time, name)| Marker { time, name: name.into() });
        let timeline = Timeline::new(vec![track("left", clips)], markers.to_vec(), None).expect("makes sense");
        let starts: Vec<f32> = timeline.tracks()[0].clips.iter().map(|clip| clip.start).collect();
        assert_eq!(starts, [0.0, 2.0], "clips by start; those that touch do not overlap");
        assert_eq!(timeline.markers()[0].name, "a", "markers by time");
        assert_eq!(timeline.duration_seconds(), 3.5, "until the last marker");
        let longer = Timeline::new(timeline.tracks.clone(), Vec::new(), Some(9.0)).expect("makes sense");
        assert_eq!(longer.duration_seconds(), 9.0, "or as long as it is told to");
    }

    #[test]
    fn the_clip_of_a_moment_is_the_last_that_has_begun() {
        let clips = vec![clip(1.0, [0.0, 1.0], 1.0), clip(3.0, [2.0, 3.0], 1.0)];
        let timeline = Timeline::new(vec![track("left", clips)], Vec::new(), None).expect("makes sense");
        let track = timeline.track("left").expect("there it is");
        let at = |time| track.clip_at(time).map(|clip| (clip.start, clip.shows(time, 4.0)));
        assert_eq!(at(0.0), Some((1.0, false)), "before the first, the first, unseen");
        assert_eq!(at(1.0), Some((1.0, true)), "from its start");
        assert_eq!(at(2.0), Some((1.0, false)), "until its end");
        assert_eq!(at(3.5), Some((3.0, true)), "the second");
        assert_eq!(at(4.0), Some((3.0, true)), "what ends with the timeline stays");
        assert!(timeline.track("right").is_none(), "no such track");
    }

    #[test]
    fn a_gap_that_is_rounding_does_not_flash() {
        let clips = vec![clip(0.0, [0.0, 2.0], 1.0), clip(2.000_05, [0.0, 1.0], 1.0), clip(3.01, [0.0, 1.0], 1.0)];
        let timeline = Timeline::new(vec![track("left", clips)], Vec::new(), None).expect("makes sense");
        let track = timeline.track("left").expect("there it is");
        let shown = |time| track.clip_at(time).is_some_and(|clip| clip.shows(time, 9.0));
        for time in [1.999_99, 2.0, 2.000_02, 2.000_06, 3.0] {
            assert!(shown(time), "something is seen at {time} s");
        }
        assert!(!shown(3.005), "but in a gap that is meant nothing is");
    }

    #[test]
    fn a_clip_that_reaches_beyond_its_capture_waits_at_its_end() {
        let backwards = clip(2.0, [0.0, 5.0], -2.0);
        assert_eq!(backwards.playback(Some(4.0)).offset, -5.0, "a second of the capture that is not there");
        assert_eq!(backwards.playback(Some(9.0)).offset, -4.0, "within its capture it begins at once");
        assert_eq!(backwards.playback(None).offset, -4.0, "as long as nobody knows");
        assert_eq!(clip(2.0, [0.0, 5.0], 2.0).playback(Some(4.0)).offset, -4.0, "forwards, the end comes last");
    }

    #[test]
    fn fades_rise_and_fall_within_the_clip() {
        let faded = Clip { fade: [0.5, 1.0], ..clip(1.0, [0.0, 4.0], 2.0) };
        let fades = [0.0, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 9.0].map(|time| faded.fade_at(time));
        assert_eq!(fades, [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0], "in, full, out");
        assert_eq!(clip(1.0, [0.0, 4.0], 2.0).fade_at(1.0), 1.0, "without fades it is all there");
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        let good = clip(0.0, [0.0, 1.0], 1.0);
        let cases = [
            (clip(f32::NAN, [0.0, 1.0], 1.0), "clip 2: start is NaN"),
            (clip(-1.0, [0.0, 1.0], 1.0), "clip 2: start is -1"),
            (clip(2.0, [-0.5, 1.0], 1.0), "clip 2: in is -0.5"),
            (clip(2.0, [1.0, 1.0], 1.0), "clip 2: out is 1"),
            (clip(2.0, [0.0, f32::INFINITY], 1.0), "clip 2: out is inf"),
            (clip(2.0, [0.0, 1.0], 0.0), "clip 2: speed is 0"),
            (clip(2.0, [0.0, 1e30], 1e-30), "clip 2: speed is"),
            (Clip { fade: [-1.0, 0.0], ..clip(2.0, [0.0, 1.0], 1.0) }, "clip 2: fade_in is -1"),
            (Clip { fade: [0.0, f32::NAN], ..clip(2.0, [0.0, 1.0], 1.0) }, "clip 2: fade_out is NaN"),
            (Clip { fade: [0.6, 0.6], ..clip(2.0, [0.0, 1.0], 1.0) }, "clip 2: fades take 1.2 s"),
            (clip(0.5, [0.0, 1.0], 1.0), "clip 2 starts at 0.5 s, before clip 1 ends at 1 s"),
        ];
        for (bad, expected) in cases {
            let message = refused(vec![good.clone(), bad]);
            assert!(message.contains(expected) && message.contains("\"left\""), "{message} should say {expected}");
        }
        let twice = vec![track("left", vec![good.clone()]), track("left", Vec::new())];
        let message = Timeline::new(twice, Vec::new(), None).expect_err("one name").to_string();
        assert!(message.contains("two tracks are named \"left\""), "{message}");
        let late = vec![Marker { time: -1.0, name: "cut".into() }];
        let message = Timeline::new(Vec::new(), late, None).expect_err("before the start").to_string();
        assert!(message.contains("marker 1 (\"cut\")"), "{message}");
        assert_eq!(Timeline::new(Vec::new(), Vec::new(), None), Err(InvalidTimeline::Empty), "nothing to play");
        for given in [0.5, f32::NAN, f32::INFINITY] {
            let short = Timeline::new(vec![track("left", vec![good.clone()])], Vec::new(), Some(given));
            assert!(matches!(short, Err(InvalidTimeline::Duration { .. })), "{given} s are not enough");
        }
    }
}
