//! The arithmetic of playing: a range of time that is played once, over and over, or to and fro.
//!
//! In: a [`Playback`]'s range and two phases, that is, seconds played since the in point without ever wrapping. Out: the moment
//! that a phase shows, and a [`Travel`]: every stretch of the capture that was passed between the two, in order.

use super::{Playback, Repeat};

/// A range of time and how it is repeated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    start: f64,
    length: f64,
    repeat: Repeat,
}

/// What one step has played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Travel {
    span: Span,
    /// The phases; of a longer way no more than four passes.
    from: f64,
    to: f64,
    /// Passes are numbered by the whole lengths before them.
    first: f64,
    last: f64,
    /// Whether what is exactly at the beginning counts as passed.
    inclusive: bool,
    /// Ends of the range that were reached.
    pub(super) turns: u32,
    /// Whether it has been played once and is over.
    pub(super) at_end: bool,
}

/// A stretch of the capture played in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leg {
    pub(super) from: f64,
    /// Before `from` if played backwards. Always passed.
    pub(super) to: f64,
    /// Whether `from` itself is passed.
    pub(super) inclusive: bool,
}

impl Span {
    /// The range of a playback in what lasts `duration` seconds.
    pub(super) fn new(playback: &Playback, duration: f32) -> Self {
        let duration = if duration.is_finite() { f64::from(duration.max(0.0)) } else { 0.0 };
        let bound = |value: f32, otherwise: f64| {
            if value.is_nan() { otherwise } else { f64::from(value).clamp(0.0, duration) }
        };
        let (start, end) = (bound(playback.start, 0.0), bound(playback.end, duration));
        Self { start, length: (end - start).max(0.0), repeat: playback.repeat }
    }

    /// Whether there is nothing to play.
    pub(super) fn is_still(&self) -> bool {
        self.length <= 0.0
    }

    /// Whether it is played to and fro.
    pub(super) fn is_ping_pong(&self) -> bool {
        self.repeat == Repeat::PingPong
    }

    /// Whether it starts over at its end.
    pub(super) fn is_loop(&self) -> bool {
        self.repeat == Repeat::Loop
    }

    /// Where the range begins.
    pub(super) fn start(&self) -> f32 {
        self.start as f32
    }

    /// Where it ends, unrounded.
    pub(super) fn end(&self) -> f64 {
        self.start + self.length
    }

    /// The phase, in the first pass (or the first two, to and fro), that shows a moment; what lies outside counts as the nearer end.
    pub(super) fn phase(&self, time: f32, returning: bool) -> f64 {
        let into = (f64::from(time) - self.start).clamp(0.0, self.length);
        if self.is_ping_pong() && returning { 2.0 * self.length - into } else { into }
    }

    /// The phase at `seconds` of a shared clock.
    pub(super) fn phase_at(&self, seconds: f64, speed: f32, offset: f32) -> f64 {
        let (speed, offset) = (f64::from(speed), f64::from(offset));
        if speed < 0.0 { self.length - offset + speed * seconds } else { offset + speed * seconds }
    }

    /// The moment at a phase of the first pass (or two): seconds since the capture's start, unrounded. The end of a loop is its
    /// beginning.
    pub(super) fn exact(&self, phase: f64) -> f64 {
        if self.is_loop() && phase >= self.length {
            return self.start;
        }
        self.start + if phase > self.length { (2.0 * self.length - phase).max(0.0) } else { phase.max(0.0) }
    }

    /// The moment at a phase of the first pass (or two), and whether it is on the way back.
    pub(super) fn moment(&self, phase: f64) -> (f32, bool) {
        let time = self.exact(phase) as f32;
        // Rounding may reach the end of a loop, too.
        let wrapped = self.is_loop() && f64::from(time) >= self.end();
        (if wrapped { self.start() } else { time }, self.is_ping_pong() && phase >= self.length)
    }

    /// Whether a phase is at or beyond the end in the direction of `speed`.
    pub(super) fn is_over(&self, phase: f64, forward: bool) -> bool {
        self.repeat == Repeat::Once && if forward { phase >= self.length } else { phase <= 0.0 }
    }

    /// What is played between two finite phases. With `fresh`, what is exactly at the beginning counts, too. Arriving at an end
    /// is a turn, leaving it is none.
    pub(super) fn travel(&self, from: f64, to: f64, fresh: bool) -> Travel {
        let (forward, length, distance) = (to >= from, self.length, to - from);
        let pass = |phase: f64| match (self.repeat, forward) {
            (Repeat::Once, _) => 0.0,
            (_, true) => (phase / length).floor(),
            (_, false) => (phase / length).ceil() - 1.0,
        };
        let inclusive = match self.repeat {
            Repeat::Once if from < 0.0 => to >= 0.0,
            Repeat::Once if from > length => to <= length,
            _ => fresh,
        };
        let round = (2.0 * length).copysign(distance);
        let cut = self.repeat != Repeat::Once && distance.abs() > 4.0 * length;
        let near = if cut { from + round + distance % round } else { to };
        Travel {
            span: *self,
            from,
            to: near,
            first: pass(from),
            last: pass(near),
            inclusive,
            turns: (pass(to) - pass(from)).abs() as u32,
            at_end: self.is_over(to, forward),
        }
    }
}

