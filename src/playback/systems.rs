//! The system that moves every clock on.
//!
//! In: Bevy's time and the duration of each loaded capture. Out: [`Playback::time`] of every entity with a capture.

use super::Playback;
use crate::asset::GaussianCapture;
use crate::render::GaussianCapture3d;
use bevy::asset::Assets;
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Query, Res};
use bevy::time::Time;

/// Sets of playback systems, for ordering.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum PlaybackSystems {
    /// In `Update`: time advances. What runs `.before` this set decides how far; what runs `.after` it sees the moment that
    /// will be drawn, and may still change it.
    Advance,
}

/// Advances the playback of every capture that has been loaded.
pub fn advance_playback(
    time: Res<Time>,
    captures: Res<Assets<GaussianCapture>>,
    mut players: Query<(&GaussianCapture3d, &mut Playback)>,
) {
    for (capture, mut playback) in &mut players {
        // Looked at first, so that a paused clock is not marked as changed.
        if !playback.playing {
            continue;
        }
        if let Some(capture) = captures.get(&capture.0) {
            playback.advance(time.delta_secs(), capture.duration_seconds());
        }
    }
}
