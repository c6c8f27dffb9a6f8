//! Timelines: when which capture plays.
//!
//! In: a file named `*.timeline.ron`, or a [`Timeline`] made in code, on a [`TimelinePlayer`]. Out: an entity for each track, whose
//! capture, playback, fade and visibility follow the player; and a message for every marker.
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
//! )
//! ```
//!
//! Paths are those of `AssetServer::load`. `in` and `out` are seconds of the capture, `start` and `time` of the timeline. A clip
//! lasts `(out - in) / |speed|`; the clips of a track may touch but not overlap: to cross-fade, use two tracks. The timeline lasts
//! until the last clip or marker, or longer: `duration: 10.0`.

mod asset;
mod direct;
mod file;
mod player;

pub use asset::{Clip, InvalidTimeline, Marker, Timeline, Track};
pub(super) use direct::{advance_timelines, bind_tracks, direct_tracks};
pub use file::{TimelineError, TimelineLoader};
pub use player::{ClipFade, TimelinePlayer, TimelineTrack};
