//! The course of a player: the stretches of time that it plays from now on.
//!
//! In: a [`Playhead`], and the [`Axis`] of the capture. Out: a [`Course`], which ends when every time of the range has
//! been played: what is played after that has been played before.
//!
//! ```text
//!          start                       end
//!            │        now ────────────▶ │   first leg
//!  Loop:     │ ─────▶                   │   second leg
//!  Return:   │ ◀─────────────────────── │   second leg
//! ```
//!
//! A *place* is a time in units of stretches: place 2.5 is the middle of stretch 2.

use super::playhead::{Playhead, Turn};

/// The bounds of a speed, stretches per second: quotients and products with it are finite.
const SPEEDS: [f64; 2] = [1e-300, 1e300];
/// Times may be rounded by so much, in stretches: that of an hour in single precision, in stretches of a third of a
/// second.
const ROUNDING: f64 = 1e-3;

/// The time of a capture: its length, and the stretches into which it is cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    duration: f64,
    stretches: u32,
}

/// What a player plays until every time of its range has been played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Course {
    /// Stretches per second.
    speed: f64,
    first: Leg,
    second: Option<Leg>,
}

/// A part of a course in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    /// The length of the course before the leg, in stretches.
    lead: f64,
    /// The first and the last place; the last is less if the leg is played backwards.
    places: [f64; 2],
    /// The first and the last stretch.
    stretches: [u32; 2],
}

/// A place, and the stretch that is played there.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    place: f64,
    stretch: u32,
}

impl Axis {
    /// Returns the axis of a capture that lasts `duration` seconds. A length that is not positive and finite is that of
    /// a still, all of which is in the first stretch.
    pub(super) fn new(duration: f64, stretches: u32) -> Self {
        Self { duration: if duration.is_finite() { duration.max(0.0) } else { 0.0 }, stretches: stretches.max(1) }
    }

    /// Returns the length of the capture in seconds.
    pub(super) fn duration(self) -> f64 {
        self.duration
    }

    /// Returns the stretch of a time in seconds.
    pub(super) fn stretch_at(self, seconds: f64) -> u32 {
        self.point(self.place(seconds)).stretch
    }

    /// Returns the place of a time in seconds, within the capture.
    fn place(self, seconds: f64) -> f64 {
        let share = if self.duration > 0.0 { seconds / self.duration } else { 0.0 };
        let place = share * f64::from(self.stretches);
        if place.is_nan() { 0.0 } else { place.clamp(0.0, f64::from(self.stretches)) }
    }

    /// Returns a place with its stretch.
    fn point(self, place: f64) -> Point {
        Point { place, stretch: (place as u32).min(self.stretches - 1) }
    }

    /// Returns the same place with the stretch that ends there, if one does.
    fn before(self, point: Point) -> Point {
        Point { stretch: self.point(point.place - ROUNDING).stretch, ..point }
    }

    /// Returns the speed in stretches per second at which a player comes along.
    fn speed(self, velocity: f64) -> f64 {
        let velocity = if velocity.is_nan() || velocity == 0.0 { 1.0 } else { velocity.abs() };
        let [slowest, fastest] = SPEEDS;
        (velocity * f64::from(self.stretches) / self.duration).clamp(slowest, fastest)
    }
}

impl Course {
    /// Returns the course of a player.
    pub(super) fn new(head: &Playhead, axis: Axis) -> Self {
        let is_backward = head.velocity < 0.0;
        let speed = axis.speed(head.velocity);
        let now = axis.point(axis.place(head.seconds));
        let [start, end] = head.range.map(|seconds| axis.point(axis.place(seconds)));
        if start.place >= end.place {
            return Self { speed, first: Leg::new(now, now, 0.0), second: None };
        }
        // The end of a loop is its start.
        let end = if head.turn == Turn::Loop { axis.before(end) } else { end };
        let [begin, target] = if is_backward { [end, start] } else { [start, end] };
        // A player beyond its target turns at once.
        let is_beyond = if is_backward { now.place <= target.place } else { now.place >= target.place };
        let first = Leg::new(now, if is_beyond { now } else { target }, 0.0);
        let lead = first.length();
        let rest = end.place - start.place - lead;
        let second = match head.turn {
            Turn::Loop if is_beyond => Some([begin, target]),
            Turn::Loop if rest > 0.0 => {
                let place = if is_backward { begin.place - rest } else { begin.place + rest };
                Some([begin, axis.point(place)])
            }
            Turn::Stop | Turn::Loop => None,
            Turn::Return => Some([target, begin]),
        };
        Self { speed, first, second: second.map(|[from, to]| Leg::new(from, to, lead)) }
    }

