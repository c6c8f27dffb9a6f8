//! Clocks that several captures share.
//!
//! In: the game's time, or seconds set by hand from an audio player or the network. Out: a [`PlaybackClock`], to which every
//! [`Playback`](super::Playback) with [`FollowsClock`] keeps, whenever it was spawned or loaded.

use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// A clock on an entity of its own. Its followers show the moment it stands at, and nothing else: they cannot drift apart.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::{FollowsClock, PlaybackClock};
///
/// fn setup(mut commands: Commands) {
///     let music = commands.spawn(PlaybackClock::manual()).id();
///     commands.spawn(FollowsClock(music)); // with a GaussianCapture3d, any number of them
/// }
///
/// fn keep_time(mut clock: Single<&mut PlaybackClock>) {
///     clock.set(12.5); // where the song is now
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// # bevy::ecs::system::assert_is_system(keep_time);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct PlaybackClock {
    /// What it shows. Unrounded and never wrapped: followers do that for themselves.
    pub seconds: f64,
    /// Seconds that it gains per second of the game; negative runs backwards. Counts for [`ClockSource::Game`] only.
    pub speed: f32,
    /// Whether it runs. Counts for [`ClockSource::Game`] only.
    pub running: bool,
    /// What moves it.
    pub source: ClockSource,
    /// How often it has jumped. When this changes, followers [seek](super::PlaybackSeeked) to what it shows; otherwise they
    /// play whatever lies between, which crosses key-frames and markers.
    pub jumps: u32,
}

/// What moves a clock.
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub enum ClockSource {
    /// Bevy's virtual time: the clock pauses and scales with it.
    #[default]
    Game,
    /// Nothing but [`PlaybackClock::set`] and [`PlaybackClock::seek`].
    Manual,
}

/// Keeps a [`Playback`](super::Playback) to the [`PlaybackClock`] on another entity.
///
/// Its time is then the clock's, multiplied by its own speed, `offset` into its range, repeated as it says; `time` cannot be set.
/// A follower that is paused stands, and falls in with the clock again when it plays. Where the entity has no clock, time stands.
/// A [`TimelinePlayer`](super::TimelinePlayer) cannot follow the clock of another one: let both follow a clock of their own.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Debug, Clone, PartialEq)]
pub struct FollowsClock(#[entities] pub Entity);

impl Default for PlaybackClock {
    fn default() -> Self {
        Self { seconds: 0.0, speed: 1.0, running: true, source: ClockSource::Game, jumps: 0 }
    }
}

impl PlaybackClock {
    /// A clock at 0 that is set by hand.
    pub fn manual() -> Self {
        Self { source: ClockSource::Manual, ..Self::default() }
    }

    /// Shows that time has passed until `seconds`: what followers skip over counts as played.
    pub fn set(&mut self, seconds: f64) {
        self.seconds = seconds;
    }

    /// Jumps to `seconds`: followers seek.
    pub fn seek(&mut self, seconds: f64) {
        self.seconds = seconds;
        self.jumps = self.jumps.wrapping_add(1);
    }

    /// Moves on by `delta` seconds of the game, if it does so. A speed that is no finite number holds it.
    pub fn advance(&mut self, delta: f64) {
        let next = self.seconds + delta * f64::from(self.speed);
        if self.running && self.source == ClockSource::Game && next.is_finite() {
            self.seconds = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_recovers_from_a_speed_that_is_no_number() {
        let mut clock = PlaybackClock { seconds: 1.0, ..PlaybackClock::default() };
        for speed in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            clock.speed = speed;
            clock.advance(0.5);
            clock.advance(0.0);
            assert_eq!(clock.seconds, 1.0, "at speed {speed} it stands");
        }
        clock.speed = 2.0;
        clock.advance(0.5);
        assert_eq!(clock.seconds, 2.0, "and then it runs");
    }

    #[test]
    fn a_clock_of_the_game_runs_and_one_set_by_hand_does_not() {
        let mut clock = PlaybackClock { speed: -0.5, ..PlaybackClock::default() };
        clock.advance(2.0);
        assert_eq!(clock.seconds, -1.0, "backwards at half speed");
        clock.running = false;
        clock.advance(2.0);
        assert_eq!(clock.seconds, -1.0, "stopped");
        let mut manual = PlaybackClock::manual();
        manual.advance(2.0);
        assert_eq!(manual.seconds, 0.0, "only by hand");
        manual.set(3.0);
        assert_eq!((manual.seconds, manual.jumps), (3.0, 0), "time passes");
        manual.seek(1.0);
        assert_eq!((manual.seconds, manual.jumps), (1.0, 1), "or jumps");
    }
}
