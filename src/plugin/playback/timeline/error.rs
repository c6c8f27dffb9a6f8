//! The errors of an invalid timeline.
//!
//! In: the checks of [`asset`](super::asset) and [`clip`](super::clip). Out: [`InvalidTimeline`], whose text names the
//! track, the clip or the marker, the fault and the remedy.

/// The reason why a timeline is invalid. Clips and markers are counted from 1, in the order in which they are written.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidTimeline {
    /// The timeline is empty.
    #[error("the timeline has neither clips nor markers nor a duration; give it at least one clip")]
    Empty,
    /// Two tracks have the same name.
    #[error(
        "two tracks are named {0:?}; a track's name selects the entity that plays it, so give each track a unique name"
    )]
    SameName(String),
    /// A number is out of its range.
    #[error("track {track:?}, clip {clip}: {field} is {value}, but must be {must}")]
    Number {
        /// The track's name.
        track: String,
        /// The number of the clip.
        clip: usize,
        /// The field's name, as in files.
        field: &'static str,
        /// The field's value.
        value: f32,
        /// The condition on the value.
        must: &'static str,
    },
    /// A clip fades in and out for longer than it lasts.
    #[error(
        "track {track:?}, clip {clip}: fades take {fades} s, but the clip lasts {lasts} s; shorten fade_in or fade_out"
    )]
    Fades {
        /// The track's name.
        track: String,
        /// The number of the clip.
        clip: usize,
        /// The sum of both fades, in seconds.
        fades: f32,
        /// The clip's duration, in seconds of the timeline.
        lasts: f32,
    },
    /// Two clips of a track overlap in time.
    #[error(
        "track {track:?}: clip {second} starts at {start} s, before clip {first} ends at {end} s; move one to another \
         track"
    )]
    Overlap {
        /// The track's name.
        track: String,
        /// The number of the clip that starts earlier.
        first: usize,
        /// The end of the first clip, in seconds of the timeline.
        end: f32,
        /// The number of the clip that starts before `end`.
        second: usize,
        /// The start of the second clip, in seconds of the timeline.
        start: f32,
    },
    /// A number of a sound is out of its range.
    #[error("sound {sound}: {field} is {value}, but must be {must}")]
    SoundNumber {
        /// The number of the sound.
        sound: usize,
        /// The field's name, as in files.
        field: &'static str,
        /// The field's value.
        value: f32,
        /// The condition on the value.
        must: &'static str,
    },
    /// A marker's time is out of its range.
    #[error("marker {marker} ({name:?}): time is {time}, but must be 0 or later, in seconds")]
    MarkerTime {
        /// The number of the marker.
        marker: usize,
        /// The marker's name.
        name: String,
        /// The marker's time, in seconds of the timeline.
        time: f32,
    },
    /// The given duration is shorter than the clips and markers.
    #[error("duration is {given} s, but the last clip or marker ends at {needed} s; leave duration out or lengthen it")]
    Duration {
        /// The given duration, in seconds.
        given: f32,
        /// The shortest possible duration, in seconds.
        needed: f32,
    },
}
