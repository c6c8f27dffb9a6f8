//! The schedule of a stream: which files are fetched next, and which are given up for them.
//!
//! In: a [`ChunkTable`], and at each call of [`StreamSchedule::plan`] the players and the limits; arrivals and failures
//! between the calls. Out: a [`StreamPlan`]; what is there.

use super::course::{Axis, Course};
use super::coverage::Coverage;
use super::deadlines::Deadlines;
use super::giving_up::files_to_give_up;
use super::intervals::Intervals;
use super::ledger::{FileState, Ledger};
use super::limits::StreamLimits;
use super::playhead::Playhead;
use super::retries::Retries;
use super::urgency::{Delays, Demand, Urgency};
use crate::scene::ChunkTable;
use std::collections::BTreeSet;
use std::sync::Arc;

/// What a host does next. No file is in both lists.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct StreamPlan {
    /// Files to fetch, the most urgent first.
    pub fetch: Vec<usize>,
    /// Files to free, and files on the way to fetch no further.
    pub give_up: Vec<usize>,
}

/// The chunk files of a capture: which are there, which are on the way, and which come next.
///
/// A file is known by its number in the table. Every method also works with tables that
/// [`check`](ChunkTable::check) refuses, and with numbers of files that are not there: such files are absent.
///
/// # Examples
///
/// ```
/// use bevy_gs4d::codec::stream::{Playhead, StreamLimits, StreamSchedule, Turn};
/// use bevy_gs4d::scene::{ChunkFile, ChunkTable};
///
/// // One file of all the time, and one for each of four stretches of 2 seconds.
/// let file = |first, last| ChunkFile { stretches: [first, last], layer: 0, gaussians: 1000, bytes: 24_000 };
/// let files = vec![file(0, 3), file(0, 0), file(1, 1), file(2, 2), file(3, 3)];
/// let table = ChunkTable { stretches: 4, gaussian_bytes: 80, files, utilities: Vec::new(), first_byte: None };
/// let mut schedule = StreamSchedule::new(table.into(), 8.0);
///
/// let head = Playhead { seconds: 3.0, velocity: 1.0, range: [0.0, 8.0], turn: Turn::Loop, delay: 0.0 };
/// let limits = StreamLimits { requests: 3, ..StreamLimits::default() };
/// let plan = schedule.plan(0.0, &[head], &limits);
/// assert_eq!(plan.fetch, [0, 2, 3], "what is needed now, and then what is needed next");
/// for file in plan.fetch {
///     schedule.arrived(file);
/// }
/// assert!(schedule.coverage(3.0).is_whole(), "the picture at 3 s has all of its Gaussians");
/// assert_eq!(schedule.buffered(&head), 3.0, "until 6 s");
/// ```
#[derive(Debug, Clone)]
pub struct StreamSchedule {
    axis: Axis,
    ledger: Ledger,
    retries: Retries,
    deadlines: Deadlines,
    /// All files.
    files: Intervals,
    /// The files of layer 0.
    coarse: Intervals,
    /// The latest time of the host's clock, in seconds.
    now: f64,
    /// Bytes of all files, and of the longest.
    all_bytes: u64,
    longest: u64,
    /// How much later each layer may come.
    delays: Delays,
}

impl StreamSchedule {
    /// Returns the schedule of a capture that lasts `duration` seconds, of which no file is there.
    pub fn new(table: Arc<ChunkTable>, duration: f64) -> Self {
        let files = || table.files.iter().enumerate();
        Self {
            axis: Axis::new(duration, table.stretches),
            retries: Retries::default(),
            deadlines: Deadlines::default(),
            files: Intervals::new(files().map(|(number, file)| (number, file.stretches))),
            coarse: Intervals::new(
                files().filter(|(_, file)| file.layer == 0).map(|(number, file)| (number, file.stretches)),
            ),
            now: 0.0,
            all_bytes: table.bytes_up_to(ChunkTable::MOST_LAYERS),
            longest: table.files.iter().map(|file| file.bytes).max().unwrap_or(0),
            delays: table.delays(),
            ledger: Ledger::new(table),
        }
    }

