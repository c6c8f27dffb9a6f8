//! Urgency: in which order files are fetched, and in which they are given up.
//!
//! In: the playheads of a capture, how far ahead files are fetched, a file. Out: its [`Urgency`], which is the same for
//! the same numbers: nothing here remembers earlier plans.

use super::course::{Axis, Course};
use super::playhead::Playhead;
use crate::scene::{ChunkFile, ChunkTable};
use std::cmp::Ordering;
use std::collections::BTreeSet;

/// A file is only given up for one that is more urgent by this many seconds, so that two files of about the same
/// urgency do not replace each other; for one of urgency 0, every file of a greater urgency is.
const HYSTERESIS: f64 = 0.5;

/// What the players of a capture need.
#[derive(Debug, Clone)]
pub(super) struct Demand {
    players: Vec<Player>,
    /// How far ahead files are fetched, seconds of playing.
    ahead: f64,
    /// Seconds that a file of each layer may come later.
    delays: Delays,
}

/// Seconds that a file of each layer may come later.
pub(super) type Delays = [f64; ChunkTable::MOST_LAYERS as usize];

/// Where a player goes, and how many seconds later than it gets there it may have what it needs.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Player {
    course: Course,
    delay: f64,
}

/// How soon a file is needed. The file that is fetched earlier, and given up later, is less.
#[derive(Debug, Clone, Copy)]
pub(super) struct Urgency {
    /// The number of the file.
    pub(super) file: usize,
    /// Whether a player reaches the file soon.
    pub(super) is_wanted: bool,
    /// Seconds until a player reaches the file; infinite if none does.
    reached_in: f64,
    /// The same with the delay of that player, and the seconds of the layer.
    next_use: f64,
    layer: u32,
}

impl Demand {
    /// Returns what players need that look ahead as many seconds of playing; files of each layer may come so much later.
    pub(super) fn new(heads: &[Playhead], axis: Axis, ahead: f64, delays: Delays) -> Self {
        // NaN counts as 0.
        let player = |head: &Playhead| Player { course: Course::new(head, axis), delay: head.delay.max(0.0) };
        let mut players: Vec<Player> = heads.iter().map(player).collect();
        // Those of a crowd that plays in step.
        players.dedup();
        Self { players, ahead, delays }
    }

    /// Returns the urgency of a file: that for the player that needs it first.
    pub(super) fn urgency(&self, file: usize, chunk: &ChunkFile) -> Urgency {
        let of_each = self.players.iter().map(|player| self.urgency_for(player, file, chunk));
        of_each.min().unwrap_or_else(|| self.urgency_in(f64::INFINITY, 0.0, file, chunk))
    }

    /// Returns the `count` most urgent files for each player, in the order of their urgency. `reached` are files that a
    /// player reaches on a way from one stretch to another, in the order in which the player does.
    pub(super) fn most_urgent<'a, F: Iterator<Item = (usize, &'a ChunkFile)>>(
        &self,
        count: usize,
        reached: impl Fn([u32; 2]) -> F,
    ) -> BTreeSet<Urgency> {
        let mut of_all = BTreeSet::new();
        for player in &self.players {
            let files = player.course.ways_within(self.ahead).flat_map(&reached);
            let urgencies = files.map(|(file, chunk)| self.urgency_for(player, file, chunk));
            of_all.append(&mut most_urgent(count, urgencies));
        }
        of_all
    }

    /// Returns the urgency of a file for one of the players.
    fn urgency_for(&self, player: &Player, file: usize, chunk: &ChunkFile) -> Urgency {
        self.urgency_in(player.course.seconds_until(chunk.stretches), player.delay, file, chunk)
    }

    /// Returns the urgency of a file that is reached in some seconds, by a player with some delay.
    fn urgency_in(&self, reached_in: f64, delay: f64, file: usize, chunk: &ChunkFile) -> Urgency {
        let layer = (chunk.layer as usize).min(self.delays.len() - 1);
        let next_use = reached_in + delay + self.delays[layer];
        Urgency { file, is_wanted: reached_in <= self.ahead, reached_in, next_use, layer: chunk.layer }
    }
}

/// Returns the `count` most urgent of some files, which are in the order in which a player reaches them, without a look
/// at those that are too far ahead.
fn most_urgent(count: usize, reached: impl IntoIterator<Item = Urgency>) -> BTreeSet<Urgency> {
    let mut found: BTreeSet<Urgency> = BTreeSet::new();
    for urgency in reached.into_iter().filter(|urgency| urgency.is_wanted) {
        match found.last() {
            Some(last) if found.len() >= count && urgency.reached_in > last.next_use => break,
            Some(last) if found.len() >= count && urgency >= *last => {}
            _ => {
                found.insert(urgency);
                if found.len() > count {
                    found.pop_last();
                }
            }
        }
    }
    found
}

impl Urgency {
    /// Returns the urgency in seconds, the smaller the sooner; infinite for a file that is not wanted.
    pub(super) fn seconds(&self) -> f64 {
        if self.is_wanted { self.next_use } else { f64::INFINITY }
    }

