//! Playbacks that wait for another module of the plugin.
//!
//! In: captures in chunk files whose most important Gaussians are not there. Out: [`Stall`], which stops their time, and
//! that of timelines.

use bevy::ecs::component::Component;

/// Which times stand still, because what a playback would draw is not there. What follows a clock does not wait.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stall {
    /// Whether no time passes for the playback.
    pub(crate) waits: bool,
    /// Whether no time passes for the timeline of which the playback is a track, while the track shows a clip.
    pub(crate) holds_timeline: bool,
}