    /// Returns the same schedule for a host that keeps files in whole pages of [`ChunkTable::PAGE`] Gaussians on the
    /// GPU, as the renderer does: there, each file counts with [`ChunkTable::page_bytes`] in place of
    /// [`ChunkTable::gpu_bytes`]. No file is there.
    pub fn in_pages(self) -> Self {
        let ledger = Ledger::in_pages(self.table().clone());
        Self { ledger, ..self }
    }

    /// Returns the table of the files.
    pub fn table(&self) -> &Arc<ChunkTable> {
        self.ledger.table()
    }

    /// Returns the length of the capture in seconds.
    pub fn duration(&self) -> f64 {
        self.axis.duration()
    }

    /// Decides what to fetch and what to give up, and counts the files to fetch as on the way and those to give up as
    /// absent. `now` is in seconds of any clock that does not go back. Without a player nothing is fetched, and what is
    /// there stays.
    ///
    /// A file is fetched if a player reaches it within [`StreamLimits::ahead`] seconds. If the next file does not find
    /// room, those after it wait, too, except for a file that is larger than all memory on the GPU, which is left out.
    /// While a file of more than [`StreamLimits::long_bytes`] is on its way, other such files wait, unless they are of
    /// layer 0 and drawn now; shorter ones do not wait. Requests that no player needs any more are given up, so that
    /// nothing waits for them after a jump in time. Those that have taken 30 s, and a second more for each 32 KiB of the
    /// file, are given up and count as [failed](Self::failed).
    pub fn plan(&mut self, now: f64, heads: &[Playhead], limits: &StreamLimits) -> StreamPlan {
        self.pass_time(now);
        let delays = self.delays.map(|delay| delay * limits.seconds_of_layer());
        let demand = Demand::new(heads, self.axis, limits.ahead_seconds(), delays);
        let mut plan = StreamPlan::default();
        let requested = self.ledger.requested().iter().copied();
        let overdue: Vec<usize> = requested.filter(|file| self.is_overdue(*file)).collect();
        for file in overdue {
            self.failed(file, self.now);
            plan.give_up.push(file);
        }
        let requested = self.ledger.requested().iter().copied();
        let stale: Vec<usize> = requested.filter(|file| !self.is_of_use(*file, &demand, limits)).collect();
        for file in stale {
            self.ledger.end_request(file);
            plan.give_up.push(file);
        }
        let candidates = self.candidates(&demand, limits);
        let mut last_needed_first = None;
        let over = self.ledger.gpu_bytes().saturating_sub(limits.gpu_bytes);
        if over > 0 {
            let ranked = last_needed_first.get_or_insert_with(|| self.last_needed_first(&demand));
            // Requests alone may be too large for a limit that has shrunk.
            let all = || self.ledger.resident().iter().copied().collect();
            let given_up = self.files_to_give_up(ranked, over, 0.0).unwrap_or_else(all);
            self.give_up(given_up, &mut plan);
        }
        for urgency in candidates {
            let file = urgency.file;
            // This plan fetches the file, or another long one, for another player.
            let is_second_long = self.is_long(file, limits) && self.has_long_request(limits) && !urgency.is_due();
            if self.state(file) == FileState::Requested || is_second_long {
                continue;
            }
            if self.requested() >= limits.requests || !self.ledger.has_host_room(file, limits.host_bytes) {
                break;
            }
            let room = limits.gpu_bytes.saturating_sub(self.ledger.gpu_bytes());
            let excess = self.gpu_bytes_of(file).saturating_sub(room);
            if excess > 0 {
                let ranked = last_needed_first.get_or_insert_with(|| self.last_needed_first(&demand));
                let Some(given_up) = self.files_to_give_up(ranked, excess, urgency.least_given_up()) else {
                    break;
                };
                self.give_up(given_up, &mut plan);
            }
            self.ledger.request(file);
            self.deadlines.begin(file, self.now);
            plan.fetch.push(file);
        }
        plan
    }

