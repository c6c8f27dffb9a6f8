//! The clock of one capture: a component and the arithmetic of its hand.
//!
//! In: seconds that have gone by and the capture's duration. Out: a [`Playback`] with its time moved on, wrapped or stopped.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::{Reflect, std_traits::ReflectDefault};

/// How a capture is played. Every field may be set at any time, by code or by an animation.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct Playback {
    /// Seconds since the capture's start. Drawing clamps it to the capture's duration.
    pub time: f32,
    /// Seconds of the capture per second of the clock; negative plays backwards.
    pub speed: f32,
    /// Whether time advances.
    pub playing: bool,
    /// What happens at the end.
    pub repeat: Repeat,
}

/// What happens when a capture has been played to its end.
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub enum Repeat {
    /// It stops there: at its last moment, or at its first one when played backwards.
    Once,
    /// It starts over.
    #[default]
    Loop,
}

impl Default for Playback {
    fn default() -> Self {
        Self { time: 0.0, speed: 1.0, playing: true, repeat: Repeat::Loop }
    }
}

impl Playback {
    /// Standing still at `seconds` since the start.
    pub fn paused_at(seconds: f32) -> Self {
        Self { time: seconds, playing: false, ..Self::default() }
    }

    /// Lets time advance.
    pub fn play(&mut self) {
        self.playing = true;
    }

    /// Holds time where it is.
    pub fn pause(&mut self) {
        self.playing = false;
    }

    /// Plays if paused, pauses if playing.
    pub fn toggle(&mut self) {
        self.playing = !self.playing;
    }

    /// Goes to `seconds` since the start, playing or not as before.
    pub fn seek(&mut self, seconds: f32) {
        self.time = seconds;
    }

    /// Moves on by `delta` seconds of the clock in a capture that lasts `duration` seconds.
    ///
    /// A loop ends where it begins, so its time stays below `duration`. Playing once stops exactly at the end (or at 0, backwards)
    /// and pauses. A still (no positive duration) and a step that is not a finite number change nothing.
    pub fn advance(&mut self, delta: f32, duration: f32) {
        let length = f64::from(duration);
        let target = f64::from(self.time) + f64::from(delta) * f64::from(self.speed);
        if !self.playing || !target.is_finite() || !length.is_finite() || length <= 0.0 {
            return;
        }
        match self.repeat {
            Repeat::Loop => {
                let wrapped = target.rem_euclid(length) as f32;
                // Rounding may reach the end, which is the beginning.
                self.time = if wrapped < duration { wrapped } else { 0.0 };
            }
            Repeat::Once => {
                let (at_start, at_end) = (target <= 0.0 && self.speed < 0.0, target >= length && self.speed > 0.0);
                self.time = (target as f32).clamp(0.0, duration);
                self.playing = !(at_start || at_end);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advanced(playback: Playback, delta: f32) -> Playback {
        let mut moved = playback;
        moved.advance(delta, 2.0);
        moved
    }

    #[test]
    fn a_loop_wraps_exactly() {
        let at = |time, speed, delta| advanced(Playback { time, speed, ..Playback::default() }, delta).time;
        assert_eq!(at(1.5, 1.0, 0.25), 1.75, "within the capture");
        assert_eq!(at(1.5, 1.0, 0.5), 0.0, "the end is the beginning");
        assert_eq!(at(1.5, 1.0, 1.0), 0.5, "past the end");
        assert_eq!(at(0.5, -1.0, 1.0), 1.5, "backwards past the start");
        assert_eq!(at(0.5, 0.0, 1.0), 0.5, "speed 0 stands");
    }

    #[test]
    fn a_loop_stays_inside_whatever_the_step() {
        for (delta, speed) in [(1e9, 1.0), (1e9, -3.7), (1e-12, -1.0), (1.0, 1e30)] {
            let time = advanced(Playback { speed, ..Playback::default() }, delta).time;
            assert!((0.0..2.0).contains(&time), "{delta} s at speed {speed} must stay in [0, 2), not reach {time}");
        }
        let odd = advanced(Playback { time: 0.5, ..Playback::default() }, f32::INFINITY);
        assert_eq!(odd.time, 0.5, "an infinite step changes nothing");
    }

    #[test]
    fn once_clamps_and_pauses_at_either_end() {
        let once = Playback { time: 1.5, repeat: Repeat::Once, ..Playback::default() };
        assert_eq!(advanced(once, 0.25), Playback { time: 1.75, ..once }, "not there yet");
        assert_eq!(advanced(once, 100.0), Playback { time: 2.0, playing: false, ..once }, "stops at the end");
        let back = Playback { speed: -2.0, ..once };
        assert_eq!(advanced(back, 100.0), Playback { time: 0.0, playing: false, ..back }, "stops at the start");
        let from_end = Playback { time: 2.0, ..back };
        assert_eq!(advanced(from_end, 0.5), Playback { time: 1.0, ..from_end }, "can be played back from the end");
    }

    #[test]
    fn paused_and_still_captures_do_not_move() {
        let paused = Playback::paused_at(0.5);
        assert_eq!(advanced(paused, 1.0), paused, "paused");
        let mut still = Playback::default();
        still.advance(1.0, 0.0);
        assert_eq!(still, Playback::default(), "no duration");
    }
}
