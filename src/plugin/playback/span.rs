//! The arithmetic of playback: a range of time that is played once, in a loop, or ping-pong.
//!
//! In: a range and two phases. A phase is the time played since the in point, in seconds, without wrapping; a pass is
//! one run through the range. Out: the time at a phase, and a [`Travel`]: all stretches of the capture between the two
//! phases, in order.

use super::repeat::Repeat;

/// A range of time and its repeat mode. Seconds of the capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    start: f64,
    length: f64,
    repeat: Repeat,
}

/// The stretches that one step has played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Travel {
    span: Span,
    /// The phases, at most four passes apart: `to` is moved nearer if the step was longer.
    from: f64,
    to: f64,
    /// The first and the last pass. A pass is numbered by the whole range lengths before it.
    first: f64,
    last: f64,
    /// Whether the moment at `from` counts as passed.
    inclusive: bool,
    /// Number of times that an end of the range was reached.
    pub(super) turns: u32,
    /// Whether the step reached the end at which playback stops.
    pub(super) at_end: bool,
}

/// A stretch of the capture played in one direction. Seconds since the capture's start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leg {
    pub(super) from: f64,
    /// Less than `from` if played backwards. The moment at `to` always counts as passed.
    pub(super) to: f64,
    /// Whether the moment at `from` counts as passed.
    pub(super) inclusive: bool,
}

impl Span {
    /// Returns the range from `start` to `end` of a capture that lasts `duration` seconds. Both are clamped to the
    /// capture; a NaN start counts as 0, a NaN end as the duration.
    pub(super) fn new([start, end]: [f32; 2], repeat: Repeat, duration: f32) -> Self {
        let duration = if duration.is_finite() { f64::from(duration.max(0.0)) } else { 0.0 };
        let bound = |value: f32, otherwise: f64| {
            if value.is_nan() { otherwise } else { f64::from(value).clamp(0.0, duration) }
        };
        let (start, end) = (bound(start, 0.0), bound(end, duration));
        Self { start, length: (end - start).max(0.0), repeat }
    }

    /// Returns whether the range is empty.
    pub(super) fn is_still(&self) -> bool {
        self.length <= 0.0
    }

    /// Returns `time` clamped to the range, NaN as the start. In an empty range a finite time is returned unchanged.
    pub(super) fn clamped(&self, time: f32) -> f32 {
        let [start, end] = [self.start as f32, self.end() as f32];
        match time {
            _ if time.is_nan() => start,
            _ if self.is_still() && time.is_finite() => time,
            _ => time.clamp(start, end),
        }
    }

    /// Returns the repeat mode.
    pub(super) fn repeat(&self) -> Repeat {
        self.repeat
    }

    /// Returns the start of the range, unrounded.
    pub(super) fn start(&self) -> f64 {
        self.start
    }

    /// Returns the end of the range, unrounded.
    pub(super) fn end(&self) -> f64 {
        self.start + self.length
    }

    /// Returns the phase of `time` in the first pass or, of a ping-pong range, in the first two passes. Times outside
    /// of the range are clamped.
    pub(super) fn phase(&self, time: f32, returning: bool) -> f64 {
        let into = (f64::from(time) - self.start).clamp(0.0, self.length);
        if self.repeat.turns_round() && returning { 2.0 * self.length - into } else { into }
    }

    /// Returns the phase at `seconds` of a shared clock.
    pub(super) fn phase_at(&self, seconds: f64, speed: f32, offset: f32) -> f64 {
        let (speed, offset) = (f64::from(speed), f64::from(offset));
        if speed < 0.0 { self.length - offset + speed * seconds } else { offset + speed * seconds }
    }

    /// Returns the time at a phase of the first pass (ping-pong: the first two): seconds since the capture's start,
    /// unrounded. The end of a loop is its start.
    pub(super) fn exact(&self, phase: f64) -> f64 {
        if self.repeat.wraps() && phase >= self.length {
            return self.start;
        }
        self.start + if phase > self.length { (2.0 * self.length - phase).max(0.0) } else { phase.max(0.0) }
    }

    /// Returns the time at a phase of the first pass (ping-pong: the first two), and whether the pass returns.
    pub(super) fn moment(&self, phase: f64) -> (f32, bool) {
        let time = self.exact(phase) as f32;
        // Rounding may also reach the end of a loop.
        let wrapped = self.repeat.wraps() && f64::from(time) >= self.end();
        (if wrapped { self.start as f32 } else { time }, self.repeat.turns_round() && phase >= self.length)
    }

    /// Returns whether a phase is at or beyond the end at which playing stops, in the given direction.
    pub(super) fn is_over(&self, phase: f64, forward: bool) -> bool {
        self.repeat.stops() && if forward { phase >= self.length } else { phase <= 0.0 }
    }

