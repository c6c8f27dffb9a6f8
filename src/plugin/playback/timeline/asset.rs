//! The timeline in memory: tracks of clips, markers, and sounds.
//!
//! In: tracks, markers and sounds, in any order. Out: a valid [`Timeline`], sorted by time, or an [`InvalidTimeline`].

use super::clip::{Clip, TOUCH, is_time};
use super::error::InvalidTimeline;
use super::sound_clip::SoundClip;
use crate::plugin::playback::markers::Marker;
use bevy::asset::{Asset, VisitAssetDependencies};
use bevy::reflect::TypePath;
use std::collections::HashSet;

/// The times at which captures play: an asset. Play it with a [`TimelinePlayer`](super::TimelinePlayer).
///
/// # Examples
///
/// ```
/// use bevy::asset::Handle;
/// use bevy_gs4d::playback::{Clip, InvalidTimeline, Marker, Timeline, Track};
///
/// // In a game, `assets.load("toybox.gs4d")` returns the handle.
/// let capture = Handle::default();
/// let clip = Clip { capture, start: 1.0, range: [0.0, 4.0], speed: 2.0, fade: [0.5, 0.0] };
/// let track = Track { name: "left".into(), clips: vec![clip] };
/// let timeline = Timeline::new(vec![track], vec![Marker { time: 2.0, name: "cut".into() }], None)?;
/// assert_eq!(timeline.duration_seconds(), 3.0, "four seconds of the capture at twice the speed, starting at 1 s");
/// # Ok::<(), InvalidTimeline>(())
/// ```
#[derive(Asset, TypePath, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
pub struct Timeline {
    #[dependency]
    tracks: Vec<Track>,
    markers: Vec<Marker>,
    #[dependency]
    sounds: Vec<SoundClip>,
    duration: f32,
}

/// Clips that play one after the other on one entity.
#[derive(VisitAssetDependencies, Debug, Clone, PartialEq)]
pub struct Track {
    /// The name of the [`TimelineTrack`](super::TimelineTrack) that plays the track; unique in the timeline.
    pub name: String,
    /// The clips of the track, which may touch but not overlap.
    #[dependency]
    pub clips: Vec<Clip>,
}

impl Timeline {
    /// Creates a timeline that lasts until the end of its last clip or marker or, if given, for `duration` seconds.
    ///
    /// # Errors
    /// The first invalid track, clip, marker or duration.
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
        Ok(Self { tracks, markers, sounds: Vec::new(), duration })
    }

    /// Returns the timeline with these sounds in place of its own. They do not make it longer.
    ///
    /// # Errors
    /// The first sound with an invalid number.
    pub fn with_sounds(self, sounds: Vec<SoundClip>) -> Result<Self, InvalidTimeline> {
        sounds.iter().enumerate().try_for_each(|(index, sound)| sound.check(index + 1))?;
        Ok(Self { sounds, ..self })
    }

    /// Returns the tracks, each with its clips in order of time.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Returns the markers, in order of time.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// Returns the sounds, in the order in which they were given.
    pub fn sounds(&self) -> &[SoundClip] {
        &self.sounds
    }

    /// Returns the duration of the timeline in seconds.
    pub fn duration_seconds(&self) -> f32 {
        self.duration
    }

    /// Returns the track named `name`; `None` if there is none.
    pub fn track(&self, name: &str) -> Option<&Track> {
        self.tracks.iter().find(|track| track.name == name)
    }
}

impl Track {
    /// Returns the last clip that has begun at `time`, in seconds of the timeline, also if the clip has ended; before
    /// the first clip, the first. `None` if the track has no clip.
    pub fn clip_at(&self, time: f64) -> Option<&Clip> {
        self.clips.iter().rev().find(|clip| clip.has_begun(time)).or(self.clips.first())
    }

    /// Checks the clips and sorts them. Returns the end of the last clip, in seconds of the timeline.
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

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::asset::Handle;

    fn clip(start: f32, range: [f32; 2], speed: f32) -> Clip {
        Clip { capture: Handle::default(), start, range, speed, fade: [0.0; 2] }
    }

    fn track(name: &str, clips: Vec<Clip>) -> Track {
        Track { name: name.into(), clips }
    }

    fn refused(clips: Vec<Clip>) -> String {
        Timeline::new(vec![track("left", clips)], Vec::new(), None).expect_err("the clips are invalid").to_string()
    }

