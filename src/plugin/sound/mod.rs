//! Sounds beside captures, at the time that is drawn.
//!
//! In: the sounds of a [`Timeline`](crate::playback::Timeline), or the sound that a capture carries in its package, on
//! an entity with a [`CaptureSound`]; the time of the player. Out: a [`SoundState`] for each sound, of which a
//! [`SoundFollower`] makes samples; with the feature `bevy_audio` they are heard through Bevy's audio.
//!
//! ```text
//!  TimelinePlayer, its SoundClips        GaussianCapture3d, CaptureSound
//!         ▼                                         ▼
//!   TimelineSound, a child of each        its track, or the sound of the package, decoded in a task
//!         └───────────────────┬─────────────────────┘
//!                             ▼
//!            SoundState: sound, seconds, speed, volume              once a frame
//!                             ▼ SoundState::cue
//!            SoundFollower: samples at the time of the wall clock   when the device asks
//! ```
//!
//! The picture leads and the sound follows: a follower plays on from where it is as long as it is within a hundredth of
//! a second of the picture, with corrections of speed that nobody hears, and otherwise crosses over to the time of the
//! picture within [`SoundFollower::FADE_SECONDS`], so that a seek, a pause or a stall is no click.

mod component;
mod decoding;
#[cfg(any(test, feature = "bevy_audio"))]
mod device_clock;
mod follower;
#[cfg(feature = "bevy_audio")]
mod output;
mod plugin;
mod systems;

pub use super::component::SoundTrack;
pub use component::{CaptureSound, SoundState, TimelineSound};
pub use follower::{SoundCue, SoundFollower};
pub use plugin::CaptureSoundPlugin;
pub use systems::CaptureSoundSystems;