    /// Returns the stretches between two finite phases. With `fresh`, the moment at `from` counts as passed. Arriving
    /// at an end counts as a turn, leaving it does not.
    pub(super) fn travel(&self, from: f64, to: f64, fresh: bool) -> Travel {
        let (forward, length, distance) = (to >= from, self.length, to - from);
        let pass = |phase: f64| match (self.repeat, forward) {
            (Repeat::Once, _) => 0.0,
            (Repeat::Loop | Repeat::PingPong, true) => (phase / length).floor(),
            (Repeat::Loop | Repeat::PingPong, false) => (phase / length).ceil() - 1.0,
        };
        let inclusive = match self.repeat {
            Repeat::Once if from < 0.0 => to >= 0.0,
            Repeat::Once if from > length => to <= length,
            Repeat::Once | Repeat::Loop | Repeat::PingPong => fresh,
        };
        let round = (2.0 * length).copysign(distance);
        let cut = !self.repeat.stops() && distance.abs() > 4.0 * length;
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
    /// Returns the reached phase, as a phase of the first pass (ping-pong: the first two).
    pub(super) fn phase(&self) -> f64 {
        let into = self.within_pass(self.to, self.last);
        if self.is_returning(self.last) { self.span.length + into } else { into }
    }

    /// Returns the stretches, in the order of play. A step longer than four passes returns the stretches of two to four
    /// passes. The end of a loop at which the step began may come first, as a stretch of length 0.
    pub(super) fn legs(&self) -> impl Iterator<Item = Leg> {
        let count = (self.last - self.first).abs() as u32;
        let direction = (self.last - self.first).signum();
        let stretches = (0..=count).map(move |index| {
            let pass = self.first + direction * f64::from(index);
            let place = |phase| {
                let into = self.within_pass(phase, pass);
                self.span.start + if self.is_returning(pass) { self.span.length - into } else { into }
            };
            let inclusive = if index == 0 { self.inclusive } else { self.span.repeat.wraps() };
            Leg { from: place(self.from), to: place(self.to), inclusive }
        });
        self.left().map(|at| Leg { from: at, to: at, inclusive: true }).into_iter().chain(stretches)
    }

    /// Returns the end of a loop at which the step began, in seconds since the capture's start, if this end counts as
    /// passed. No stretch contains it, because the first stretch begins at the other end.
    fn left(&self) -> Option<f64> {
        let (phase, end) = if self.is_forward() { (self.span.length, self.span.end()) } else { (0.0, self.span.start) };
        (self.inclusive && self.span.repeat.wraps() && self.from == phase).then_some(end)
    }

    /// Returns whether the step passed the end of a loop and started over.
    pub(super) fn wraps(&self) -> bool {
        self.span.repeat.wraps() && self.turns > 0
    }

    /// Returns whether the step was played forwards.
    pub(super) fn is_forward(&self) -> bool {
        self.from < self.to
    }

    fn within_pass(&self, phase: f64, pass: f64) -> f64 {
        (phase - pass * self.span.length).clamp(0.0, self.span.length)
    }

    fn is_returning(&self, pass: f64) -> bool {
        self.span.repeat.turns_round() && pass.rem_euclid(2.0) == 1.0
    }
}

impl Leg {
    /// Returns whether the stretch passes `time`, in seconds since the capture's start.
    pub(super) fn passes(&self, time: f64) -> bool {
        let within = if self.from <= self.to {
            self.from < time && time <= self.to
        } else {
            self.to <= time && time < self.from
        };
        within || self.inclusive && time == self.from
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn span(start: f32, end: f32, repeat: Repeat) -> Span {
        Span::new([start, end], repeat, 10.0)
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
            assert_eq!(
                (travel.phase(), travel.turns, travel.at_end),
                (1.5, 0, false),
                "no turn within a pass, {repeat:?}"
            );
            let travel = span.travel(1.5, 0.5, true);
            assert_eq!(legs(&travel), [(2.5, 1.5, true)], "backwards from an inclusive start, {repeat:?}");
        }
    }

    #[test]
    fn a_wrap_passes_the_end_and_the_start() {
        let span = span(1.0, 3.0, Repeat::Loop);
        let travel = span.travel(1.5, 2.5, false);
        assert_eq!(legs(&travel), [(2.5, 3.0, false), (1.0, 1.5, true)], "a forward wrap has two stretches");
        assert_eq!((travel.phase(), travel.turns), (0.5, 1), "a forward wrap is one turn");
        let travel = span.travel(0.5, -0.5, false);
        assert_eq!(legs(&travel), [(1.5, 1.0, false), (3.0, 2.5, true)], "a backward wrap has two stretches");
        assert_eq!((travel.phase(), travel.turns), (1.5, 1), "a backward wrap is one turn");
        let arrived = span.travel(1.5, 2.0, false);
        assert_eq!((legs(&arrived).len(), arrived.turns), (2, 1), "arriving at the end is a turn");
        assert_eq!(span.travel(arrived.phase(), 0.5, false).turns, 0, "leaving the end is not a turn");
    }

