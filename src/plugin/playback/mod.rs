//! Playback: which time of a capture is shown.
//!
//! In: Bevy's [`Time`](bevy::time::Time) (the virtual clock: pausing and scaling it pauses and scales captures) and what a game
//! sets on a [`Playback`], a shared [`PlaybackClock`] or a [`TimelinePlayer`]. Out: `Playback::time`, advanced once a frame in
//! [`PlaybackSystems::Advance`], which drawing reads; messages and observable events about what happened.
//!
//! ```text
//! Time ──▶ PlaybackClock ◀── audio, network            Clocks
//!                │ FollowsClock
//!                ▼
//!  Timeline ─▶ TimelinePlayer ─▶ TimelineTrack         Timelines
//!                                     │ a capture, its Playback, a ClipFade
//!                                     ▼
//!  Time ──────────────────────▶ Playback::time         Advance
//! ```
//!
//! A playback follows a clock or another player ([`FollowsClock`]); [`Markers`] give one capture the named moments that a timeline has.
//!
//! Bevy's own animations may animate any field of a [`Playback`] but `repeat` through `animated_field!(Playback::speed)`. They run in
//! `PostUpdate`: the `time` that they set on a capture is drawn in the same frame; other fields, and every field of a
//! [`TimelinePlayer`]'s playback, take effect in the next frame.

mod advance;
mod clock;
mod component;
mod drive;
mod markers;
mod messages;
mod plugin;
mod repeat;
mod span;
mod state;
mod stepping;
mod systems;
mod timeline;

pub use clock::{ClockSource, FollowsClock, PlaybackClock};
pub use component::Playback;
pub use markers::{Marker, Markers};
pub use messages::{
    MarkerReached, PlaybackEnded, PlaybackLooped, PlaybackPaused, PlaybackSeeked, PlaybackStarted, SegmentBoundCrossed,
};
pub(crate) use plugin::PlaybackPlugin;
pub use repeat::Repeat;
pub use systems::PlaybackSystems;
pub use timeline::{
    Clip, ClipFade, InvalidTimeline, Timeline, TimelineError, TimelineLoader, TimelinePlayer, TimelineTrack, Track,
};
