//! A test of streaming in random steps.
//!
//! In: random tables, players that play, jump and come and go, limits that shrink and grow, files that arrive in any
//! order, late or not at all, with and without pages. Out: proof that the rules hold at every step, and that all of a
//! picture is there as soon as memory and files allow for it.

use super::course::Axis;
use super::fixture::random_head;
use super::urgency::{Demand, Urgency};
use super::{FileState, Playhead, StreamLimits, StreamPlan, StreamSchedule};
use crate::scene::random::Random;
use crate::scene::{ChunkFile, ChunkTable};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Random captures, and the steps with each.
const CAPTURES: u64 = 25;
const STEPS: usize = 400;

/// A host of a stream that keeps its own books.
struct Host {
    random: Random,
    table: Arc<ChunkTable>,
    /// Whether files take whole pages on the GPU.
    is_in_pages: bool,
    duration: f32,
    schedule: StreamSchedule,
    heads: Vec<Playhead>,
    limits: StreamLimits,
    now: f64,
    requested: BTreeSet<usize>,
    /// The time of the last request of each file.
    since: BTreeMap<usize, f64>,
    resident: BTreeSet<usize>,
    /// Files that are being fetched, those that have been given up included.
    jobs: Vec<usize>,
    /// Failures of a file in a row, and the time of the last.
    failed: BTreeMap<usize, (u32, f64)>,
    failures: u64,
}

/// Returns a random table, whose files are a few stretches long or nearly the whole capture.
fn random_table(random: &mut Random) -> ChunkTable {
    let stretches = 1 + random.below(40);
    let layers = 1 + random.below(4);
    let longest = 1 + random.below(stretches);
    let files = (0..random.below(120)).map(|_| {
        let length = 1 + random.below(longest);
        let first = random.below(stretches + 1 - length);
        ChunkFile {
            stretches: [first as u32, (first + length - 1) as u32],
            layer: random.below(layers) as u32,
            gaussians: 1 + random.below(50) as u64,
            bytes: random.below(1000) as u64,
        }
    });
    let files = files.collect();
    let utilities = (0..random.below(4)).map(|_| random.in_range(-1.0, 8.0)).collect();
    ChunkTable {
        stretches: stretches as u32,
        gaussian_bytes: 1 + random.below(80) as u32,
        files,
        utilities,
        first_byte: None,
    }
}

impl Host {
    fn new(seed: u64, is_in_pages: bool) -> Self {
        let mut random = Random::new(seed);
        let mut table = random_table(&mut random);
        if is_in_pages {
            // Up to four pages.
            table.files.iter_mut().for_each(|file| file.gaussians *= 20);
        }
        let table: Arc<ChunkTable> = table.into();
        let duration = random.in_range(0.5, 60.0);
        assert_eq!(table.check(), Ok(()), "capture {seed} has a good table");
        let schedule = StreamSchedule::new(table.clone(), duration.into());
        Self {
            schedule: if is_in_pages { schedule.in_pages() } else { schedule },
            heads: vec![random_head(&mut random, duration)],
            limits: StreamLimits::default(),
            now: 0.0,
            requested: BTreeSet::new(),
            since: BTreeMap::new(),
            resident: BTreeSet::new(),
            jobs: Vec::new(),
            failed: BTreeMap::new(),
            failures: 0,
            random,
            table,
            is_in_pages,
            duration,
        }
    }

    /// Returns the bytes of a file on the GPU, and in memory while it is on the way.
    fn bytes(&self, file: usize) -> [u64; 2] {
        let own = self.table.gpu_bytes(file);
        let on_gpu = if self.is_in_pages { self.table.page_bytes(file) } else { own };
        [on_gpu, own + self.table.files[file].bytes]
    }

    /// Returns the bytes on the GPU and in memory of all files that are there or on the way.
    fn sums(&self) -> [u64; 2] {
        let sum = |files: &BTreeSet<usize>, kind: usize| files.iter().map(|file| self.bytes(*file)[kind]).sum::<u64>();
        [sum(&self.requested, 0) + sum(&self.resident, 0), sum(&self.requested, 1)]
    }

    fn demand(&self) -> Demand {
        let axis = Axis::new(self.duration.into(), self.table.stretches);
        Demand::new(
            &self.heads,
            axis,
            self.limits.ahead.clamp(0.0, 600.0),
            self.table.delays().map(|delay| delay * self.limits.layer_seconds),
        )
    }

    fn urgency(&self, demand: &Demand, file: usize) -> Urgency {
        demand.urgency(file, &self.table.files[file])
    }

