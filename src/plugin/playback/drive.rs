//! The source of a playback's time: the game's time, or another entity that the playback follows.
//!
//! In: an entity's optional [`FollowsClock`], the times of the entities that can be followed, and Bevy's time. Out: the
//! order in which players advance, each after the entity that it follows; a [`Drive`] for each player, and a warning
//! for a player that cannot follow.

use super::clock::{FollowsClock, PlaybackClock};
use super::component::Playback;
use super::state::PlaybackState;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::system::{Query, SystemParam};
use bevy::log::warn;
use bevy::time::Time;
use std::fmt;

/// The source of a playback's time in one step.
#[derive(Debug, Clone, Copy)]
pub(super) enum Drive {
    /// The number of elapsed seconds.
    By(f64),
    /// The time of the followed clock in seconds, and the number of its jumps.
    Follow { clock: Entity, seconds: f64, jumps: u32 },
    /// There is no clock to follow: no time passes.
    Hold,
}

impl Drive {
    /// Returns the same drive, with no elapsed time while a capture is `awaited`. A followed clock does not wait.
    pub(super) fn unless(self, awaited: bool) -> Self {
        match self {
            Self::By(_) if awaited => Self::By(0.0),
            Self::By(_) | Self::Follow { .. } | Self::Hold => self,
        }
    }
}

/// The time of an entity, for its followers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shown {
    seconds: f64,
    jumps: u32,
}

impl Shown {
    pub(super) fn by_clock(clock: &PlaybackClock) -> Self {
        Self { seconds: clock.seconds, jumps: clock.jumps }
    }

    /// Returns the time of a player. Before its first step, this is the time that the game has set.
    pub(super) fn by_player(playback: &Playback, state: &PlaybackState) -> Self {
        let seconds = if state.span.is_some() { state.seconds() } else { playback.time.into() };
        Self { seconds, jumps: state.jumps }
    }
}

/// The reason why an entity cannot follow another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Obstacle {
    /// The other entity does not exist.
    Missing,
    /// The other entity has no time.
    Timeless,
    /// The entities follow each other in a circle.
    Circle,
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing => "which does not exist: spawn it first, or remove FollowsClock",
            Self::Timeless => "which has no time: follow an entity with a PlaybackClock or a Playback",
            Self::Circle => "which leads to a circle of followers: remove FollowsClock from an entity of the circle",
        })
    }
}

/// The players and the entities that they follow.
#[derive(SystemParam)]
pub(super) struct Following<'w, 's> {
    follows: Query<'w, 's, &'static FollowsClock, With<Playback>>,
    existing: Query<'w, 's, ()>,
}

impl Following<'_, '_> {
    /// Returns the players in an order in which each comes after the player that it follows, otherwise in the given
    /// order. Players that follow in a circle come last.
    pub(super) fn order(&self, players: impl Iterator<Item = Entity>) -> Vec<Entity> {
        let mut order: Vec<(usize, Entity)> =
            players.map(|player| (self.distance(player).unwrap_or(usize::MAX), player)).collect();
        order.sort_by_key(|(distance, _)| *distance);
        order.into_iter().map(|(_, player)| player).collect()
    }

    /// Returns the source of a player's time. `shown` returns the time of an entity, `None` if the entity has no time.
    pub(super) fn drive(
        &self,
        player: Entity,
        time: &Time,
        shown: impl FnOnce(Entity) -> Option<Shown>,
        state: &mut PlaybackState,
    ) -> Drive {
        let Ok(&FollowsClock(clock)) = self.follows.get(player) else {
            state.warned_of = None;
            return Drive::By(time.delta_secs_f64());
        };
        let found = if self.distance(player).is_none() { Err(Obstacle::Circle) } else { self.find(clock, shown) };
        match found {
            Ok(Shown { seconds, jumps }) => {
                state.warned_of = None;
                Drive::Follow { clock, seconds, jumps }
            }
            Err(obstacle) => {
                if state.warned_of.replace(clock) != Some(clock) {
                    warn!("{player} does not advance: it follows {clock}, {obstacle}");
                }
                Drive::Hold
            }
        }
    }

    fn find(&self, clock: Entity, shown: impl FnOnce(Entity) -> Option<Shown>) -> Result<Shown, Obstacle> {
        let reason = if self.existing.contains(clock) { Obstacle::Timeless } else { Obstacle::Missing };
        shown(clock).ok_or(reason)
    }

    /// Returns the number of entities in the chain that a player follows; `None` for a circle.
    fn distance(&self, player: Entity) -> Option<usize> {
        steps(player, |player| Some(self.follows.get(player).ok()?.0))
    }
}

/// Returns the number of steps from `start` until `next` returns `None`; `None` if the steps lead into a circle.
fn steps<T: Copy + PartialEq>(start: T, next: impl Fn(T) -> Option<T>) -> Option<usize> {
    // In a circle, the fast position meets the slow position (Floyd).
    let (mut slow, mut fast, mut steps) = (start, start, 0);
    loop {
        let Some(first) = next(fast) else { return Some(steps) };
        let Some(second) = next(first) else { return Some(steps + 1) };
        (fast, steps) = (second, steps + 2);
        slow = next(slow)?;
        if slow == fast {
            return None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_has_a_length_and_a_circle_has_none() {
        let along = |next: &'static [Option<usize>]| move |start: usize| steps(start, |at| next[at]);
        let chain = along(&[None, Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(
            [0, 1, 2, 3, 4].map(chain),
            [0, 1, 2, 3, 4].map(Some),
            "the length of a chain is its number of links"
        );
        let circle = along(&[Some(1), Some(2), Some(0), Some(0), Some(4)]);
        assert_eq!(
            [0, 1, 2, 3, 4].map(circle),
            [None; 5],
            "a circle, a chain into a circle and a self-reference have no length"
        );
    }
}
