//! The systems that move clocks and captures on.
//!
//! In: Bevy's time, shared clocks, and the duration of each loaded capture. Out: [`Playback::time`] of every entity with a capture,
//! and messages about what happened.

use super::messages::Announcer;
use super::state::{Drive, PlaybackState};
use super::timeline::TimelinePlayer;
use super::{FollowsClock, Playback, PlaybackClock};
use crate::plugin::asset::GaussianCapture;
use crate::plugin::component::GaussianCapture3d;
use bevy::asset::Assets;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{QueryFilter, Without};
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Query, Res};
use bevy::log::debug_span;
use bevy::time::Time;

/// Sets of playback systems in `Update`, in this order.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum PlaybackSystems {
    /// Clocks of the game run. Set clocks by hand `.before` this.
    Clocks,
    /// Timelines advance and direct their tracks.
    Timelines,
    /// Time advances. What runs `.before` this set decides how far; what runs `.after` it sees the moment that will be drawn, and
    /// may still change it.
    Advance,
}

/// Runs the clocks that the game's time moves.
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
        // A clock that stands is not marked as changed.
        playback.set_if_neq(next);
        let key_frames = capture.key_frames();
        announcer.tell(entity, &progress, |announcer, leg| {
            if let Some(key_frames) = &key_frames {
                announcer.key_frames(entity, key_frames, leg);
            }
        });
    }
}

/// What moves an entity on.
pub(super) fn drive<F: QueryFilter>(
    follows: Option<&FollowsClock>,
    clocks: &Query<&PlaybackClock, F>,
    time: &Time,
) -> Drive {
    match follows {
        None => Drive::By(time.delta_secs_f64()),
        Some(&FollowsClock(clock)) => match clocks.get(clock) {
            Ok(shown) => Drive::Follow { clock, seconds: shown.seconds, jumps: shown.jumps },
            Err(_) => Drive::Hold,
        },
    }
}