    /// Plays on, and now and then changes players and limits.
    fn change(&mut self) {
        let Self { random, heads, limits, duration, .. } = self;
        let step = f64::from(random.in_range(0.0, 0.3));
        // Now and then the host stands still, until all requests are overdue.
        self.now += if step < 0.01 { 40.0 } else { step };
        for head in &mut *heads {
            head.seconds += head.velocity * step;
        }
        match random.below(20) {
            0..5 => heads.iter_mut().take(1).for_each(|head| *head = random_head(random, *duration)),
            5 => heads.push(random_head(random, *duration)),
            6 => {
                heads.pop();
            }
            7 => heads.clear(),
            8 => heads.iter_mut().for_each(|head| head.velocity = -head.velocity),
            _ => {}
        }
        match random.below(14) {
            0 => limits.gpu_bytes = random.below(60_000) as u64,
            1 => limits.gpu_bytes = random.below(6000) as u64,
            2 => limits.gpu_bytes = u64::MAX,
            3 => limits.host_bytes = random.below(20_000) as u64,
            4 => limits.host_bytes = u64::MAX,
            5 => limits.requests = random.below(8),
            6 => limits.ahead = f64::from(random.in_range(-1.0, 20.0)),
            7 => limits.layer_seconds = f64::from(random.in_range(0.01, 2.0)),
            8 => limits.long_bytes = random.below(2000) as u64,
            9 => limits.long_bytes = u64::MAX,
            _ => {}
        }
    }

    /// Makes a plan, carries it out and compares it with the rules.
    fn plan(&mut self) -> StreamPlan {
        let (demand, [gpu_before, _]) = (self.demand(), self.sums());
        let plan = self.schedule.plan(self.now, &self.heads, &self.limits);
        let at = format!("{plan:?} at {} s for {:?} within {:?}", self.now, self.heads, self.limits);
        let mut given_up = Vec::new();
        for file in &plan.give_up {
            if self.resident.remove(file) {
                given_up.push(self.urgency(&demand, *file));
                continue;
            }
            assert!(self.requested.remove(file), "file {file} is neither there nor on the way: {at}");
            if self.is_overdue(*file) {
                self.fail(*file);
                continue;
            }
            let is_too_large = self.bytes(*file)[0] > self.limits.gpu_bytes;
            assert!(is_too_large || !self.urgency(&demand, *file).is_wanted, "request {file} is of use: {at}");
        }
        let is_long = |file: &&usize| self.table.files[**file].bytes > self.limits.long_bytes;
        let (on_the_way, fetched) =
            (self.requested.iter().any(|file| is_long(&file)), plan.fetch.iter().filter(is_long));
        let later = fetched.filter(|file| !self.urgency(&demand, **file).is_due());
        assert!(later.count() <= usize::from(!on_the_way), "one long file at a time: {at}");
        for file in &plan.fetch {
            assert!(!plan.give_up.contains(file), "file {file} is fetched and given up: {at}");
            assert!(!self.resident.contains(file), "file {file} is fetched although it is there: {at}");
            assert!(self.requested.insert(*file), "file {file} is fetched twice: {at}");
            assert!(self.urgency(&demand, *file).is_wanted, "no player reaches file {file}: {at}");
            if let Some((in_a_row, since)) = self.failed.get(file) {
                let delay = (0.125 * f64::from(*in_a_row).exp2()).min(8.0);
                assert!(self.now >= since + delay, "file {file} has to wait: {at}");
            }
            self.jobs.push(*file);
            self.since.insert(*file, self.now);
        }
        let fetched: Vec<Urgency> = plan.fetch.iter().map(|file| self.urgency(&demand, *file)).collect();
        assert!(fetched.is_sorted(), "the most urgent files are fetched first: {at}");
        if gpu_before <= self.limits.gpu_bytes {
            let least = fetched.iter().map(Urgency::least_given_up).fold(f64::INFINITY, f64::min);
            assert!(given_up.iter().all(|urgency| urgency.seconds() >= least), "less urgent files make room: {at}");
        }
        assert!(!self.requested.iter().any(|file| self.is_overdue(*file)), "no request goes on for good: {at}");
        self.compare(&at);
        let [gpu, host] = self.sums();
        assert!(gpu <= self.limits.gpu_bytes || self.resident.is_empty(), "{gpu} bytes on the GPU: {at}");
        if !plan.fetch.is_empty() {
            let count = self.requested.len();
            assert!(gpu <= self.limits.gpu_bytes, "{gpu} bytes on the GPU: {at}");
            assert!(count <= self.limits.requests, "{count} requests: {at}");
            assert!(host <= self.limits.host_bytes || count == 1, "{host} bytes of {count} requests: {at}");
        }
        assert!(!self.heads.is_empty() || self.requested.is_empty(), "nobody needs requests: {at}");
        plan
    }