    /// Returns the seconds until the player reaches a file, given its first and last stretch: 0 if the file is drawn
    /// now, infinite if the player never reaches it.
    pub(super) fn seconds_until(&self, file: [u32; 2]) -> f64 {
        self.legs().map(|leg| leg.distance(file)).fold(f64::INFINITY, f64::min) / self.speed
    }

    /// Returns the length of the course in seconds.
    pub(super) fn seconds(&self) -> f64 {
        self.legs().map(Leg::length).sum::<f64>() / self.speed
    }

    /// Returns the stretches that the player plays within some seconds, in the order of play: the first and the last of
    /// each leg.
    pub(super) fn ways_within(&self, seconds: f64) -> impl Iterator<Item = [u32; 2]> {
        let distance = seconds * self.speed;
        self.legs().filter_map(move |leg| leg.way_within(distance))
    }

    fn legs(&self) -> impl Iterator<Item = &Leg> {
        std::iter::once(&self.first).chain(&self.second)
    }
}

impl Leg {
    /// Returns the leg between two points.
    fn new(from: Point, to: Point, lead: f64) -> Self {
        // The stretch of an end of a loop may be behind the player.
        let last = if to.place < from.place { to.stretch.min(from.stretch) } else { to.stretch.max(from.stretch) };
        Self { lead, places: [from.place, to.place], stretches: [from.stretch, last] }
    }

    /// Returns its length in stretches.
    fn length(&self) -> f64 {
        let [from, to] = self.places;
        (to - from).abs()
    }

    fn is_backward(&self) -> bool {
        let [from, to] = self.places;
        to < from
    }

    /// Returns how much of the course is played before the leg reaches a file, in stretches; infinite if the leg does
    /// not.
    fn distance(&self, [first, last]: [u32; 2]) -> f64 {
        let [a, b] = self.stretches;
        if last < a.min(b) || first > a.max(b) {
            return f64::INFINITY;
        }
        let [from, _] = self.places;
        let way = if self.is_backward() { from - (f64::from(last) + 1.0) } else { f64::from(first) - from };
        // Negative within the file.
        self.lead + way.max(0.0)
    }