    /// Notes that a file is there. Returns whether it counts: a file that lands after it was given up is to be freed.
    pub fn arrived(&mut self, file: usize) -> bool {
        let counts = self.ledger.arrive(file);
        if counts {
            self.retries.arrive(file);
        }
        counts
    }

    /// Notes that a file on the way could not be fetched. It is asked for again after 0.25 s, and after each further
    /// failure in a row after twice the time, at most 8 s. A file that has been given up is ignored. `now` is as in
    /// [`plan`](Self::plan).
    pub fn failed(&mut self, file: usize, now: f64) {
        self.pass_time(now);
        if self.ledger.end_request(file) {
            self.retries.fail(file, self.now);
        }
    }

    /// Returns the state of a file.
    pub fn state(&self, file: usize) -> FileState {
        self.ledger.state(file)
    }

    /// Returns the files that have Gaussians of a time, in seconds since the capture's start, in ascending order.
    pub fn needed_at(&self, seconds: f64) -> impl Iterator<Item = usize> + use<> {
        let mut needed = self.files.containing(self.axis.stretch_at(seconds));
        needed.sort_unstable();
        needed.into_iter()
    }

    /// Returns how much of what is drawn at a time is there. Seconds since the capture's start.
    pub fn coverage(&self, seconds: f64) -> Coverage {
        let with_state = |number| Some((self.table().files.get(number)?, self.state(number) == FileState::Resident));
        Coverage::of(self.needed_at(seconds).filter_map(with_state))
    }

    /// Returns for how many seconds of playing from now on every file of layer 0 is there, at most for one pass: until
    /// every time of the range has been played.
    pub fn buffered(&self, head: &Playhead) -> f64 {
        let course = Course::new(head, self.axis);
        let mut entered = course.ways_within(f64::INFINITY).flat_map(|[from, to]| self.coarse.along(from, to));
        let missing = entered.find(|file| self.state(*file) != FileState::Resident);
        let until = missing.and_then(|file| self.table().files.get(file)).map(|file| file.stretches);
        until.map_or(f64::INFINITY, |stretches| course.seconds_until(stretches)).min(course.seconds())
    }

    /// Returns how many bytes per second the players need, with all layers: each file once.
    pub fn bytes_per_second(&self, heads: &[Playhead]) -> f64 {
        let speed = heads.iter().map(|head| head.velocity.abs()).fold(1.0, f64::max);
        self.all_bytes as f64 / self.duration() * speed
    }

    /// Returns whether about all that is so many seconds ahead of a player, and as much behind it, has room in so many bytes
    /// on the GPU.
    pub fn has_room(&self, gpu_bytes: u64, ahead: f64) -> bool {
        let share = (2.0 * ahead / self.duration()).min(1.0);
        self.ledger.all_gpu_bytes() as f64 * share <= gpu_bytes as f64
    }

    /// Returns the bytes on the GPU of the Gaussians of files that are there or on the way.
    pub fn gpu_bytes(&self) -> u64 {
        self.ledger.gpu_bytes()
    }

    /// Returns the bytes of a file on the GPU, in whole pages if the host [keeps files in pages](Self::in_pages); 0 for
    /// a file that the table does not have.
    pub fn gpu_bytes_of(&self, file: usize) -> u64 {
        self.ledger.gpu_bytes_of(file)
    }

    /// Returns the bytes in memory of files on the way: the files, and their Gaussians.
    pub fn host_bytes(&self) -> u64 {
        self.ledger.host_bytes()
    }

    /// Returns the number of files on the way.
    pub fn requested(&self) -> usize {
        self.ledger.requested().len()
    }

    /// Returns the number of files that are there.
    pub fn resident(&self) -> usize {
        self.ledger.resident().len()
    }

    /// Returns the number of requests that have failed.
    pub fn failures(&self) -> u64 {
        self.retries.failures()
    }

    /// Returns the number of requests of a file that have failed since it last arrived.
    pub fn failures_in_a_row(&self, file: usize) -> u32 {
        self.retries.in_a_row(file)
    }

    /// Returns whether the last request of a file has failed, and it is too early for the next.
    pub fn waits(&self, file: usize) -> bool {
        self.retries.waits(file, self.now)
    }

