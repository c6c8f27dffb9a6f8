//! What advances a playback: the game's time, or another entity that it follows.
//!
//! In: an entity's [`FollowsClock`], if it has one, what the entities that can be followed show, and Bevy's time. Out: the order in which
//! players advance, each after the one that it follows; a [`Drive`] for each, and a warning for one that cannot follow.

use super::clock::{FollowsClock, PlaybackClock};
use super::component::Playback;
use super::state::PlaybackState;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::system::{Query, SystemParam};
use bevy::log::warn;
use bevy::time::Time;
use std::fmt;

/// What advances a playback in one step.
#[derive(Debug, Clone, Copy)]
pub(super) enum Drive {
    /// This many seconds have passed.
    By(f64),
    /// The clock that is followed shows this many seconds, after this many jumps.
    Follow { clock: Entity, seconds: f64, jumps: u32 },
    /// There is no clock to follow: time stands still.
    Hold,
}

impl Drive {
    /// Returns the same, but no time of the game while something is `awaited`. The clock that is followed waits for nobody.
    pub(super) fn unless(self, awaited: bool) -> Self {
        match self {
            Self::By(_) if awaited => Self::By(0.0),
            Self::By(_) | Self::Follow { .. } | Self::Hold => self,
        }
    }
}

/// What an entity shows to its followers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shown {
    seconds: f64,
    jumps: u32,
}

impl Shown {
    pub(super) fn by_clock(clock: &PlaybackClock) -> Self {
        Self { seconds: clock.seconds, jumps: clock.jumps }
    }

    /// Returns the time of a player. One that has not advanced yet, or never does, shows what the game has set.
    pub(super) fn by_player(playback: &Playback, state: &PlaybackState) -> Self {
        let seconds = if state.span.is_some() { state.seconds() } else { playback.time.into() };
        Self { seconds, jumps: state.jumps }
    }
}

/// Why an entity cannot follow another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Obstacle {
    /// The other does not exist.
    Missing,
    /// It shows no time.
    Timeless,
    /// It follows, perhaps through others, itself.
    Circle,
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing => "which does not exist: spawn it first, or remove FollowsClock",
            Self::Timeless => "which shows no time: follow an entity with a PlaybackClock or a Playback",
            Self::Circle => "which follows, perhaps through others, an entity of a circle: let one of them follow none",
        })
    }
}

/// Who follows whom, among all players.
#[derive(SystemParam)]
pub(super) struct Following<'w, 's> {
    follows: Query<'w, 's, &'static FollowsClock, With<Playback>>,
    existing: Query<'w, 's, ()>,
}

impl Following<'_, '_> {
    /// Returns the players in an order in which each comes after the one that it follows; otherwise as given. Those that follow in a
    /// circle come last.
    pub(super) fn order(&self, players: impl Iterator<Item = Entity>) -> Vec<Entity> {
        let mut order: Vec<(usize, Entity)> =
            players.map(|player| (self.distance(player).unwrap_or(usize::MAX), player)).collect();
        order.sort_by_key(|(distance, _)| *distance);
        order.into_iter().map(|(_, player)| player).collect()
    }

    /// Returns what advances a player. `shown` returns what an entity shows, `None` if it shows no time.
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
                    warn!("{player} stands still: it follows {clock}, {obstacle}");
                }
                Drive::Hold
            }
        }
    }

    fn find(&self, clock: Entity, shown: impl FnOnce(Entity) -> Option<Shown>) -> Result<Shown, Obstacle> {
        let reason = if self.existing.contains(clock) { Obstacle::Timeless } else { Obstacle::Missing };
        shown(clock).ok_or(reason)
    }

    /// Returns through how many others a player follows; `None` if that never ends.
    fn distance(&self, player: Entity) -> Option<usize> {
        steps(player, |player| Some(self.follows.get(player).ok()?.0))
    }
}

/// Returns the number of steps from `start` until `next` returns `None`; `None` if it never does.
fn steps<T: Copy + PartialEq>(start: T, next: impl Fn(T) -> Option<T>) -> Option<usize> {
    // In a circle, the one that is twice as fast meets the other.
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
    fn a_chain_ends_and_a_circle_does_not() {
        let along = |next: &'static [Option<usize>]| move |start: usize| steps(start, |at| next[at]);
        let chain = along(&[None, Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!([0, 1, 2, 3, 4].map(chain), [0, 1, 2, 3, 4].map(Some), "one more for each link");
        let circle = along(&[Some(1), Some(2), Some(0), Some(0), Some(4)]);
        assert_eq!([0, 1, 2, 3, 4].map(circle), [None; 5], "in a circle, on the way into one, and following oneself");
    }
}