    /// Returns the least urgency of the files that may be given up for this one.
    pub(super) fn least_given_up(&self) -> f64 {
        // Layer 0 of now is worth all that is drawn later.
        if self.is_due() { f64::MIN_POSITIVE } else { self.seconds() + HYSTERESIS }
    }

    /// Returns whether the file is of layer 0 and drawn now.
    pub(super) fn is_due(&self) -> bool {
        self.next_use <= 0.0
    }
}

impl Ord for Urgency {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_use = self.next_use.total_cmp(&other.next_use);
        let by_place = self.layer.cmp(&other.layer).then(self.file.cmp(&other.file));
        other.is_wanted.cmp(&self.is_wanted).then(by_use).then(by_place)
    }
}

impl PartialOrd for Urgency {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Urgency {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Urgency {}

#[cfg(test)]
mod tests {
    use super::super::fixture::{even_delays, random_head, table};
    use super::super::intervals::Intervals;
    use super::super::playhead::Turn;
    use super::*;
    use crate::scene::random::Random;

    /// Four stretches of a second.
    fn demand(heads: &[(f64, f64)], ahead: f64) -> Demand {
        let heads: Vec<Playhead> = heads.iter().map(|(seconds, velocity)| head(*seconds, *velocity, 0.0)).collect();
        Demand::new(&heads, Axis::new(4.0, 4), ahead, even_delays(1.5))
    }

    fn head(seconds: f64, velocity: f64, delay: f64) -> Playhead {
        Playhead { seconds, velocity, range: [0.0, 4.0], turn: Turn::Stop, delay }
    }

    fn file(stretches: [u32; 2], layer: u32) -> ChunkFile {
        ChunkFile { stretches, layer, gaussians: 1, bytes: 1 }
    }

    #[test]
    fn a_layer_is_as_urgent_as_layer_0_a_second_and_a_half_later() {
        let demand = demand(&[(0.5, 1.0)], 10.0);
        let seconds = |first: u32, layer| demand.urgency(0, &file([first, 3], layer)).seconds();
        assert_eq!([seconds(0, 0), seconds(0, 1), seconds(0, 2), seconds(2, 1)], [0.0, 1.5, 3.0, 3.0], "urgencies");
        let fast = Demand::new(&[head(0.5, 1.0, 0.0)], Axis::new(4.0, 4), 10.0, even_delays(0.1));
        let seconds = |first: u32, layer| fast.urgency(0, &file([first, 3], layer)).seconds();
        assert!(seconds(0, 3) < seconds(1, 0), "over a fast link, all layers of now before the next stretch");
    }

    #[test]
    fn a_layer_of_little_utility_comes_after_the_first_layer_of_later() {
        let table = |utilities: &[f32]| ChunkTable { utilities: utilities.to_vec(), ..table(4, &[]) };
        let order = |utilities| {
            let delays = table(utilities).delays().map(|delay| 1.4 * delay);
            let demand = Demand::new(&[head(0.5, 1.0, 0.0)], Axis::new(4.0, 4), 10.0, delays);
            let files = [file([0, 0], 1), file([1, 1], 0), file([2, 2], 0)];
            let all: BTreeSet<Urgency> = (0..).zip(&files).map(|(number, file)| demand.urgency(number, file)).collect();
            all.into_iter().map(|urgency| urgency.file).collect::<Vec<_>>()
        };
        assert_eq!(order(&[]), [1, 0, 2], "not measured: 1.4 s later");
        assert_eq!(order(&[8.0, 6.0]), [0, 1, 2], "nearly the utility of layer 0");
        assert_eq!(order(&[8.0, 0.01]), [1, 2, 0], "hardly any");
    }

    #[test]
    fn the_player_that_needs_a_file_first_decides() {
        let both = demand(&[(0.5, 1.0), (3.5, -4.0)], 10.0);
        let seconds = |stretch| both.urgency(0, &file([stretch; 2], 0)).seconds();
        assert_eq!([0, 1, 2, 3].map(seconds), [0.0, 0.375, 0.125, 0.0], "minimum over the players");
        let nobody = demand(&[], 10.0);
        assert_eq!(nobody.urgency(0, &file([0, 3], 0)).seconds(), f64::INFINITY, "no player, no need");
    }

    #[test]
    fn a_player_with_a_delay_comes_after_the_others() {
        let delayed = |delay| {
            Demand::new(&[head(0.5, 0.0, delay), head(2.5, 1.0, 0.0)], Axis::new(4.0, 4), 0.0, even_delays(1.5))
        };
        let both = delayed(1e-3);
        let seconds = |stretch, layer| both.urgency(0, &file([stretch; 2], layer)).seconds();
        assert_eq!([seconds(0, 0), seconds(2, 0), seconds(2, 1)], [1e-3, 0.0, 1.5], "after layer 0 of the other");
        assert_eq!(seconds(1, 0), f64::INFINITY, "a delay reaches no further file");
        assert_eq!(both.urgency(0, &file([0, 2], 0)).seconds(), 0.0, "a file of both is as urgent as for the other");
        for none in [0.0, -1.0, f64::NAN] {
            let urgency = delayed(none).urgency(0, &file([0, 0], 0));
            assert_eq!(urgency.seconds(), 0.0, "a delay of {none} is none");
        }
    }

