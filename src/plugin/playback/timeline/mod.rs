//! Timelines: the times at which captures play.
//!
//! In: a file named `*.timeline.ron`, or a [`Timeline`] created in code, on a [`TimelinePlayer`]. Out: an entity for
//! each track, whose capture, playback, fade and visibility follow the player; a message for every reached marker;
//! sounds for the part [`sound`](crate::sound).
//!
//! ```ron
//! (
//!     tracks: [
//!         (name: "left", clips: [
//!             // Seconds 0.5 to 2.5 of the capture, from the start of the timeline.
//!             (capture: "toybox.gs4d", start: 0.0, in: 0.5, out: 2.5),
//!             // Then backwards at half speed. Fades are seconds of the timeline.
//!             (capture: "toybox.gs4d", start: 2.0, in: 0.0, out: 1.0, speed: -0.5, fade_in: 0.5, fade_out: 0.5),
//!         ]),
//!     ],
//!     markers: [(time: 2.0, name: "cut")],
//!     // Ogg Vorbis or WAV.
//!     sounds: [(file: "song.ogg", start: 0.5, volume: 0.8)],
//! )
//! ```
//!
//! Paths are paths of `AssetServer::load`. `in` and `out` are seconds of the capture, `start` and `time` of the
//! timeline. `start` and `volume` of a sound are 0 and 1 if left out. A clip lasts `(out - in) / |speed|`; the clips of
//! a track may touch but not overlap: to cross-fade, use two tracks. The timeline lasts until its last clip or marker;
//! `duration: 10.0` makes it longer.

mod asset;
mod clip;
mod error;
mod file;
mod next;
mod player;
mod sound_clip;
mod systems;

pub use asset::{Timeline, Track};
pub use clip::Clip;
pub use error::InvalidTimeline;
pub use file::{TimelineError, TimelineLoader};
pub(crate) use next::{Cue, NextClip};
pub use player::{ClipFade, TimelinePlayer, TimelineTrack};
pub use sound_clip::SoundClip;
pub(super) use systems::{advance_timelines, bind_tracks, update_tracks};
