//! The components of sounds.
//!
//! In: a sound, the time of its player in each frame. Out: a [`SoundState`] with the position and the speed of the
//! sound.

use super::follower::SoundCue;
use crate::codec::sound::Sound;
use crate::plugin::component::SoundTrack;
use bevy::asset::Handle;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// Plays a sound beside a capture: on an entity with a [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// The sound begins at the first moment of the capture, and follows its [`Playback`](crate::playback::Playback):
/// forward, backward, faster, slower, silent while it rests or [stalls](crate::stream::OnUnderrun::Stall). By default
/// it is the sound that the capture carries in its package, where `gs4d sound` puts it. A capture in chunk files
/// carries none: give it a [track](Self::track). The sound is not stretched if the capture is loaded with another
/// duration than its own.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((GaussianCapture3d(assets.load("singer.gs4d")), Upright, CaptureSound { volume: 0.8, ..default() }));
///     let sound = CaptureSound { track: Some(assets.load("concert/index.ogg")), ..default() };
///     commands.spawn((GaussianCapture3d(assets.load("concert/index.gs4d")), Upright, sound));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::sound"]
#[require(SoundState)]
pub struct CaptureSound {
    /// The sound. Default: `None`, that of the package.
    pub track: Option<Handle<SoundTrack>>,
    /// A factor on the samples, 0 to 1. Default: 1.
    pub volume: f32,
}

impl Default for CaptureSound {
    fn default() -> Self {
        Self { track: None, volume: 1.0 }
    }
}

/// Plays the sound with this number, from 0, of the parent's timeline. The plugins spawn a child of the
/// [`TimelinePlayer`](crate::playback::TimelinePlayer) for each of its sounds.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::sound"]
#[require(SoundState)]
pub struct TimelineSound(pub usize);

/// What is heard of a sound at the time that is drawn: on entities with a [`CaptureSound`] or a [`TimelineSound`].
///
/// The plugin updates it each frame, in [`CaptureSoundSystems`](super::CaptureSoundSystems). With the feature
/// `bevy_audio` nothing else is needed; a game with another audio engine hands the state of each sound to a
/// [`SoundFollower`](super::SoundFollower) of its own.
#[derive(Component, Reflect, Debug, Default, Clone)]
#[reflect(Component, Default, Debug, Clone)]
#[type_path = "bevy_gs4d::sound"]
pub struct SoundState {
    /// `None` until the sound is loaded, and for a capture without one.
    #[reflect(ignore)]
    pub(super) sound: Option<Sound>,
    seconds: f64,
    speed: f64,
    volume: f32,
    /// The number of jumps of the player; `None` before its first time.
    jumps: Option<u32>,
    /// What has been warned of last.
    #[reflect(ignore)]
    pub(super) lack: Option<Lack>,
}

/// Why nothing is heard of a [`CaptureSound`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lack {
    /// Its entity has no capture.
    Capture,
    /// It has no track, and its capture no sound.
    Sound,
}

/// The time of a player in a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heard {
    /// Seconds of the sound.
    pub seconds: f64,
    /// The number of jumps of the player: seeks, and wraps of a loop.
    pub jumps: u32,
    /// Whether the player plays.
    pub playing: bool,
    /// A factor on the samples.
    pub volume: f32,
}

impl SoundState {
    /// Returns the sound; `None` until it is loaded, and for a capture without one.
    pub fn sound(&self) -> Option<&Sound> {
        self.sound.as_ref()
    }

    /// Returns the position in the sound, in seconds; negative before its start.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Returns the seconds of the sound per second of the wall clock; negative backwards, 0 at rest.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Returns the factor on the samples, 0 to 1.
    pub fn volume(&self) -> f32 {
        self.volume
    }

    /// Returns what a [`SoundFollower`](super::SoundFollower) follows, given when the state was updated, in seconds of
    /// the clock by which samples are asked for.
    pub fn cue(&self, at: f64) -> SoundCue {
        SoundCue { sound: self.sound.clone(), seconds: self.seconds, speed: self.speed, volume: self.volume, at }
    }

    /// Sets the time, `delta` seconds of the wall clock after the one before. The speed is that of the time between; a
    /// player that jumps keeps its speed.
    pub(super) fn advance(&mut self, heard: Heard, delta: f64) {
        let Heard { seconds, jumps, playing, volume } = heard;
        self.speed = match self.jumps {
            Some(before) if before == jumps && delta > 0.0 => (seconds - self.seconds) / delta,
            Some(_) if playing => self.speed,
            Some(_) | None => 0.0,
        };
        (self.seconds, self.jumps) = (seconds, Some(jumps));
        self.volume = if volume.is_nan() { 0.0 } else { volume.clamp(0.0, 1.0) };
    }

    /// Makes the sound silent: there is no player, or no time.
    pub(super) fn rest(&mut self) {
        *self = Self { lack: self.lack, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64, jumps: u32) -> Heard {
        Heard { seconds, jumps, playing: true, volume: 1.0 }
    }

    #[test]
    fn the_speed_is_that_of_the_time_that_is_drawn() {
        let mut state = SoundState::default();
        state.advance(at(1.0, 0), 0.5);
        assert_eq!((state.seconds(), state.speed()), (1.0, 0.0), "the first time has no speed");
        state.advance(at(2.0, 0), 0.5);
        assert_eq!((state.seconds(), state.speed()), (2.0, 2.0), "a second in half a second");
        state.advance(at(2.0, 0), 0.5);
        assert_eq!(state.speed(), 0.0, "a player that waits has no speed");
        state.advance(at(1.5, 0), 0.5);
        assert_eq!(state.speed(), -1.0, "backwards");
        state.advance(at(1.5, 0), 0.0);
        assert_eq!(state.speed(), -1.0, "an update in which no time passes keeps the speed");
    }

    #[test]
    fn a_jump_keeps_the_speed_unless_the_player_rests() {
        let mut state = SoundState::default();
        state.advance(at(1.0, 0), 0.5);
        state.advance(at(1.5, 0), 0.5);
        state.advance(at(9.0, 1), 0.5);
        assert_eq!((state.seconds(), state.speed()), (9.0, 1.0), "a seek while it plays");
        state.advance(Heard { playing: false, ..at(3.0, 2) }, 0.5);
        assert_eq!((state.seconds(), state.speed()), (3.0, 0.0), "a seek and a pause at once");
        state.advance(Heard { volume: f32::NAN, ..at(3.0, 2) }, 0.5);
        assert_eq!(state.volume(), 0.0, "a volume that is not a number is silent");
    }
}