    #[test]
    fn a_file_replaces_those_that_are_clearly_less_urgent() {
        let demand = demand(&[(0.5, 1.0)], 1.0);
        let least = |stretch, layer| demand.urgency(0, &file([stretch; 2], layer)).least_given_up();
        assert_eq!([least(1, 0), least(0, 1)], [1.0, 2.0], "half a second later");
        assert!(least(0, 0) > 0.0 && least(0, 0) < 1e-9, "for layer 0 of now, all that is not");
        assert_eq!(least(3, 0), f64::INFINITY, "a file that is not wanted replaces those that are not");
    }

    #[test]
    fn a_file_that_is_not_reached_in_time_is_not_wanted_whatever_its_layer() {
        let demand = demand(&[(0.5, 1.0)], 1.5);
        let is_wanted = |stretch, layer| demand.urgency(0, &file([stretch; 2], layer)).is_wanted;
        assert!(is_wanted(2, 0) && is_wanted(2, 9), "reached in 1.5 s");
        assert!(!is_wanted(3, 0), "reached in 2.5 s");
    }

    #[test]
    fn files_are_in_the_order_of_their_need() {
        let demand = demand(&[(1.5, 1.0)], 1.0);
        // Not wanted: numbers 0 and 1, which are behind, and 2, which is reached in 1.5 s.
        let files = [file([0, 0], 1), file([0, 0], 0), file([3, 3], 0), file([1, 1], 1), file([2, 2], 0)];
        let further = [file([1, 3], 0), file([1, 1], 0)];
        let all = files.into_iter().chain(further).enumerate();
        let mut urgencies: Vec<Urgency> = all.map(|(number, file)| demand.urgency(number, &file)).collect();
        urgencies.sort_unstable();
        let order: Vec<usize> = urgencies.iter().map(|urgency| urgency.file).collect();
        assert_eq!(order, [5, 6, 4, 3, 2, 1, 0], "by urgency, then by next use, layer and number");
    }

    #[test]
    fn the_most_urgent_files_are_those_of_a_search_through_all() {
        let mut random = Random::new(3);
        for round in 0..500 {
            let stretches = 1 + random.below(12) as u32;
            let files: Vec<ChunkFile> = (0..random.below(40))
                .map(|_| {
                    let [a, b] = [(); 2].map(|()| random.below(stretches as usize) as u32);
                    file([a.min(b), a.max(b)], random.below(3) as u32)
                })
                .collect();
            let index = Intervals::new(files.iter().map(|file| file.stretches).enumerate());
            let heads: Vec<Playhead> = (0..random.below(4)).map(|_| random_head(&mut random, 4.0)).collect();
            let demand = Demand::new(
                &heads,
                Axis::new(4.0, stretches),
                f64::from(random.in_range(0.0, 6.0)),
                even_delays(random.in_range(0.0, 2.0).into()),
            );
            let all = files.iter().enumerate().map(|(number, file)| demand.urgency(number, file));
            let mut expected: Vec<Urgency> = all.filter(|urgency| urgency.is_wanted).collect();
            expected.sort_unstable();
            let count = random.below(6);
            let on_way = |[from, to]: [u32; 2]| index.along(from, to).map(|number| (number, &files[number]));
            let mut seen = BTreeSet::new();
            let first_of_each =
                demand.most_urgent(count, on_way).into_iter().filter(|urgency| seen.insert(urgency.file));
            let found: Vec<Urgency> = first_of_each.take(count).collect();
            assert_eq!(found, expected[..count.min(expected.len())], "round {round}: {files:?} for {heads:?}");
        }
    }

    #[test]
    fn files_that_are_too_far_ahead_are_not_looked_at() {
        let demand = demand(&[(0.5, 1.0)], 10.0);
        let mut looked = 0;
        let reached = [(0, 1), (1, 0), (2, 0), (3, 0), (3, 1)].into_iter().map(|(stretch, layer)| {
            looked += 1;
            demand.urgency(stretch as usize, &file([stretch; 2], layer))
        });
        let found: Vec<usize> = most_urgent(2, reached).into_iter().map(|urgency| urgency.file).collect();
        // Urgencies: 1.5, 0.5, 1.5, 2.5 s.
        assert_eq!((found, looked), (vec![1, 2], 4), "the last file is not looked at");
        assert_eq!(most_urgent(0, [demand.urgency(0, &file([0, 0], 0))]).len(), 0, "no file");
    }

    #[test]
    fn players_in_step_count_once() {
        assert_eq!(demand(&[(0.5, 1.0); 9], 1.0).players.len(), 1, "nine players at one time");
    }
}
