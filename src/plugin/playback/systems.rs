//! The systems that advance clocks and captures.
//!
//! In: Bevy's time, shared clocks, and the duration of each loaded capture. Out: [`Playback::time`] of every entity with a capture,
//! and messages about what happened.

use super::clock::{FollowsClock, PlaybackClock};
use super::component::Playback;
use super::drive::drive;
use super::messages::Announcer;
use super::state::PlaybackState;
use super::timeline::TimelinePlayer;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use bevy::asset::Assets;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::Without;
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Query, Res};
use bevy::log::debug_span;
use bevy::time::Time;

/// Sets of playback systems in `Update`, in this order.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum PlaybackSystems {
    /// Clocks of the game advance. Set manual clocks `.before` this.
    Clocks,
    /// Timelines advance and set up their tracks.
    Timelines,
    /// Captures advance. Systems `.before` this set can change by how much; systems `.after` it see the time that will be drawn, and may
    /// still change it.
    Advance,
}

/// Advances the clocks that the game's time moves.
pub(super) fn run_clocks(time: Res<Time>, mut clocks: Query<&mut PlaybackClock>) {
    let _span = debug_span!("gs4d/clocks").entered();
    for mut clock in &mut clocks {
        let mut next = *clock;
        next.advance(time.delta_secs_f64());
        clock.set_if_neq(next);
    }
}

/// Advances the playback of every capture that has been loaded.
pub(super) fn advance_captures(
    time: Res<Time>,
    captures: Res<Assets<GaussianCapture>>,
    clocks: Query<&PlaybackClock>,
    mut players: Query<
        (Entity, &GaussianCapture3d, &mut Playback, &mut PlaybackState, Option<&FollowsClock>),
        Without<TimelinePlayer>,
    >,
    mut announcer: Announcer,
) {
    let _span = debug_span!("gs4d/playback").entered();
    for (entity, handle, mut playback, mut state, follows) in &mut players {
        let Some(capture) = captures.get(&handle.0) else { continue };
        let drive = drive(follows, &clocks, &time);
        let (next, progress) = state.advance(*playback, drive, capture.duration_seconds());
        // A playback that stands still is not marked as changed.
        playback.set_if_neq(next);
        let key_frames = capture.key_frames();
        announcer.report(entity, &progress, |announcer, leg| {
            if let Some(key_frames) = &key_frames {
                announcer.key_frames(entity, key_frames, leg);
            }
        });
    }
}
