//! Explicit steps of a playback: by whole frames, and by seconds without the plugin.
//!
//! In: a [`Playback`], a number of frames or seconds, and the capture's duration. Out: the playback at its new time.

use super::component::Playback;
use super::drive::Drive;
use super::repeat::Repeat;
use super::span::Span;
use super::state::PlaybackState;

impl Playback {
    /// Pauses, and goes `frames` forward (negative: back) in a capture that lasts `duration` seconds: from the nearest
    /// frame to a frame that begins at exactly a whole number of `1 / fps` seconds since the capture's start.
    ///
    /// Frames stay in the range and continue at its ends as `repeat` specifies. The same number of steps back ends at
    /// bitwise the same time. If the range contains no frame, or `fps` is not a positive number, this only pauses.
    pub fn step(&mut self, frames: i32, fps: f32, duration: f32) {
        self.pause();
        let span = self.span(duration);
        if let Some((time, returning)) = frame_after(&span, self.time, self.returning, frames, fps) {
            self.time = time;
            self.returning = returning;
        }
    }

    /// Advances by `delta` seconds of the clock in a capture that lasts `duration` seconds. The plugin does this for
    /// every entity; call it only for captures that are played without the plugin.
    ///
    /// With [`Repeat::Loop`] the time stays below the out point, because the end of a loop is its start.
    /// [`Repeat::Once`] stops exactly at the end (backwards: at the start) and pauses. Without the plugin,
    /// [`play`](Self::play) at that end stops there again: call [`replay`](Self::replay). A still (duration 0 or less)
    /// and a `delta` that is not finite change nothing.
    pub fn advance(&mut self, delta: f32, duration: f32) {
        let mut state = PlaybackState { playing: self.playing, ..PlaybackState::default() };
        (*self, _) = state.advance(*self, Drive::By(delta.into()), duration);
    }
}

/// Tolerance within which frames coincide, in frames: below an intended difference, above the rounding error.
const FRAME_SLACK: f64 = 1e-3;
/// Largest number of a frame at which frames can still be distinguished.
const MOST_FRAMES: f64 = 1e12;

