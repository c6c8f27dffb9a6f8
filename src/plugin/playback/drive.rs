//! What advances a playback: the game's time, or a shared clock.
//!
//! In: an entity's [`FollowsClock`], if it has one, all clocks, and Bevy's time. Out: a [`Drive`] for this step.

use super::clock::{FollowsClock, PlaybackClock};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::QueryFilter;
use bevy::ecs::system::Query;
use bevy::time::Time;

/// What advances a playback in one step.
#[derive(Debug, Clone, Copy)]
pub(super) enum Drive {
    /// This many seconds have passed.
    By(f64),
    /// A shared clock shows this many seconds, after this many jumps.
    Follow { clock: Entity, seconds: f64, jumps: u32 },
    /// The clock to follow does not exist: time stands still.
    Hold,
}

/// Returns what advances an entity that follows a clock, or none.
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