impl Travel {
    /// The phase that is reached, as one of the first pass (or two).
    pub(super) fn phase(&self) -> f64 {
        let into = self.within_pass(self.to, self.last);
        if self.is_returning(self.last) { self.span.length + into } else { into }
    }

    /// The stretches, in the order in which they were played. Of a step longer than four passes, two to four are told.
    pub(super) fn legs(&self) -> impl Iterator<Item = Leg> {
        let count = (self.last - self.first).abs() as u32;
        let direction = (self.last - self.first).signum();
        (0..=count).map(move |index| {
            let pass = self.first + direction * f64::from(index);
            let place = |phase| {
                let into = self.within_pass(phase, pass);
                self.span.start + if self.is_returning(pass) { self.span.length - into } else { into }
            };
            let inclusive = if index == 0 { self.inclusive } else { self.span.is_loop() };
            Leg { from: place(self.from), to: place(self.to), inclusive }
        })
    }

    /// Whether it came to the end of a loop and starts over.
    pub(super) fn wraps(&self) -> bool {
        self.span.is_loop() && self.turns > 0
    }

    /// Whether it was played in the direction of time.
    pub(super) fn is_forward(&self) -> bool {
        self.from < self.to
    }

    fn within_pass(&self, phase: f64, pass: f64) -> f64 {
        (phase - pass * self.span.length).clamp(0.0, self.span.length)
    }

    fn is_returning(&self, pass: f64) -> bool {
        self.span.is_ping_pong() && pass.rem_euclid(2.0) == 1.0
    }
}

impl Leg {
    /// Whether a moment was passed.
    pub(super) fn passes(&self, time: f64) -> bool {
        let within = if self.from <= self.to {
            self.from < time && time <= self.to
        } else {
            self.to <= time && time < self.from
        };
        within || self.inclusive && time == self.from
    }
}

/// What counts as the same, in frames: less than any difference that is meant, more than rounding.
const FRAME_SLACK: f64 = 1e-3;
/// Beyond this many frames they can no longer be told apart.
const MOST_FRAMES: f64 = 1e12;

