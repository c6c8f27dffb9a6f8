//! Playing by hand: steps of whole frames, and of seconds without the plugin.
//!
//! In: a [`Playback`], a number of frames or of seconds, and the capture's duration. Out: the playback at its new time.

use super::component::Playback;
use super::drive::Drive;
use super::repeat::Repeat;
use super::span::Span;
use super::state::PlaybackState;

impl Playback {
    /// Pauses, and goes `frames` on (negative: back) in a capture that lasts `duration` seconds: from the nearest frame, to a
    /// frame that begins at exactly a whole number of `1 / fps` seconds since the capture's start.
    ///
    /// Frames stay in the range and continue at its ends as `repeat` specifies. The same number of steps back ends at
    /// the same frame, to the bit. If the range contains no frame, or `fps` is not a positive number, this only pauses.
    pub fn step(&mut self, frames: i32, fps: f32, duration: f32) {
        self.pause();
        let span = self.span(duration);
        if let Some((time, returning)) = frame_after(&span, self.time, self.returning, frames, fps) {
            self.time = time;
            self.returning = returning;
        }
    }

    /// Advances by `delta` seconds of the clock in a capture that lasts `duration` seconds. The plugin does this for every
    /// entity; call it only for captures that are played without the plugin.
    ///
    /// With [`Repeat::Loop`] time stays below the out point, because a loop ends where it begins. [`Repeat::Once`] stops exactly at the
    /// end (backwards: at the start) and pauses; played there without the plugin, it ends again, so call
    /// [`replay`](Self::replay). A still (no positive duration) and a `delta` that is not finite change nothing.
    pub fn advance(&mut self, delta: f32, duration: f32) {
        let mut state = PlaybackState { playing: self.playing, ..PlaybackState::default() };
        (*self, _) = state.advance(*self, Drive::By(delta.into()), duration);
    }
}

/// Tolerance within which frames coincide, in frames: smaller than any difference that is meant, larger than rounding.
const FRAME_SLACK: f64 = 1e-3;
/// Largest number of a frame at which frames can still be distinguished.
const MOST_FRAMES: f64 = 1e12;

/// Returns the time of the frame `frames` after the one nearest to `time`, as [`Playback::step`] describes, and whether
/// it is on the way back; `None` if the range contains no frame.
fn frame_after(span: &Span, time: f32, returning: bool, frames: i32, fps: f32) -> Option<(f32, bool)> {
    let fps = f64::from(fps);
    let (low, high) = (span.start() * fps, span.end() * fps);
    if !(fps > 0.0 && high <= MOST_FRAMES) {
        return None;
    }
    let first = (low - FRAME_SLACK).ceil() as i64;
    // The end of a loop is its beginning.
    let last = if span.repeat().wraps() {
        (high - FRAME_SLACK).ceil() as i64 - 1
    } else {
        (high + FRAME_SLACK).floor() as i64
    };
    if last < first {
        return None;
    }
    let now = (f64::from(time).clamp(span.start(), span.end()) * fps).round() as i64;
    let now = now.clamp(first, last) - first;
    let (count, frames) = (last - first, i64::from(frames));
    let (frame, returning) = match span.repeat() {
        Repeat::Once => ((now + frames).clamp(0, count), false),
        Repeat::Loop => ((now + frames).rem_euclid(count + 1), false),
        Repeat::PingPong if count == 0 => (0, false),
        Repeat::PingPong => {
            let place = if returning { 2 * count - now } else { now };
            let place = (place + frames).rem_euclid(2 * count);
            if place < count { (place, false) } else { (2 * count - place, true) }
        }
    };
    let time = ((first + frame) as f64 / fps).clamp(span.start(), span.end()) as f32;
    Some((time, returning))
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
                let inside = start <= time && (time < end || repeat.turns_round() && time == end);
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
        assert_eq!(advanced(nonsense, 0.25).time, 0.25, "NaN counts as the capture's own ends");
    }

    #[test]
    fn ping_pong_turns_round_at_both_ends() {
        let ping_pong = Playback { time: 1.5, repeat: Repeat::PingPong, ..Playback::default() };
        let back = Playback { returning: true, ..ping_pong };
        assert_eq!(advanced(ping_pong, 0.25), Playback { time: 1.75, ..ping_pong }, "still on its way");
        assert_eq!(advanced(ping_pong, 1.0), Playback { time: 1.5, ..back }, "as far back as it went past");
        assert_eq!(advanced(back, 1.0), Playback { time: 0.5, ..back }, "back");
        assert_eq!(advanced(back, 2.0), Playback { time: 0.5, ..ping_pong }, "and on again");
        assert_eq!(advanced(ping_pong, 4.0), ping_pong, "a whole round changes nothing");
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