/// Returns the time of the frame `frames` after the frame nearest to `time`, as [`Playback::step`] describes, and
/// whether its pass returns; `None` if the range contains no frame.
fn frame_after(span: &Span, time: f32, returning: bool, frames: i32, fps: f32) -> Option<(f32, bool)> {
    let fps = f64::from(fps);
    let (low, high) = (span.start() * fps, span.end() * fps);
    if !(fps > 0.0 && high <= MOST_FRAMES) {
        return None;
    }
    let first = (low - FRAME_SLACK).ceil() as i64;
    // The end of a loop is its start.
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
        assert_eq!(at(1.5, 1.0, 0.25), 1.75, "a step within the capture");
        assert_eq!(at(1.5, 1.0, 0.5), 0.0, "the end of a loop is its start");
        assert_eq!(at(1.5, 1.0, 1.0), 0.5, "a step past the end wraps");
        assert_eq!(at(0.5, -1.0, 1.0), 1.5, "a backward step past the start wraps");
        assert_eq!(at(0.5, -1.0, 0.5), 0.0, "a backward step to the start stays at the start");
        assert_eq!(at(0.5, 0.0, 1.0), 0.5, "speed 0 does not advance");
    }

    #[test]
    fn steps_of_any_size_stay_inside_the_range() {
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
        assert_eq!(advanced(once, 0.25), Playback { time: 1.75, ..once }, "a step before the end does not stop");
        assert_eq!(advanced(once, 100.0), Playback { time: 2.0, playing: false, ..once }, "playback stops at the end");
        let back = Playback { speed: -2.0, ..once };
        assert_eq!(
            advanced(back, 100.0),
            Playback { time: 0.0, playing: false, ..back },
            "backwards, playback stops at the start"
        );
        let from_end = Playback { time: 2.0, ..back };
        assert_eq!(
            advanced(from_end, 0.5),
            Playback { time: 1.0, ..from_end },
            "backward playback from the end does not stop there"
        );
    }

    #[test]
    fn only_the_range_is_played() {
        let range = Playback { start: 0.5, end: 1.5, ..Playback::default() };
        let at = |time, speed, delta| advanced(Playback { time, speed, ..range }, delta).time;
        assert_eq!(at(0.0, 1.0, 0.25), 0.75, "playback from before the range starts at the in point");
        assert_eq!(at(1.25, 1.0, 0.5), 0.75, "a step past the out point continues at the in point");
        assert_eq!(at(0.75, -1.0, 0.5), 1.25, "a backward step past the in point continues at the out point");
        let once = Playback { time: 1.25, repeat: Repeat::Once, ..range };
        assert_eq!(advanced(once, 1.0), Playback { time: 1.5, playing: false, ..once }, "once stops at the out point");
        let back = Playback { speed: -1.0, ..once };
        assert_eq!(
            advanced(back, 9.0),
            Playback { time: 0.5, playing: false, ..back },
            "once stops at the in point backwards"
        );
        for (start, end) in [(1.5, 0.5), (1.0, 1.0), (f32::INFINITY, f32::INFINITY)] {
            let empty = Playback { time: 0.75, start, end, ..Playback::default() };
            assert_eq!(advanced(empty, 0.5), empty, "time does not advance in the empty range from {start} to {end}");
        }
        let invalid = Playback { time: f32::NAN, start: f32::NAN, end: f32::NAN, ..Playback::default() };
        assert_eq!(advanced(invalid, 0.25).time, 0.25, "NaN counts as the capture's own ends");
    }

    #[test]
    fn ping_pong_reverses_at_both_ends() {
        let ping_pong = Playback { time: 1.5, repeat: Repeat::PingPong, ..Playback::default() };
        let back = Playback { returning: true, ..ping_pong };
        assert_eq!(
            advanced(ping_pong, 0.25),
            Playback { time: 1.75, ..ping_pong },
            "a step before the end does not reverse"
        );
        assert_eq!(
            advanced(ping_pong, 1.0),
            Playback { time: 1.5, ..back },
            "a step past the end returns by the excess"
        );
        assert_eq!(advanced(back, 1.0), Playback { time: 0.5, ..back }, "a returning step goes back");
        assert_eq!(
            advanced(back, 2.0),
            Playback { time: 0.5, ..ping_pong },
            "a returning step past the start goes forward"
        );
        assert_eq!(advanced(ping_pong, 4.0), ping_pong, "two passes lead to the same time");
        let undone = Playback { speed: -1.0, ..back };
        assert_eq!(advanced(undone, 1.0).time, 1.5, "a negative speed undoes a step over the end");
        assert!(!advanced(undone, 1.0).returning, "a negative speed undoes the reversal");
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
        assert_eq!(reverse, forward, "a backward loop has the frames of the forward loop");
        let there_and_back = walk(Playback { repeat: Repeat::PingPong, ..Playback::default() }, 257);
        assert_eq!(there_and_back[..128], forward, "the first pass of ping-pong has the frames of the loop");
        let mut back = there_and_back[129..].to_vec();
        back.reverse();
        assert_eq!(back, forward, "the returning pass of ping-pong has the frames of the loop");
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
                    assert!((frame - frame.round()).abs() < 1e-3, "{} is a whole frame at {fps} fps", playback.time);
                    assert!((0.1..=1.9).contains(&playback.time), "{} is in the range", playback.time);
                }
                for &time in seen.iter().rev() {
                    playback.step(-1, fps, 2.0);
                    assert_eq!(playback.time, time, "steps back show the same times at {fps} fps, {repeat:?}");
                }
                assert_eq!(playback, origin, "single steps back end at the first frame");
                playback.step(500, fps, 2.0);
                playback.step(-500, fps, 2.0);
                assert_eq!(playback, origin, "one step of 500 frames and its inverse end at the first frame");
            }
        }
    }

    #[test]
    fn steps_stop_or_wrap_at_the_ends_of_the_range() {
        let mut once = Playback { time: 1.95, repeat: Repeat::Once, ..Playback::default() };
        once.step(i32::MAX, 30.0, 2.0);
        assert_eq!(once.time, 2.0, "with once, the end is a frame");
        once.step(i32::MIN, 30.0, 2.0);
        assert_eq!(once.time, 0.0, "with once, the start is a frame");
        let mut round = Playback { time: 59.0 / 30.0, ..Playback::default() };
        round.step(1, 30.0, 2.0);
        assert_eq!(round.time, 0.0, "a loop's last frame is followed by its first");
        for fps in [0.0, -30.0, f32::NAN, f32::INFINITY, 0.01] {
            let mut playback = Playback { time: 0.7, start: 0.5, end: 0.9, ..Playback::default() };
            playback.step(1, fps, 2.0);
            assert_eq!(playback.time, 0.7, "{fps} fps has no frame in the range, so the time stays");
        }
    }

    #[test]
    fn replay_begins_at_the_in_point_or_backwards_at_the_out_point() {
        let mut playback =
            Playback { time: 1.0, start: 0.5, end: 1.5, offset: 0.25, playing: false, ..Playback::default() };
        playback.replay();
        assert_eq!(
            (playback.time, playback.playing),
            (0.75, true),
            "forwards, replay begins the offset after the in point"
        );
        playback.reverse();
        playback.replay();
        assert_eq!(
            (playback.time, playback.speed),
            (1.25, -1.0),
            "backwards, replay begins the offset before the out point"
        );
        let mut whole = Playback { speed: -1.0, ..Playback::default() };
        whole.replay();
        assert_eq!(advanced(whole, 0.5).time, 1.5, "the default out point is the capture's end");
    }

    #[test]
    fn paused_and_still_captures_do_not_move() {
        let paused = Playback::paused_at(0.5);
        assert_eq!(advanced(paused, 1.0), paused, "a paused playback does not advance");
        let mut still = Playback::default();
        still.advance(1.0, 0.0);
        assert_eq!(still, Playback::default(), "a still does not advance");
    }
}