    #[test]
    fn a_sought_end_of_a_loop_is_passed_before_the_other_end() {
        let span = span(1.0, 3.0, Repeat::Loop);
        let forwards = span.travel(2.0, 2.5, true);
        assert_eq!(legs(&forwards), [(3.0, 3.0, true), (1.0, 1.5, true)], "forwards from the end");
        assert_eq!(forwards.turns, 0, "leaving the sought end is not a turn");
        let backwards = span.travel(0.0, -0.5, true);
        assert_eq!(legs(&backwards), [(1.0, 1.0, true), (3.0, 2.5, true)], "backwards from the start");
        assert_eq!(legs(&span.travel(0.0, 0.5, true)), [(1.0, 1.5, true)], "forwards from the start is one stretch");
        assert_eq!(legs(&span.travel(2.0, 1.5, true)), [(3.0, 2.5, true)], "backwards from the end is one stretch");
        assert_eq!(
            legs(&span.travel(2.0, 2.5, false)),
            [(1.0, 1.5, false)],
            "an end that was already passed is not passed again"
        );
    }

    #[test]
    fn ping_pong_passes_each_end_once() {
        let span = span(1.0, 3.0, Repeat::PingPong);
        let travel = span.travel(1.5, 2.5, false);
        assert_eq!(legs(&travel), [(2.5, 3.0, false), (3.0, 2.5, false)], "a turn at the end has two stretches");
        assert_eq!((travel.turns, span.moment(travel.phase())), (1, (2.5, true)), "the pass after the end returns");
        let travel = span.travel(3.5, 4.5, false);
        assert_eq!(legs(&travel), [(1.5, 1.0, false), (1.0, 1.5, false)], "a turn at the start has two stretches");
        assert_eq!(span.moment(travel.phase()), (1.5, false), "the pass after the start does not return");
    }

    #[test]
    fn once_passes_an_end_when_it_enters_the_range_there() {
        let span = span(1.0, 3.0, Repeat::Once);
        assert_eq!(legs(&span.travel(-1.0, 0.5, false)), [(1.0, 1.5, true)], "entering at the start passes the start");
        assert_eq!(
            legs(&span.travel(3.0, 1.5, false)),
            [(3.0, 2.5, true)],
            "entering backwards at the end passes the end"
        );
        assert_eq!(legs(&span.travel(-2.0, -1.0, true)), [(1.0, 1.0, false)], "a step before the range passes no time");
        assert!(span.travel(1.5, 9.0, false).at_end, "forwards, playback ends at the out point");
        assert!(span.travel(0.5, -9.0, false).at_end, "backwards, playback ends at the in point");
    }

    #[test]
    fn a_huge_step_passes_the_whole_range_in_few_stretches() {
        for repeat in [Repeat::Once, Repeat::Loop, Repeat::PingPong] {
            let span = span(1.0, 3.0, repeat);
            for to in [1e6, -1e6, 1e300] {
                let travel = span.travel(0.0, to, true);
                assert!(
                    travel.legs().count() <= 5,
                    "{repeat:?} to {to} has at most 5 stretches, not {}",
                    travel.legs().count()
                );
                assert!((1.0..=3.0).contains(&span.moment(travel.phase()).0), "{repeat:?} to {to} ends in the range");
                let passed = |time| travel.legs().any(|leg| leg.passes(time));
                assert!(repeat.stops() || (passed(1.25) && passed(2.75)), "{repeat:?} to {to} passes the whole range");
            }
        }
    }

    proptest! {
        /// Every moment is passed exactly as often as it is played over, for any division of time into steps.
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
            // Phases, in the direction of play, at which the time is that of the mark.
            let shown: Vec<f64> = match repeat {
                Repeat::PingPong => vec![mark, 4.0 - mark],
                Repeat::Once | Repeat::Loop => vec![if backwards { 2.0 - mark } else { mark }],
            };
            let round = if repeat.turns_round() { 4.0 } else { 2.0 };
            let nearest = shown.iter().map(|s| ((played - s) / round - ((played - s) / round).round()).abs());
            // A mark within rounding error of the end of the sum is skipped.
            prop_assume!(nearest.fold(1.0, f64::min) > 1e-9);
            let expected: f64 = shown.iter().map(|s| ((played - s) / round).floor() + 1.0).sum();
            prop_assert_eq!(passed as f64, expected, "the mark is passed once for each time it is played over");
        }
    }
}