    fn pass_time(&mut self, now: f64) {
        if now.is_finite() {
            self.now = self.now.max(now);
        }
    }

    /// Returns the urgency of a file; `None` if the table does not have the file.
    fn urgency(&self, file: usize, demand: &Demand) -> Option<Urgency> {
        self.table().files.get(file).map(|chunk| demand.urgency(file, chunk))
    }

    /// Returns whether a file on the way has taken too long.
    fn is_overdue(&self, file: usize) -> bool {
        let bytes = self.table().files.get(file).map_or(0, |chunk| chunk.bytes);
        self.deadlines.is_over(file, bytes, self.now)
    }

    /// Returns whether a file on the way is of use: a player reaches it, and it has room.
    fn is_of_use(&self, file: usize, demand: &Demand, limits: &StreamLimits) -> bool {
        let is_reached = self.urgency(file, demand).is_some_and(|urgency| urgency.is_wanted);
        is_reached && self.gpu_bytes_of(file) <= limits.gpu_bytes
    }

    /// Returns whether a file is longer than [`StreamLimits::long_bytes`].
    fn is_long(&self, file: usize, limits: &StreamLimits) -> bool {
        self.table().files.get(file).is_some_and(|chunk| chunk.bytes > limits.long_bytes)
    }

    /// Returns whether a long file is on its way.
    fn has_long_request(&self, limits: &StreamLimits) -> bool {
        self.ledger.requested().iter().any(|file| self.is_long(*file, limits))
    }

    /// Returns the files that may be fetched, the most urgent first: of long ones the first of each player, while one is
    /// on its way only if it is of layer 0 and drawn now. A file that several players need may occur more than once.
    fn candidates(&self, demand: &Demand, limits: &StreamLimits) -> BTreeSet<Urgency> {
        let count = limits.requests.saturating_sub(self.requested());
        if count == 0 {
            return BTreeSet::new();
        }
        let may_be_fetched = |file: &usize| {
            let is_absent = self.state(*file) == FileState::Absent;
            is_absent && self.gpu_bytes_of(*file) <= limits.gpu_bytes && !self.waits(*file)
        };
        let most_urgent = |count: usize, are_long: bool| {
            demand.most_urgent(count, |[from, to]| {
                let alike = self.files.along(from, to).filter(move |file| self.is_long(*file, limits) == are_long);
                alike.filter(may_be_fetched).filter_map(|file| Some((file, self.table().files.get(file)?)))
            })
        };
        let mut candidates = most_urgent(count, false);
        if self.longest > limits.long_bytes {
            let has_long_request = self.has_long_request(limits);
            let long = most_urgent(1, true).into_iter();
            candidates.extend(long.filter(|urgency| !has_long_request || urgency.is_due()));
        }
        candidates
    }

    /// Returns the files that are there, the one that is needed last first.
    fn last_needed_first(&self, demand: &Demand) -> Vec<Urgency> {
        let resident = self.ledger.resident().iter();
        let mut ranked: Vec<Urgency> = resident.filter_map(|file| self.urgency(*file, demand)).collect();
        ranked.sort_unstable_by(|a, b| b.cmp(a));
        ranked
    }

    /// Returns the files to give up to free `excess` bytes on the GPU: of those that were there when `ranked` was made
    /// and still are, and whose urgency is at least `least`. `None` if these are not enough.
    fn files_to_give_up(&self, ranked: &[Urgency], excess: u64, least: f64) -> Option<Vec<usize>> {
        let later = ranked.iter().take_while(|urgency| urgency.seconds() >= least).map(|urgency| urgency.file);
        let there = later.filter(|file| self.state(*file) == FileState::Resident);
        files_to_give_up(there.map(|file| (file, self.gpu_bytes_of(file))), excess)
    }

    /// Gives up files that are there.
    fn give_up(&mut self, files: Vec<usize>, plan: &mut StreamPlan) {
        for file in files {
            self.ledger.remove(file);
            plan.give_up.push(file);
        }
    }
}
