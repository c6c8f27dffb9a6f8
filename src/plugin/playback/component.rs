//! The component with which a game plays a capture or a timeline.
//!
//! In: play, pause, seek, and fields that any system or animation may set. Out: a [`Playback`], whose time is drawn.

use super::repeat::Repeat;
use super::span::Span;
use super::state::PlaybackState;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// How a capture or a timeline is played: on every [`GaussianCapture3d`](crate::GaussianCapture3d) and
/// [`TimelinePlayer`](super::TimelinePlayer).
///
/// Code may set any field at any time; animations may set any field but `repeat`. Setting `time` is a seek: the time
/// between is skipped, not played. To slow down or to reverse, set `speed`.
///
/// Time begins with the first drawn frame: until a capture has been loaded and completely uploaded to the GPU, it stays
/// at its first moment. Without a renderer, until it has been loaded.
///
/// # Examples
///
/// ```
/// use bevy_gs4d::prelude::*;
///
/// let mut playback = Playback { speed: 0.5, ..Playback::once() };
/// // The plugin does this once a frame; here the call is explicit, for a capture of 2 s.
/// playback.advance(1.0, 2.0);
/// assert_eq!(playback.time, 0.5, "a second at half speed");
/// playback.reverse();
/// playback.advance(9.0, 2.0);
/// assert_eq!((playback.time, playback.playing), (0.0, false), "stopped at the start");
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
#[require(PlaybackState)]
pub struct Playback {
    /// Seconds since the capture's start. The plugin clamps the time to the range from `start` to `end`, unless the
    /// range is empty: seeking beyond an end goes to that end. Default: 0.
    pub time: f32,
    /// Seconds of the capture per second of the clock; negative plays backwards. Default: 1.
    pub speed: f32,
    /// Whether time advances. Default: true.
    pub playing: bool,
    /// The behavior at the end of the range. Default: [`Repeat::Loop`].
    pub repeat: Repeat,
    /// The in point: the first played moment, in seconds since the capture's start. Default: 0.
    pub start: f32,
    /// The out point: the last played moment, in seconds since the capture's start, clamped to the capture's end. Time
    /// does not advance in an empty range. Default: infinite.
    pub end: f32,
    /// The position in the range when a [shared clock](super::FollowsClock) is at 0, and the position where
    /// [`replay`](Self::replay) begins: seconds of the capture from the beginning of the range, in the direction of
    /// play. If negative, a follower with [`Repeat::Once`] waits at the beginning until the clock reaches it, and
    /// `replay` begins at the beginning. Default: 0.
    pub offset: f32,
    /// Whether [`Repeat::PingPong`] plays its returning pass; always false with other modes. Default: false.
    pub returning: bool,
}

impl Default for Playback {
    fn default() -> Self {
        Self {
            time: 0.0,
            speed: 1.0,
            playing: true,
            repeat: Repeat::Loop,
            start: 0.0,
            end: f32::INFINITY,
            offset: 0.0,
            returning: false,
        }
    }
}

impl Playback {
    /// Returns a playback that plays once and stops at the end.
    ///
    /// # Examples
    ///
    /// ```
    /// use bevy_gs4d::playback::Repeat;
    /// use bevy_gs4d::prelude::*;
    ///
    /// assert_eq!(Playback::once().repeat, Repeat::Once);
    /// ```
    pub fn once() -> Self {
        Self { repeat: Repeat::Once, ..Self::default() }
    }

    /// Returns a playback that reverses at each end.
    ///
    /// # Examples
    ///
    /// ```
    /// use bevy_gs4d::playback::Repeat;
    /// use bevy_gs4d::prelude::*;
    ///
    /// assert_eq!(Playback::ping_pong().repeat, Repeat::PingPong);
    /// ```
    pub fn ping_pong() -> Self {
        Self { repeat: Repeat::PingPong, ..Self::default() }
    }

    /// Returns a playback that is paused at `seconds` since the start.
    pub fn paused_at(seconds: f32) -> Self {
        Self { time: seconds, playing: false, ..Self::default() }
    }

    /// Starts to play. A playback that has stopped at its end, or would stop there immediately, plays from the
    /// beginning, as with [`replay`](Self::replay); a follower of a clock goes to the clock's time.
    pub fn play(&mut self) {
        self.playing = true;
    }

    /// Stops time.
    pub fn pause(&mut self) {
        self.playing = false;
    }

    /// [Plays](Self::play) a paused playback, pauses a running one.
    pub fn toggle(&mut self) {
        self.playing = !self.playing;
    }

    /// Goes to `seconds` since the start. Does not change [`playing`](Self::playing).
    pub fn seek(&mut self, seconds: f32) {
        self.time = seconds;
    }

    /// Reverses the direction of play. The time stays the same.
    pub fn reverse(&mut self) {
        self.speed = -self.speed;
    }

    /// Plays from the beginning: from `offset` after the in point or, if `speed` is negative, backwards from `offset`
    /// before the out point. Backwards, `offset` has no effect with the default out point, which is infinite.
    pub fn replay(&mut self) {
        self.time = if self.speed < 0.0 { self.end - self.offset } else { self.start + self.offset };
        self.returning = false;
        self.playing = true;
    }

    /// Returns the played range of a capture that lasts `duration` seconds.
    pub(super) fn span(&self, duration: f32) -> Span {
        Span::new([self.start, self.end], self.repeat, duration)
    }
}