    #[test]
    fn a_timeline_is_sorted_and_lasts_until_its_last_clip_or_marker() {
        let clips = vec![clip(2.0, [0.0, 1.0], 1.0), clip(0.0, [0.0, 4.0], 2.0)];
        let markers = [(3.5, "b"), (0.5, "a")].map(|(time, name)| Marker { time, name: name.into() });
        let timeline =
            Timeline::new(vec![track("left", clips)], markers.to_vec(), None).expect("the timeline is valid");
        let starts: Vec<f32> = timeline.tracks()[0].clips.iter().map(|clip| clip.start).collect();
        assert_eq!(starts, [0.0, 2.0], "clips are sorted by start, and touching clips do not overlap");
        assert_eq!(timeline.markers()[0].name, "a", "markers are sorted by time");
        assert_eq!(timeline.duration_seconds(), 3.5, "the timeline lasts until its last marker");
        let longer = Timeline::new(timeline.tracks.clone(), Vec::new(), Some(9.0)).expect("the timeline is valid");
        assert_eq!(longer.duration_seconds(), 9.0, "a given duration is used");
    }

    #[test]
    fn the_clip_at_a_time_is_the_last_that_has_begun() {
        let clips = vec![clip(1.0, [0.0, 1.0], 1.0), clip(3.0, [2.0, 3.0], 1.0)];
        let timeline = Timeline::new(vec![track("left", clips)], Vec::new(), None).expect("the timeline is valid");
        let track = timeline.track("left").expect("the timeline has this track");
        let at = |time| track.clip_at(time).map(|clip| (clip.start, clip.shows(time, 4.0)));
        assert_eq!(at(0.0), Some((1.0, false)), "before the first clip, the first clip is hidden");
        assert_eq!(at(1.0), Some((1.0, true)), "a clip is shown at its start");
        assert_eq!(at(2.0), Some((1.0, false)), "a clip is hidden at its end");
        assert_eq!(at(3.5), Some((3.0, true)), "the second clip is shown at its time");
        assert_eq!(at(4.0), Some((3.0, true)), "a clip that ends with the timeline is shown at its end");
        assert!(timeline.track("right").is_none(), "an unknown name has no track");
    }

    #[test]
    fn a_gap_by_rounding_is_not_visible() {
        let clips = vec![clip(0.0, [0.0, 2.0], 1.0), clip(2.000_05, [0.0, 1.0], 1.0), clip(3.01, [0.0, 1.0], 1.0)];
        let timeline = Timeline::new(vec![track("left", clips)], Vec::new(), None).expect("the timeline is valid");
        let track = timeline.track("left").expect("the timeline has this track");
        let shown = |time| track.clip_at(time).is_some_and(|clip| clip.shows(time, 9.0));
        for time in [1.999_99, 2.0, 2.000_02, 2.000_06, 3.0] {
            assert!(shown(time), "a clip is shown at {time} s");
        }
        assert!(!shown(3.005), "no clip is shown in an intended gap");
    }

    #[test]
    fn sounds_are_checked_and_do_not_lengthen_the_timeline() {
        let timeline = || Timeline::new(vec![track("left", vec![clip(0.0, [0.0, 1.0], 1.0)])], Vec::new(), None);
        let timeline = || timeline().expect("the timeline is valid");
        let sound = SoundClip { sound: Handle::default(), start: 5.0, volume: 0.5 };
        let with = timeline().with_sounds(vec![sound.clone()]).expect("the sound is valid");
        assert_eq!(
            (with.sounds().len(), with.duration_seconds()),
            (1, 1.0),
            "the sound is there, and the duration stays"
        );
        let cases = [
            (SoundClip { start: -1.0, ..sound.clone() }, "sound 2: start is -1"),
            (SoundClip { start: f32::NAN, ..sound.clone() }, "sound 2: start is NaN"),
            (SoundClip { volume: 1.5, ..sound.clone() }, "sound 2: volume is 1.5"),
            (SoundClip { volume: f32::NAN, ..sound.clone() }, "sound 2: volume is NaN"),
        ];
        for (bad, expected) in cases {
            let message =
                timeline().with_sounds(vec![sound.clone(), bad]).expect_err("the sound is invalid").to_string();
            assert!(message.starts_with(expected), "{message} begins with {expected}");
        }
    }

    #[test]
    fn errors_name_the_invalid_part() {
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
            assert!(message.contains(expected) && message.contains("\"left\""), "{message} contains {expected}");
        }
        let twice = vec![track("left", vec![good.clone()]), track("left", Vec::new())];
        let message = Timeline::new(twice, Vec::new(), None).expect_err("two tracks have one name").to_string();
        assert!(message.contains("two tracks are named \"left\""), "the name is in the message: {message}");
        let late = vec![Marker { time: -1.0, name: "cut".into() }];
        let message = Timeline::new(Vec::new(), late, None).expect_err("a negative time is invalid").to_string();
        assert!(message.contains("marker 1 (\"cut\")"), "the marker is in the message: {message}");
        assert_eq!(
            Timeline::new(Vec::new(), Vec::new(), None),
            Err(InvalidTimeline::Empty),
            "an empty timeline is invalid"
        );
        for given in [0.5, f32::NAN, f32::INFINITY] {
            let short = Timeline::new(vec![track("left", vec![good.clone()])], Vec::new(), Some(given));
            assert!(matches!(short, Err(InvalidTimeline::Duration { .. })), "a duration of {given} s is invalid");
        }
    }
}