    /// Compares the schedule with the books of the host.
    fn compare(&self, at: &str) {
        let schedule = &self.schedule;
        assert_eq!([schedule.gpu_bytes(), schedule.host_bytes()], self.sums(), "bytes: {at}");
        let counts = (schedule.requested(), schedule.resident(), schedule.failures());
        assert_eq!(counts, (self.requested.len(), self.resident.len(), self.failures), "counts: {at}");
        for file in 0..self.table.files.len() {
            let expected = match (self.requested.contains(&file), self.resident.contains(&file)) {
                (true, _) => FileState::Requested,
                (_, true) => FileState::Resident,
                _ => FileState::Absent,
            };
            assert_eq!(schedule.state(file), expected, "file {file}: {at}");
        }
    }

    /// Ends a job, with success or without.
    fn end_job(&mut self, job: usize, succeeds: bool) {
        let file = self.jobs.swap_remove(job);
        let was_requested = self.requested.remove(&file);
        if succeeds {
            assert_eq!(self.schedule.arrived(file), was_requested, "file {file} counts if it is on the way");
            if was_requested {
                self.resident.insert(file);
                self.failed.remove(&file);
            }
        } else {
            self.schedule.failed(file, self.now);
            if was_requested {
                self.fail(file);
            }
        }
    }

    /// Counts a failure of a file.
    fn fail(&mut self, file: usize) {
        self.failures += 1;
        let in_a_row = self.failed.get(&file).map_or(0, |(in_a_row, _)| *in_a_row);
        self.failed.insert(file, (in_a_row + 1, self.now));
    }

    /// Returns whether the last request of a file has reached its deadline.
    fn is_overdue(&self, file: usize) -> bool {
        self.now >= self.since[&file] + 30.0 + self.table.files[file].bytes as f64 / 32_768.0
    }

    /// Lets some files arrive or fail, in any order.
    fn some_jobs_end(&mut self) {
        for _ in 0..self.random.below(6) {
            if !self.jobs.is_empty() {
                let job = self.random.below(self.jobs.len());
                let succeeds = self.random.below(5) > 0;
                self.end_job(job, succeeds);
            }
        }
    }

    /// Lets all files arrive while players stand still, until nothing is fetched or given up any more.
    fn settle(&mut self) {
        // In the first rounds requests of before go on.
        for round in 0..self.table.files.len() + 3 {
            // Files that have failed are asked for again.
            self.now += 8.0;
            let plan = self.plan();
            while !self.jobs.is_empty() {
                self.end_job(0, true);
            }
            if round > 1 && plan == StreamPlan::default() {
                return;
            }
        }
        panic!("files replace each other without end for {:?} within {:?}", self.heads, self.limits);
    }

    /// With few bytes, files do not replace each other; with enough of all, every player has its picture and those of
    /// the next seconds.
    fn recover(&mut self) {
        if self.heads.is_empty() {
            self.heads.push(random_head(&mut self.random, self.duration));
        }
        self.limits.requests = 1 + self.random.below(6);
        self.settle();
        self.limits.gpu_bytes = (0..self.table.files.len()).map(|file| self.bytes(file)[0]).sum();
        self.settle();
        let demand = self.demand();
        let delays = self.table.delays();
        let longest = self.table.files.iter().map(|file| delays[file.layer as usize]).fold(0.0, f64::max);
        let longest = longest * self.limits.layer_seconds;
        for head in &self.heads {
            let coverage = self.schedule.coverage(head.seconds);
            assert!(coverage.is_whole() && coverage.is_coarse, "{coverage:?} of {head:?} within {:?}", self.limits);
            assert_eq!(coverage.share(), 1.0, "{coverage:?} of {head:?}");
        }
        for file in 0..self.table.files.len() {
            let urgency = self.urgency(&demand, file);
            let is_there = self.resident.contains(&file);
            assert!(is_there || !urgency.is_wanted, "file {file} is wanted in {} s", urgency.seconds());
            let latest = self.limits.ahead.max(0.0) + 1e-3 + longest;
            assert!(!urgency.is_wanted || urgency.seconds() <= latest, "no urgency is greater than {latest} s");
        }
    }
}

#[test]
fn the_rules_hold_in_random_steps() {
    for (seed, is_in_pages) in (0..CAPTURES).flat_map(|seed| [(seed, false), (seed, true)]) {
        let mut host = Host::new(seed, is_in_pages);
        for step in 0..STEPS {
            host.change();
            host.plan();
            host.some_jobs_end();
            if step % 40 == 39 {
                host.recover();
            }
        }
    }
}
