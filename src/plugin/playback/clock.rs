//! Clocks that several captures share.
//!
//! In: the game's time, or seconds that the game sets from an audio player or the network. Out: a [`PlaybackClock`]
//! that every [`Playback`](super::Playback) with [`FollowsClock`] follows, whenever it was spawned or loaded.

use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::template::FromTemplate;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// A clock on a separate entity. Its followers show exactly the time of the clock, so that they cannot drift apart.
///
/// # Examples
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
///     clock.set(12.5); // the position in the song, in seconds
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// # bevy::ecs::system::assert_is_system(keep_time);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
pub struct PlaybackClock {
    /// The time of the clock, in seconds. Neither rounded nor wrapped: followers wrap it. Default: 0.
    pub seconds: f64,
    /// Seconds of the clock per second of the game, for [`ClockSource::Game`]; negative runs backwards. Default: 1.
    pub speed: f32,
    /// Whether the clock runs, for [`ClockSource::Game`]. Default: true.
    pub running: bool,
    /// The source of the clock's time. Default: [`ClockSource::Game`].
    pub source: ClockSource,
    /// Number of the clock's jumps. When the number changes, followers [seek](super::PlaybackSeeked) to the clock's
    /// time; otherwise they play the time in between, which crosses segment bounds and markers. Default: 0.
    pub jumps: u32,
}

/// The source of a clock's time. Default: [`Game`](Self::Game).
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
#[non_exhaustive]
pub enum ClockSource {
    /// Bevy's virtual time: the clock pauses and scales with it.
    #[default]
    Game,
    /// Only [`PlaybackClock::set`] and [`PlaybackClock::seek`].
    Manual,
}

/// Lets a [`Playback`](super::Playback) follow another entity: one with a [`PlaybackClock`], or any with a `Playback`,
/// such as another capture or a [`TimelinePlayer`](super::TimelinePlayer).
///
/// The playback's time is then the clock's time multiplied by the playback's own `speed`, plus its `offset`, within its
/// range and repeated as its `repeat` specifies; setting `time` has no effect. A paused follower keeps its time and
/// continues at the clock's time when it plays again.
///
/// The time of a followed `Playback` is its `time`; when that playback seeks or wraps, followers seek. A followed
/// entity may itself follow another: followed entities advance before their followers. Only timelines that follow a
/// capture show the capture's time of the frame before, because timelines advance before captures.
///
/// If the other entity does not exist or has no time, or if entities follow each other in a circle, the follower's time
/// does not advance, and the log has one warning.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::FollowsClock;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // Runs with the game's time, at half speed.
///     let clock = commands.spawn(PlaybackClock { speed: 0.5, ..default() }).id();
///     for file in ["left.gs4d", "right.gs4d"] {
///         commands.spawn((GaussianCapture3d(assets.load(file)), FollowsClock(clock)));
///     }
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, FromTemplate, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
pub struct FollowsClock(#[entities] pub Entity);

impl Default for PlaybackClock {
    fn default() -> Self {
        Self { seconds: 0.0, speed: 1.0, running: true, source: ClockSource::Game, jumps: 0 }
    }
}

impl PlaybackClock {
    /// Returns a clock at 0 that only [`set`](Self::set) and [`seek`](Self::seek) move.
    pub fn manual() -> Self {
        Self { source: ClockSource::Manual, ..Self::default() }
    }

    /// Sets the clock to `seconds` as elapsed time: followers play the time in between.
    pub fn set(&mut self, seconds: f64) {
        self.seconds = seconds;
    }

    /// Jumps to `seconds`: followers seek to that time.
    pub fn seek(&mut self, seconds: f64) {
        self.seconds = seconds;
        self.jumps = self.jumps.wrapping_add(1);
    }

    /// Advances by `delta` seconds of the game's time, if the source is [`ClockSource::Game`] and the clock runs. A
    /// clock whose speed is not finite does not advance.
    pub fn advance(&mut self, delta: f64) {
        let runs = match self.source {
            ClockSource::Game => self.running,
            ClockSource::Manual => false,
        };
        let next = self.seconds + delta * f64::from(self.speed);
        if runs && next.is_finite() {
            self.seconds = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_does_not_advance_at_a_speed_that_is_not_finite() {
        let mut clock = PlaybackClock { seconds: 1.0, ..PlaybackClock::default() };
        for speed in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            clock.speed = speed;
            clock.advance(0.5);
            clock.advance(0.0);
            assert_eq!(clock.seconds, 1.0, "the clock does not advance at speed {speed}");
        }
        clock.speed = 2.0;
        clock.advance(0.5);
        assert_eq!(clock.seconds, 2.0, "the clock runs again at a finite speed");
    }

    #[test]
    fn game_time_moves_game_clocks_and_not_manual_clocks() {
        let mut clock = PlaybackClock { speed: -0.5, ..PlaybackClock::default() };
        clock.advance(2.0);
        assert_eq!(clock.seconds, -1.0, "speed -0.5 runs backwards at half speed");
        clock.running = false;
        clock.advance(2.0);
        assert_eq!(clock.seconds, -1.0, "a stopped clock does not advance");
        let mut manual = PlaybackClock::manual();
        manual.advance(2.0);
        assert_eq!(manual.seconds, 0.0, "game time does not move a manual clock");
        manual.set(3.0);
        assert_eq!((manual.seconds, manual.jumps), (3.0, 0), "set is not a jump");
        manual.seek(1.0);
        assert_eq!((manual.seconds, manual.jumps), (1.0, 1), "seek is a jump");
    }
}