/// The frame `frames` after the one nearest to `time`, as [`Playback::step`] describes; none where the range holds no frame.
pub(super) fn frame_after(span: &Span, time: f32, returning: bool, frames: i32, fps: f32) -> Option<(f32, bool)> {
    let fps = f64::from(fps);
    let (low, high) = (span.start * fps, span.end() * fps);
    if !(fps > 0.0 && high <= MOST_FRAMES) {
        return None;
    }
    let first = (low - FRAME_SLACK).ceil() as i64;
    // The end of a loop is its beginning.
    let last =
        if span.is_loop() { (high - FRAME_SLACK).ceil() as i64 - 1 } else { (high + FRAME_SLACK).floor() as i64 };
    if last < first {
        return None;
    }
    let now = (f64::from(time).clamp(span.start, span.end()) * fps).round() as i64;
    let now = now.clamp(first, last) - first;
    let (count, frames) = (last - first, i64::from(frames));
    let (frame, returning) = match span.repeat {
        Repeat::Once => ((now + frames).clamp(0, count), false),
        Repeat::Loop => ((now + frames).rem_euclid(count + 1), false),
        Repeat::PingPong if count == 0 => (0, false),
        Repeat::PingPong => {
            let place = if returning { 2 * count - now } else { now };
            let place = (place + frames).rem_euclid(2 * count);
            if place < count { (place, false) } else { (2 * count - place, true) }
        }
    };
    let time = ((first + frame) as f64 / fps).clamp(span.start, span.end()) as f32;
    Some((time, returning))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn span(start: f32, end: f32, repeat: Repeat) -> Span {
        Span::new(&Playback { start, end, repeat, ..Playback::default() }, 10.0)
    }

    fn legs(travel: &Travel) -> Vec<(f64, f64, bool)> {
        travel.legs().map(|leg| (leg.from, leg.to, leg.inclusive)).collect()
    }

    #[test]
    fn a_step_within_a_pass_is_one_stretch() {
        for repeat in [Repeat::Once, Repeat::Loop, Repeat::PingPong] {
            let span = span(1.0, 3.0, repeat);
            let travel = span.travel(0.5, 1.5, false);
            assert_eq!(legs(&travel), [(1.5, 2.5, false)], "forwards, {repeat:?}");
            assert_eq!((travel.phase(), travel.turns, travel.at_end), (1.5, 0, false), "and no turn");
            let travel = span.travel(1.5, 0.5, true);
            assert_eq!(legs(&travel), [(2.5, 1.5, true)], "backwards from a moment that counts, {repeat:?}");
        }
    }

    #[test]
    fn a_wrap_passes_the_end_and_the_beginning() {
        let span = span(1.0, 3.0, Repeat::Loop);
        let travel = span.travel(1.5, 2.5, false);
        assert_eq!(legs(&travel), [(2.5, 3.0, false), (1.0, 1.5, true)], "forwards");
        assert_eq!((travel.phase(), travel.turns), (0.5, 1), "one turn");
        let travel = span.travel(0.5, -0.5, false);
        assert_eq!(legs(&travel), [(1.5, 1.0, false), (3.0, 2.5, true)], "backwards");
        assert_eq!((travel.phase(), travel.turns), (1.5, 1), "one turn");
        let arrived = span.travel(1.5, 2.0, false);
        assert_eq!((legs(&arrived).len(), arrived.turns), (2, 1), "arriving at the end is the turn");
        assert_eq!(span.travel(arrived.phase(), 0.5, false).turns, 0, "leaving it is none");
    }

    #[test]
    fn ping_pong_passes_each_end_once() {
        let span = span(1.0, 3.0, Repeat::PingPong);
        let travel = span.travel(1.5, 2.5, false);
        assert_eq!(legs(&travel), [(2.5, 3.0, false), (3.0, 2.5, false)], "over the end");
        assert_eq!((travel.turns, span.moment(travel.phase())), (1, (2.5, true)), "one turn");
        let travel = span.travel(3.5, 4.5, false);
        assert_eq!(legs(&travel), [(1.5, 1.0, false), (1.0, 1.5, false)], "over the start");
        assert_eq!(span.moment(travel.phase()), (1.5, false), "and on again");
    }

    #[test]
    fn once_enters_and_leaves_the_range() {
        let span = span(1.0, 3.0, Repeat::Once);
        assert_eq!(
            legs(&span.travel(-1.0, 0.5, false)),
            [(1.0, 1.5, true)],
            "its first moment is passed on the way in"
        );
        assert_eq!(legs(&span.travel(3.0, 1.5, false)), [(3.0, 2.5, true)], "and its last one backwards");
        assert_eq!(legs(&span.travel(-2.0, -1.0, true)), [(1.0, 1.0, false)], "before it, nothing is");
        assert!(span.travel(1.5, 9.0, false).at_end, "it ends");
        assert!(span.travel(0.5, -9.0, false).at_end, "at the start, too, backwards");
    }

    #[test]
    fn a_huge_step_passes_everything_and_stays_small() {
        for repeat in [Repeat::Once, Repeat::Loop, Repeat::PingPong] {
            let span = span(1.0, 3.0, repeat);
            for to in [1e6, -1e6, 1e300] {
                let travel = span.travel(0.0, to, true);
                assert!(travel.legs().count() <= 5, "{repeat:?} to {to} has {} stretches", travel.legs().count());
                assert!((1.0..=3.0).contains(&span.moment(travel.phase()).0), "and ends in the range");
                let passed = |time| travel.legs().any(|leg| leg.passes(time));
                assert!(repeat == Repeat::Once || (passed(1.25) && passed(2.75)), "{repeat:?} passed all there is");
            }
        }
    }

    proptest! {
        /// However time is cut into steps, every moment is passed exactly as often as it is played over.
        #[test]
        fn steps_neither_skip_nor_repeat_a_moment(
            steps in proptest::collection::vec(0.001f64..1.5, 1..60),
            backwards in any::<bool>(),
            repeat in prop_oneof![Just(Repeat::Loop), Just(Repeat::PingPong)],
            mark in 0.01f64..1.99,
        ) {
            let span = span(1.0, 3.0, repeat);
            let (mut phase, mut passed, mut played) = (0.0, 0, 0.0);
            for step in steps {
                let travel = span.travel(phase, phase + if backwards { -step } else { step }, false);
                passed += travel.legs().filter(|leg| leg.passes(1.0 + mark)).count();
                phase = travel.phase();
                played += step;
            }
            // Phases, in the direction of play, at which the mark is shown.
            let shown: Vec<f64> = match repeat {
                Repeat::PingPong => vec![mark, 4.0 - mark],
                _ => vec![if backwards { 2.0 - mark } else { mark }],
            };
            let round = if repeat == Repeat::PingPong { 4.0 } else { 2.0 };
            let nearest = shown.iter().map(|s| ((played - s) / round - ((played - s) / round).round()).abs());
            // Rounding of the sum decides about what is exactly at its end.
            prop_assume!(nearest.fold(1.0, f64::min) > 1e-9);
            let expected: f64 = shown.iter().map(|s| ((played - s) / round).floor() + 1.0).sum();
            prop_assert_eq!(passed as f64, expected);
        }
    }
}