    /// Returns the first and the last stretch of the leg within a distance from the beginning of the course; `None` if
    /// the leg begins beyond it.
    fn way_within(&self, distance: f64) -> Option<[u32; 2]> {
        let (left, [from, _], [first, last]) = (distance - self.lead, self.places, self.stretches);
        let is_reached = left >= 0.0;
        is_reached.then(|| match self.is_backward() {
            true => [first, ((from - left).max(0.0) as u32).clamp(last, first)],
            false => [first, ((from + left) as u32).clamp(first, last)],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::random_head;
    use super::*;
    use crate::scene::ChunkTable;
    use crate::scene::random::Random;

    /// Eight stretches of half a second.
    const AXIS: Axis = Axis { duration: 4.0, stretches: 8 };

    fn head(seconds: f64, velocity: f64, range: [f64; 2], turn: Turn) -> Playhead {
        Playhead { seconds, velocity, range, turn, delay: 0.0 }
    }

    /// Returns the seconds until each of the eight stretches.
    fn seconds(head: &Playhead) -> [f64; 8] {
        let course = Course::new(head, AXIS);
        std::array::from_fn(|stretch| course.seconds_until([stretch as u32; 2]))
    }

    const NEVER: f64 = f64::INFINITY;

    #[test]
    fn a_player_that_stops_needs_nothing_behind_it() {
        let forwards = seconds(&head(1.25, 1.0, [0.0, 3.0], Turn::Stop));
        assert_eq!(forwards, [NEVER, NEVER, 0.0, 0.25, 0.75, 1.25, 1.75, NEVER], "the picture of the end stays");
        let backwards = seconds(&head(1.25, -0.5, [0.5, 3.0], Turn::Stop));
        assert_eq!(backwards, [NEVER, 0.5, 0.0, NEVER, NEVER, NEVER, NEVER, NEVER], "backwards at half the speed");
    }

    #[test]
    fn a_loop_goes_on_at_its_start() {
        let forwards = seconds(&head(2.25, 1.0, [1.0, 3.0], Turn::Loop));
        for (stretch, expected) in [NEVER, NEVER, 0.75, 1.25, 0.0, 0.25, NEVER, NEVER].into_iter().enumerate() {
            let found = forwards[stretch];
            assert!(found == expected || (found - expected).abs() < 1e-12, "stretch {stretch} is needed in {found}");
        }
        let backwards = seconds(&head(1.25, -2.0, [1.0, 3.0], Turn::Loop));
        for (stretch, expected) in [NEVER, NEVER, 0.0, 0.625, 0.375, 0.125, NEVER, NEVER].into_iter().enumerate() {
            let found = backwards[stretch];
            assert!(found == expected || (found - expected).abs() < 1e-12, "stretch {stretch} is needed in {found}");
        }
    }

    #[test]
    fn a_loop_that_ends_where_a_stretch_begins_does_not_need_that_stretch_ahead() {
        let range = [1.0, 3.0002];
        for (velocity, next) in [(1.0, 2), (-1.0, 5)] {
            let ahead = seconds(&head(2.25, velocity, range, Turn::Loop));
            assert_eq!([ahead[4], ahead[6]], [0.0, NEVER], "velocity {velocity}: 0.2 ms of the stretch are left out");
            let there = head(3.0001, velocity, range, Turn::Loop);
            let now = seconds(&there);
            assert!(now[6] == 0.0 && now[next] < 0.001, "velocity {velocity}: a player in that stretch: {now:?}");
            let course = Course::new(&there, AXIS);
            assert!(course.ways_within(0.1).next().is_some(), "velocity {velocity}: the stretch of now");
        }
    }

    #[test]
    fn a_player_that_returns_needs_what_is_behind_it_later() {
        let forwards = seconds(&head(2.25, 1.0, [1.0, 2.75], Turn::Return));
        assert_eq!(forwards, [NEVER, NEVER, 1.75, 1.25, 0.0, 0.25, NEVER, NEVER], "0.5 s to the end, and back");
        let backwards = seconds(&head(2.25, -1.0, [1.0, 2.75], Turn::Return));
        assert_eq!(backwards, [NEVER, NEVER, 0.75, 0.25, 0.0, 2.75, NEVER, NEVER], "1.25 s to the start, and back");
    }

    #[test]
    fn a_paused_player_counts_as_one_that_plays_forwards() {
        let range = [0.5, 3.0];
        for turn in [Turn::Stop, Turn::Loop, Turn::Return] {
            let playing = seconds(&head(1.0, 1.0, range, turn));
            for velocity in [0.0, -0.0, f64::NAN] {
                assert_eq!(seconds(&head(1.0, velocity, range, turn)), playing, "velocity {velocity}, {turn:?}");
            }
        }
    }

    #[test]
    fn a_player_in_an_empty_range_needs_its_time_alone() {
        for range in [[2.0, 2.0], [3.0, 1.0], [9.0, 99.0], [f64::NAN; 2]] {
            for turn in [Turn::Stop, Turn::Loop, Turn::Return] {
                let needed = seconds(&head(1.25, 1.0, range, turn));
                let expected = [NEVER, NEVER, 0.0, NEVER, NEVER, NEVER, NEVER, NEVER];
                assert_eq!(needed, expected, "{range:?}, {turn:?}");
            }
        }
    }

    #[test]
    fn a_player_outside_of_its_range_plays_into_it() {
        let before = seconds(&head(0.25, 1.0, [1.0, 2.0], Turn::Stop));
        assert_eq!(before, [0.0, 0.25, 0.75, 1.25, 1.75, NEVER, NEVER, NEVER], "before the range");
        let beyond = seconds(&head(3.25, 1.0, [1.0, 2.0], Turn::Loop));
        assert_eq!(beyond, [NEVER, NEVER, 0.0, 0.5, NEVER, NEVER, 0.0, NEVER], "beyond the range it starts over");
    }

    #[test]
    fn a_file_of_several_stretches_is_needed_from_the_first_that_is_reached() {
        let course = Course::new(&head(1.25, 1.0, [0.0, 4.0], Turn::Stop), AXIS);
        let files = [[0, 7], [0, 1], [2, 2], [4, 7], [1, 3]];
        assert_eq!(files.map(|file| course.seconds_until(file)), [0.0, NEVER, 0.0, 0.75, 0.0], "forwards");
        let course = Course::new(&head(1.25, -1.0, [0.0, 4.0], Turn::Stop), AXIS);
        assert_eq!(files.map(|file| course.seconds_until(file)), [0.0, 0.25, 0.0, NEVER, 0.0], "backwards");
    }

    #[test]
    fn the_length_of_a_course_is_that_of_one_pass() {
        let seconds = |velocity, turn| Course::new(&head(1.25, velocity, [1.0, 3.0], turn), AXIS).seconds();
        assert_eq!([seconds(1.0, Turn::Stop), seconds(-1.0, Turn::Stop)], [1.75, 0.25], "to the end");
        assert!((seconds(2.0, Turn::Loop) - 1.0).abs() < 1e-12, "once through the range at double speed");
        assert_eq!(seconds(1.0, Turn::Return), 3.75, "to the end, and through the range");
    }

    /// A simulation in small steps finds the same.
    #[test]
    fn the_seconds_until_a_file_are_those_of_a_player_in_small_steps() {
        const STEP: f64 = 1.0 / 256.0;
        let (mut random, mut simulated) = (Random::new(4), 0);
        for _ in 0..400 {
            let head = Playhead { velocity: [-1.0, 1.0][random.below(2)], ..random_head(&mut random, 4.0) };
            let [start, end] = head.range.map(|bound| bound.clamp(0.0, 4.0));
            // A stretch that the range only touches may be drawn for less than a step.
            let touches = |bound: f64| bound % 4.0 != 0.0 && (2.0 * bound - (2.0 * bound).round()).abs() < 0.05;
            if end - start < 0.1 || !(start..=end).contains(&head.seconds) || touches(start) || touches(end) {
                continue;
            }
            simulated += 1;
            let course = Course::new(&head, AXIS);
            let (mut place, mut direction, mut found) = (head.seconds, head.velocity, [NEVER; 8]);
            for step in 0..(12.0 / STEP) as u32 {
                let seconds = &mut found[AXIS.stretch_at(place) as usize];
                *seconds = seconds.min(f64::from(step) * STEP);
                place += direction * STEP;
                let beyond = if direction > 0.0 { place - end } else { start - place };
                if beyond >= 0.0 {
                    match head.turn {
                        Turn::Stop => place = place.clamp(start, end),
                        Turn::Loop => place -= direction * (end - start),
                        Turn::Return => {
                            place = (place - 2.0 * direction * beyond).clamp(start, end);
                            direction = -direction;
                        }
                    }
                }
            }
            for (stretch, found) in found.into_iter().enumerate() {
                let seconds = course.seconds_until([stretch as u32; 2]);
                let is_same = seconds == found || (seconds - found).abs() <= 3.0 * STEP;
                assert!(is_same, "{head:?}: stretch {stretch} is needed in {seconds}, not {found}");
            }
        }
        assert!(simulated > 50, "most players were left out: {simulated} were simulated");
    }

    #[test]
    fn the_stretches_within_some_seconds_are_those_whose_files_are_reached() {
        let mut random = Random::new(6);
        for _ in 0..2000 {
            let head = random_head(&mut random, 4.0);
            let course = Course::new(&head, AXIS);
            let ahead = f64::from(random.in_range(0.0, 5.0));
            let within: Vec<[u32; 2]> = course.ways_within(ahead).collect();
            for stretch in 0..8 {
                let is_on = |[from, to]: &[u32; 2]| (*from.min(to)..=*from.max(to)).contains(&stretch);
                let is_within = within.iter().any(is_on);
                let seconds = course.seconds_until([stretch; 2]);
                let is_close = (seconds - ahead).abs() < 1e-9 * (1.0 + ahead);
                assert!(is_within == (seconds <= ahead) || is_close, "{head:?}: {stretch} in {seconds}, {within:?}");
            }
        }
    }

    #[test]
    fn numbers_without_sense_have_a_course() {
        let wild = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 5e-324, 1e308, -1e308, 1.0, 1e-300];
        for duration in wild {
            for stretches in [0, 1, 10_000, u32::MAX] {
                let axis = Axis::new(duration, stretches);
                for (a, b) in wild.iter().flat_map(|a| wild.iter().map(move |b| (*a, *b))) {
                    for turn in [Turn::Stop, Turn::Loop, Turn::Return] {
                        let head = head(a, b, [b, a], turn);
                        let course = Course::new(&head, axis);
                        let [now, length] = [course.seconds_until([axis.stretch_at(a); 2]), course.seconds()];
                        assert_eq!(now, 0.0, "{head:?} on {axis:?}: the present is needed now");
                        assert!(length >= 0.0, "{head:?} on {axis:?} has a length: {length}");
                        let within = [0.0, f64::INFINITY].map(|ahead| course.ways_within(ahead).count());
                        assert!(within[0] >= 1 && within[1] <= 2, "{head:?} on {axis:?}: {within:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn times_have_the_stretches_of_the_table() {
        let mut random = Random::new(2);
        for _ in 0..2000 {
            let duration = f64::from(random.in_range(-0.1, 3.0));
            let stretches = 1 + random.below(500) as u32;
            let seconds = f64::from(random.in_range(-1.0, 4.0));
            let table =
                ChunkTable { stretches, gaussian_bytes: 1, files: Vec::new(), utilities: Vec::new(), first_byte: None };
            let [own, of_table] =
                [Axis::new(duration, stretches).stretch_at(seconds), table.stretch_at(seconds, duration)];
            assert_eq!(own, of_table, "{seconds} s of {duration} s in {stretches} stretches");
        }
    }
}
