//! Playback: which moment of a capture is shown.
//!
//! In: Bevy's [`Time`](bevy::time::Time) (the virtual clock: pausing and scaling it pauses and scales captures) and what a game
//! sets on a [`Playback`], a shared [`PlaybackClock`] or a [`TimelinePlayer`]. Out: `Playback::time`, advanced once a frame in
//! [`PlaybackSystems::Advance`]; drawing reads it. What happened on the way is told by messages and observers.
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
//! Bevy's own animations may animate any field of a [`Playback`] but `repeat` through `animated_field!(Playback::speed)`. They run in
//! `PostUpdate`: the `time` that they set on a capture is drawn in the same frame; everything else, and all that they set on a
//! [`TimelinePlayer`], counts from the next frame on.

mod clock;
mod component;
mod messages;
mod plugin;
mod span;
mod state;
mod systems;
mod timeline;

pub use clock::{ClockSource, FollowsClock, PlaybackClock};
pub use component::{Playback, Repeat};
pub use messages::{
    KeyFrameCrossed, MarkerReached, PlaybackEnded, PlaybackLooped, PlaybackPaused, PlaybackSeeked, PlaybackStarted,
};
pub(crate) use plugin::PlaybackPlugin;
pub use systems::PlaybackSystems;
pub use timeline::{
    Clip, ClipFade, InvalidTimeline, Marker, Timeline, TimelineError, TimelineLoader, TimelinePlayer, TimelineTrack,
    Track,
};
