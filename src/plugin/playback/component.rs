//! What a game sets: how a capture, or a timeline, is played.
//!
//! In: play, pause, seek, step, and fields that any system or animation may write. Out: a [`Playback`], whose time is what is
//! drawn.

use super::span::{Span, frame_after};
use super::state::{Drive, PlaybackState};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// How a capture is played. Every field may be set at any time by code, and every one but `repeat` by an animation.
///
/// Setting `time` is a seek, whoever does it: what lies between is skipped. To slow down or to turn round, set `speed`.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(PlaybackState)]
pub struct Playback {
    /// Seconds since the capture's start. Drawing clamps it to the capture's duration. An infinite one becomes an end of the range.
    pub time: f32,
    /// Seconds of the capture per second of the clock; negative plays backwards.
    pub speed: f32,
    /// Whether time advances.
    pub playing: bool,
    /// What happens at the end.
    pub repeat: Repeat,
    /// The in point: the first moment that is played, in seconds since the capture's start. Time that advances from before it
    /// starts here.
    pub start: f32,
    /// The out point: the last moment that is played. Beyond the capture's end, as by default, it is the end. A range that is
    /// empty stands still.
    pub end: f32,
    /// How far into the range, in seconds of the capture in the direction of play, it is when a
    /// [shared clock](super::FollowsClock) shows 0, and where [`replay`](Self::replay) begins. With a negative one, what follows a
    /// clock and is played once waits at its beginning until the clock has caught up; `replay` begins at the beginning.
    pub offset: f32,
    /// Whether [`Repeat::PingPong`] is on its way back; otherwise always false.
    pub returning: bool,
}

