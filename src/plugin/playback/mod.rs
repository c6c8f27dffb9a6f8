//! Playback: the time of each capture.
//!
//! In: Bevy's [`Time`](bevy::time::Time) (the virtual clock: pausing and scaling it pauses and scales captures) and the
//! values that a game sets on a [`Playback`], a shared [`PlaybackClock`] or a [`TimelinePlayer`]. Out:
//! `Playback::time`, advanced once a frame in [`PlaybackSystems::Advance`], which the renderer reads; messages and
//! observable events about playback.
//!
//! ```text
//! Time ──▶ PlaybackClock ◀── audio, network            Clocks
//!                │ FollowsClock
//!                ▼
//!  Timeline ─▶ TimelinePlayer ─▶ TimelineTrack         Timelines
//!                                     │ a capture, its Playback, a ClipFade
//!                                     ▼
//!  Time ──────────────────────▶ Playback::time         Advance
//!                                     │
//!                                     ▼
//!                               ColliderState          Colliders
//! ```
//!
//! A playback can follow a clock or another player ([`FollowsClock`]). [`Markers`] are named times of one capture, like
//! the markers of a timeline. A [`CaptureSocket`] follows a named point of a capture; a [`CaptureCollider`] has the
//! mesh of what is solid in it.
//!
//! Bevy's own animations may animate any field of a [`Playback`] but `repeat` through
//! `animated_field!(Playback::speed)`. They run in `PostUpdate`: a `time` set on a capture is drawn in the same frame,
//! of a capture in chunk files in the next; other fields, and all fields of a [`TimelinePlayer`]'s playback, take effect
//! in the next frame.

mod advance;
mod clock;
mod collider;
mod component;
mod drive;
mod markers;
mod messages;
mod plugin;
mod repeat;
mod socket;
mod span;
mod stall;
mod state;
mod stepping;
mod systems;
mod timeline;

pub use clock::{ClockSource, FollowsClock, PlaybackClock};
pub use collider::{CaptureCollider, CaptureColliderChanged, ColliderState, collider_mesh};
pub use component::Playback;
pub use markers::{Marker, Markers};
pub use messages::{
    MarkerReached, PlaybackEnded, PlaybackLooped, PlaybackPaused, PlaybackSeeked, PlaybackStarted, SegmentBoundCrossed,
};
pub use plugin::CapturePlaybackPlugin;
pub(crate) use plugin::require_playback;
pub use repeat::Repeat;
pub use socket::{CaptureSocket, SocketState};
pub(crate) use stall::Stall;
pub(crate) use state::PlaybackState;
pub use systems::PlaybackSystems;
pub use timeline::{
    Clip, ClipFade, InvalidTimeline, SoundClip, Timeline, TimelineError, TimelineLoader, TimelinePlayer, TimelineTrack,
    Track,
};
pub(crate) use timeline::{Cue, NextClip};
