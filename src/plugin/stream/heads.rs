//! Playheads: the playback of an entity as the schedule of files sees it.
//!
//! In: a [`Playback`], what it follows, the duration of its capture. Out: a [`Playhead`].

use crate::codec::stream::{Playhead, Turn};
use crate::plugin::playback::{ClockSource, FollowsClock, Playback, PlaybackClock, Repeat};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::system::{Query, SystemParam};

/// Most players that follow each other whose speeds count: those that follow in a circle do not advance.
const MOST_LEADERS: usize = 16;

/// The speeds of what players follow.
#[derive(SystemParam)]
pub(super) struct Leaders<'w, 's> {
    follows: Query<'w, 's, &'static FollowsClock, With<Playback>>,
    players: Query<'w, 's, &'static Playback>,
    clocks: Query<'w, 's, &'static PlaybackClock>,
}

impl Leaders<'_, '_> {
    /// Returns the seconds per second of what an entity follows. What is at rest, or set by the game, counts as playing
    /// at speed 1, and so does an entity that follows nothing.
    pub(super) fn speed(&self, entity: Entity) -> f64 {
        let (mut speed, mut follower) = (1.0, entity);
        for _ in 0..MOST_LEADERS {
            let Ok(&FollowsClock(leader)) = self.follows.get(follower) else { break };
            let of_leader = match (self.players.get(leader), self.clocks.get(leader)) {
                (Ok(player), _) => velocity(player),
                (_, Ok(clock)) if clock.source == ClockSource::Game && clock.running => clock.speed.into(),
                _ => 0.0,
            };
            if of_leader != 0.0 && of_leader.is_finite() {
                speed *= of_leader;
            }
            follower = leader;
        }
        speed
    }
}

/// Returns where a playback is and where it goes, given the speed of what it [follows](Leaders::speed).
pub(super) fn playhead(playback: &Playback, leaders: f64, duration: f32) -> Playhead {
    let turn = match playback.repeat {
        Repeat::Once => Turn::Stop,
        Repeat::Loop => Turn::Loop,
        Repeat::PingPong => Turn::Return,
    };
    let range = [playback.start, playback.end.min(duration)].map(f64::from);
    Playhead { seconds: playback.time.into(), velocity: velocity(playback) * leaders, range, turn, delay: 0.0 }
}

/// Returns the seconds that a playback goes per second of its clock; negative backwards, 0 at rest.
fn velocity(playback: &Playback) -> f64 {
    let direction = if playback.returning { -1.0 } else { 1.0 };
    if playback.playing { direction * f64::from(playback.speed) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::ecs::system::RunSystemOnce;
    use bevy::ecs::world::World;

    #[test]
    fn a_follower_goes_as_fast_as_what_it_follows() {
        let mut world = World::new();
        let clock = world.spawn(PlaybackClock { speed: -2.0, ..PlaybackClock::default() }).id();
        let stopped = world.spawn(PlaybackClock { running: false, ..PlaybackClock::default() }).id();
        let manual = world.spawn(PlaybackClock { speed: 5.0, ..PlaybackClock::manual() }).id();
        let half = Playback { speed: 0.5, ..Playback::default() };
        // As a timeline and its track do.
        let timeline = world.spawn((Playback { speed: 3.0, ..half }, PlaybackClock::manual())).id();
        let nested = world.spawn((half, FollowsClock(timeline))).id();
        let circle = world.spawn(half).id();
        world.entity_mut(circle).insert(FollowsClock(circle));
        for (leader, expected) in
            [(clock, -1.0), (stopped, 0.5), (manual, 0.5), (timeline, 1.5), (nested, 0.75), (Entity::PLACEHOLDER, 0.5)]
        {
            let follower = world.spawn((half, FollowsClock(leader))).id();
            let head = move |leaders: Leaders| playhead(&half, leaders.speed(follower), 9.0).velocity;
            let velocity: f64 = world.run_system_once(head).expect("the system runs");
            assert_eq!(velocity, expected, "the velocity of a follower of {leader}");
        }
        let around = world.run_system_once(move |leaders: Leaders| leaders.speed(circle)).expect("the system runs");
        assert!(around.is_finite(), "a circle has an end: {around}");
    }
}
