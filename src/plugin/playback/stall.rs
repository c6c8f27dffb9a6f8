//! Playbacks that wait for another module of the plugin.
//!
//! In: captures in chunk files whose most important Gaussians are not there. Out: [`Stall`], which stops their time.

use bevy::ecs::component::Component;

/// Who waits for what a playback would draw and is not there. A clock that is followed never waits.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stall {
    /// Whether no time passes for the playback.
    pub(crate) waits: bool,
    /// Whether no time passes for the timeline of which the playback is a track, unless the track is hidden.
    pub(crate) holds_timeline: bool,
}