/// What happens when the range has been played to its end.
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub enum Repeat {
    /// It stops there: at its last moment, or at its first one when played backwards.
    Once,
    /// It starts over.
    #[default]
    Loop,
    /// It turns round: back to the start, and on again.
    PingPong,
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

    /// Turns the direction of play round, at the same moment.
    pub fn reverse(&mut self) {
        self.speed = -self.speed;
    }

    /// Plays from the beginning: from the in point and `offset`, or backwards from the out point if `speed` is negative. From an out
    /// point beyond the capture's end, as by default, `offset` leads to no moment before that end.
    pub fn replay(&mut self) {
        self.time = if self.speed < 0.0 { self.end - self.offset } else { self.start + self.offset };
        self.returning = false;
        self.playing = true;
    }

    /// Pauses, and goes `frames` on (negative: back) in a capture that lasts `duration` seconds: from the frame that is nearest,
    /// to one that begins at exactly a whole number of `1 / fps` seconds since the capture's start.
    ///
    /// Frames stay in the range and continue at its ends as `repeat` says. As many steps back end where they began, to the bit.
    /// Where the range holds no frame, or `fps` is no positive number, only the pause happens.
    pub fn step(&mut self, frames: i32, fps: f32, duration: f32) {
        self.pause();
        let span = Span::new(self, duration);
        if let Some((time, returning)) = frame_after(&span, self.time, self.returning, frames, fps) {
            self.time = time;
            self.returning = returning;
        }
    }

    /// Moves on by `delta` seconds of the clock in a capture that lasts `duration` seconds. The plugin does this for every
    /// entity; this is for captures that are played without it.
    ///
    /// A loop ends where it begins, so its time stays below the out point. Playing once stops exactly at the end (or at the start,
    /// backwards) and pauses. A still (no positive duration) and a step that is not a finite number change nothing.
    pub fn advance(&mut self, delta: f32, duration: f32) {
        (*self, _) = PlaybackState::default().advance(*self, Drive::By(delta.into()), duration);
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
        assert_eq!(at(0.5, -1.0, 0.5), 0.0, "backwards to the start");
        assert_eq!(at(0.5, 0.0, 1.0), 0.5, "speed 0 stands");
    }

    #[test]
    fn a_loop_stays_inside_whatever_the_step() {
        for (delta, speed) in [(1e9, 1.0), (1e9, -3.7), (1e-12, -1.0), (1.0, 1e30), (1e30, -1e30)] {
            for (repeat, start, end) in
                [(Repeat::Loop, 0.0, 2.0), (Repeat::Loop, 0.3, 1.7), (Repeat::PingPong, 0.3, 1.7)]
            {
                let time = advanced(Playback { speed, repeat, start, end, ..Playback::default() }, delta).time;
                let inside = start <= time && (time < end || repeat == Repeat::PingPong && time == end);
                assert!(inside, "{delta} s at speed {speed} must stay between {start} and {end}, not reach {time}");
            }
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
    fn a_range_is_played_and_nothing_else() {
        let range = Playback { start: 0.5, end: 1.5, ..Playback::default() };
        let at = |time, speed, delta| advanced(Playback { time, speed, ..range }, delta).time;
        assert_eq!(at(0.0, 1.0, 0.25), 0.75, "from before, it starts at the in point");
        assert_eq!(at(1.25, 1.0, 0.5), 0.75, "past the out point, it is back at the in point");
        assert_eq!(at(0.75, -1.0, 0.5), 1.25, "and the other way");
        let once = Playback { time: 1.25, repeat: Repeat::Once, ..range };
        assert_eq!(advanced(once, 1.0), Playback { time: 1.5, playing: false, ..once }, "once ends at the out point");
        let back = Playback { speed: -1.0, ..once };
        assert_eq!(advanced(back, 9.0), Playback { time: 0.5, playing: false, ..back }, "or at the in point");
        for (start, end) in [(1.5, 0.5), (1.0, 1.0), (f32::INFINITY, f32::INFINITY)] {
            let empty = Playback { time: 0.75, start, end, ..Playback::default() };
            assert_eq!(advanced(empty, 0.5), empty, "{start} to {end} is empty and stands still");
        }
        let nonsense = Playback { time: f32::NAN, start: f32::NAN, end: f32::NAN, ..Playback::default() };
        assert_eq!(advanced(nonsense, 0.25).time, 0.25, "what is no number counts as the capture's own ends");
    }

    #[test]
    fn ping_pong_turns_round_at_both_ends() {
        let to_and_fro = Playback { time: 1.5, repeat: Repeat::PingPong, ..Playback::default() };
        let back = Playback { returning: true, ..to_and_fro };
        assert_eq!(advanced(to_and_fro, 0.25), Playback { time: 1.75, ..to_and_fro }, "still on its way");
        assert_eq!(advanced(to_and_fro, 1.0), Playback { time: 1.5, ..back }, "as far back as it went past");
        assert_eq!(advanced(back, 1.0), Playback { time: 0.5, ..back }, "back");
        assert_eq!(advanced(back, 2.0), Playback { time: 0.5, ..to_and_fro }, "and on again");
        assert_eq!(advanced(to_and_fro, 4.0), to_and_fro, "a whole round changes nothing");
        let undone = Playback { speed: -1.0, ..back };
        assert_eq!(advanced(undone, 1.0).time, 1.5, "a negative speed takes the same way back");
        assert!(!advanced(undone, 1.0).returning, "over the turning point");
    }

    #[test]
    fn reverse_and_ping_pong_hit_the_same_frames() {
        let walk = |mut playback: Playback, steps: usize| {
            let mut times = Vec::new();
            for _ in 0..steps {
                times.push(playback.time);
                playback.advance(1.0 / 64.0, 2.0);
            }
            times
        };
        let forward = walk(Playback::default(), 128);
        let mut reverse = walk(Playback { speed: -1.0, ..Playback::default() }, 128);
        reverse[1..].reverse();
        assert_eq!(reverse, forward, "a loop played backwards");
        let there_and_back = walk(Playback { repeat: Repeat::PingPong, ..Playback::default() }, 257);
        assert_eq!(there_and_back[..128], forward, "there");
        let mut back = there_and_back[129..].to_vec();
        back.reverse();
        assert_eq!(back, forward, "and back");
    }

    #[test]
    fn stepping_is_exact_and_can_be_undone() {
        for fps in [24.0, 29.97, 30.0, 60.0] {
            for repeat in [Repeat::Loop, Repeat::PingPong] {
                let mut playback = Playback { repeat, start: 0.1, end: 1.9, time: 0.1, ..Playback::default() };
                playback.step(0, fps, 2.0);
                let origin = playback;
                assert!(!playback.playing, "a step pauses");
                let mut seen = Vec::new();
                for _ in 0..500 {
                    seen.push(playback.time);
                    playback.step(1, fps, 2.0);
                    let frame = playback.time * fps;
                    assert!((frame - frame.round()).abs() < 1e-3, "{} is no whole frame at {fps}", playback.time);
                    assert!((0.1..=1.9).contains(&playback.time), "{} is out of range", playback.time);
                }
                for &time in seen.iter().rev() {
                    playback.step(-1, fps, 2.0);
                    assert_eq!(playback.time, time, "back by the same frames at {fps}, {repeat:?}");
                }
                assert_eq!(playback, origin, "where it began");
                playback.step(500, fps, 2.0);
                playback.step(-500, fps, 2.0);
                assert_eq!(playback, origin, "in one go, too");
            }
        }
    }

    #[test]
    fn steps_end_where_the_range_does() {
        let mut once = Playback { time: 1.95, repeat: Repeat::Once, ..Playback::default() };
        once.step(i32::MAX, 30.0, 2.0);
        assert_eq!(once.time, 2.0, "once, the end is a frame");
        once.step(i32::MIN, 30.0, 2.0);
        assert_eq!(once.time, 0.0, "and the start");
        let mut round = Playback { time: 59.0 / 30.0, ..Playback::default() };
        round.step(1, 30.0, 2.0);
        assert_eq!(round.time, 0.0, "a loop's last frame is followed by its first");
        for fps in [0.0, -30.0, f32::NAN, f32::INFINITY, 0.01] {
            let mut playback = Playback { time: 0.7, start: 0.5, end: 0.9, ..Playback::default() };
            playback.step(1, fps, 2.0);
            assert_eq!(playback.time, 0.7, "{fps} frames a second have none in the range");
        }
    }

    #[test]
    fn replay_begins_at_the_end_that_comes_first() {
        let mut playback =
            Playback { time: 1.0, start: 0.5, end: 1.5, offset: 0.25, playing: false, ..Playback::default() };
        playback.replay();
        assert_eq!((playback.time, playback.playing), (0.75, true), "forwards from the in point");
        playback.reverse();
        playback.replay();
        assert_eq!((playback.time, playback.speed), (1.25, -1.0), "backwards from the out point");
        let mut whole = Playback { speed: -1.0, ..Playback::default() };
        whole.replay();
        assert_eq!(advanced(whole, 0.5).time, 1.5, "which by default is the capture's end");
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
