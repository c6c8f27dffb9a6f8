//! Playback: which moment of a capture is shown.
//!
//! In: Bevy's [`Time`](bevy::time::Time) (the virtual clock: pausing and scaling it pauses and scales captures) and what a game
//! sets on a [`Playback`]. Out: `Playback::time`, advanced once a frame in [`PlaybackSystems::Advance`]; drawing reads it.

mod clock;
mod systems;

pub use clock::{Playback, Repeat};
pub use systems::{PlaybackSystems, advance_playback};
