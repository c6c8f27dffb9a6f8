//! Tests of the rules of streaming: what is fetched first, and what is given up for it.
//!
//! In: small tables, in stretches of a second, players and limits. Out: proof that plans follow each rule.

use super::fixture::{head, table};
use super::{FileState, Playhead, StreamLimits, StreamPlan, StreamSchedule, Turn};

/// A file of a table: its first and last stretch, its layer, its bytes on the GPU.
type File = ([u32; 2], u32, u64);

/// Returns the schedule of a capture in stretches of a second.
fn schedule(stretches: u32, files: &[File]) -> StreamSchedule {
    let table = table(stretches, files);
    assert_eq!(table.check(), Ok(()), "a good table");
    StreamSchedule::new(table.into(), stretches.into())
}

/// Returns limits of the memory on the GPU and of the requests.
fn limits(gpu_bytes: u64, requests: usize) -> StreamLimits {
    StreamLimits { gpu_bytes, requests, ..StreamLimits::default() }
}

/// Plans until nothing is fetched any more; each file arrives at once. Returns the files in the order in which they are
/// fetched, and those that are given up.
fn settle(schedule: &mut StreamSchedule, heads: &[Playhead], limits: &StreamLimits) -> [Vec<usize>; 2] {
    let (mut fetched, mut given_up) = (Vec::new(), Vec::new());
    for _ in 0..=schedule.table().files.len() {
        let plan = schedule.plan(0.0, heads, limits);
        given_up.extend(plan.give_up);
        if plan.fetch.is_empty() {
            return [fetched, given_up];
        }
        for file in plan.fetch {
            assert!(schedule.arrived(file), "file {file} is on the way");
            fetched.push(file);
        }
    }
    panic!("files replace each other without end: {fetched:?}");
}

/// Returns the order in which one file at a time is fetched for a player.
fn order(files: &[File], stretches: u32, head: Playhead) -> Vec<usize> {
    let [fetched, given_up] = settle(&mut schedule(stretches, files), &[head], &limits(u64::MAX, 1));
    assert_eq!(given_up, [0; 0], "nothing is given up while there is room");
    fetched
}

#[test]
fn layer_0_of_the_present_comes_first_then_the_next_seconds_then_other_layers() {
    let files = [
        ([0, 3], 0, 9),
        ([0, 3], 1, 9),
        ([0, 3], 2, 9),
        ([0, 0], 0, 9),
        ([0, 0], 1, 9),
        ([1, 1], 0, 9),
        ([1, 1], 1, 9),
        ([2, 3], 0, 9),
    ];
    // Urgencies: 0, 1.5, 3, 0, 1.5, 0.75, 2.25, 1.75 s.
    let found = order(&files, 4, head(0.25, 1.0, Turn::Stop));
    assert_eq!(found, [0, 3, 5, 1, 4, 7, 6, 2], "by urgency, then by number");
}

#[test]
fn layer_1_of_now_comes_before_layer_0_in_two_seconds() {
    let files = [([2, 2], 0, 9), ([0, 0], 1, 9), ([1, 1], 0, 9)];
    assert_eq!(order(&files, 4, head(0.0, 1.0, Turn::Stop)), [2, 1, 0], "1 s, 1.5 s, 2 s");
    assert_eq!(order(&files, 4, head(0.0, 2.0, Turn::Stop)), [2, 0, 1], "0.5 s, 1 s, 1.5 s at double speed");
}

/// One file of layer 0 for each of six stretches.
const SINGLE: [File; 6] =
    [([0, 0], 0, 10), ([1, 1], 0, 10), ([2, 2], 0, 10), ([3, 3], 0, 10), ([4, 4], 0, 10), ([5, 5], 0, 10)];

#[test]
fn the_start_of_a_loop_is_fetched_before_its_end_is_reached() {
    let range = [1.0, 5.0];
    let forwards = Playhead { range, ..head(4.5, 1.0, Turn::Loop) };
    assert_eq!(order(&SINGLE, 6, forwards), [4, 1, 2, 3], "the range from the player on");
    let backwards = Playhead { range, ..head(1.5, -1.0, Turn::Loop) };
    assert_eq!(order(&SINGLE, 6, backwards), [1, 4, 3, 2], "backwards, the end after the start");
}

#[test]
fn a_player_that_stops_fetches_nothing_behind_it() {
    assert_eq!(order(&SINGLE, 6, head(3.5, 1.0, Turn::Stop)), [3, 4, 5], "forwards");
    assert_eq!(order(&SINGLE, 6, head(3.5, -1.0, Turn::Stop)), [3, 2, 1, 0], "backwards");
}

#[test]
fn a_player_that_returns_fetches_what_is_behind_it_after_its_turn() {
    assert_eq!(order(&SINGLE, 6, head(4.5, 1.0, Turn::Return)), [4, 5, 3, 2, 1, 0], "forwards");
    assert_eq!(order(&SINGLE, 6, head(1.5, -1.0, Turn::Return)), [1, 0, 2, 3, 4, 5], "in the returning pass");
}

#[test]
fn a_paused_player_fetches_as_if_it_played() {
    assert_eq!(order(&SINGLE, 6, head(3.5, 0.0, Turn::Loop)), [3, 4, 5, 0, 1, 2], "forwards at speed 1");
}

#[test]
fn files_beyond_the_time_ahead_are_not_fetched() {
    let mut schedule = schedule(6, &SINGLE);
    let near = StreamLimits { ahead: 1.5, ..limits(1000, 9) };
    assert_eq!(schedule.plan(0.0, &[head(1.5, 1.0, Turn::Loop)], &near).fetch, [1, 2, 3], "reached in 1.5 s");
    assert_eq!(schedule.plan(0.0, &[head(3.5, 1.0, Turn::Loop)], &near).give_up, [1, 2], "stale requests");
}

#[test]
fn several_players_share_files_and_requests() {
    let heads = [head(0.5, 1.0, Turn::Stop), head(3.75, -1.0, Turn::Stop)];
    let found = settle(&mut schedule(6, &SINGLE), &heads, &limits(1000, 1));
    // Urgencies: 0, 0.5, 0.75, 0 s from the second player on the way back, and 3.5, 4.5 s.
    assert_eq!(found, [vec![0, 3, 1, 2, 4, 5], vec![]], "the player that needs a file first decides");
    let at_once = schedule(6, &SINGLE).plan(0.0, &heads, &limits(1000, 9)).fetch;
    assert_eq!(at_once, [0, 3, 1, 2, 4, 5], "a file that both need is fetched once");
}

#[test]
fn the_files_that_are_needed_last_are_given_up() {
    let mut schedule = schedule(6, &SINGLE);
    let near = StreamLimits { ahead: 2.0, ..limits(40, 4) };
    settle(&mut schedule, &[head(0.5, 1.0, Turn::Loop)], &StreamLimits { ahead: 3.0, ..near });
    assert_eq!([0, 1, 2, 3].map(|file| schedule.state(file)), [FileState::Resident; 4], "the first four are there");
    // Of those that are not wanted, 1 is needed again last, then 0; 2 is drawn now.
    let plan = schedule.plan(0.0, &[head(2.5, 1.0, Turn::Loop)], &near);
    assert_eq!(plan, StreamPlan { fetch: vec![4], give_up: vec![1] }, "one file for one file");
    let back = schedule.plan(0.0, &[head(2.5, -1.0, Turn::Loop)], &StreamLimits { ahead: 0.0, ..near });
    assert_eq!(back, StreamPlan { fetch: vec![], give_up: vec![4] }, "what is there stays without need for room");
    let last = settle(&mut schedule, &[head(4.5, 1.0, Turn::Stop)], &near);
    assert_eq!(last, [vec![4, 5], vec![3]], "never used again: the highest number first");
}

#[test]
fn a_file_is_only_given_up_for_one_that_is_clearly_more_urgent() {
    // The file of layer 1 has an urgency of 1.5 s.
    let files = [([0, 5], 1, 10), ([3, 5], 0, 10)];
    let mut schedule = schedule(6, &files);
    let limits = limits(10, 1);
    assert_eq!(settle(&mut schedule, &[head(0.5, 1.0, Turn::Stop)], &limits)[0], [0], "there is room for one");
    for (seconds, plan) in [
        (1.75, StreamPlan::default()),
        (1.9375, StreamPlan::default()),
        (2.0, StreamPlan { fetch: vec![1], give_up: vec![0] }),
    ] {
        assert_eq!(schedule.plan(0.0, &[head(seconds, 1.0, Turn::Stop)], &limits), plan, "at {seconds} s");
    }
    schedule.arrived(1);
    // The urgency of the second file is 1.5 s less now, and 0 then.
    for seconds in [2.0, 1.25, 2.9] {
        let plan = schedule.plan(0.0, &[head(seconds, 1.0, Turn::Stop)], &limits);
        assert_eq!(plan, StreamPlan::default(), "files do not replace each other at {seconds} s");
    }
}

#[test]
fn layer_0_of_now_takes_the_place_of_all_that_is_drawn_later() {
    let mut schedule = schedule(6, &SINGLE);
    let limits = limits(10, 1);
    assert_eq!(settle(&mut schedule, &[head(1.5, 1.0, Turn::Stop)], &limits)[0], [1], "there is room for one");
    let heads = [head(0.75, 1.0, Turn::Stop)];
    let plan = schedule.plan(0.0, &heads, &limits);
    assert_eq!(plan, StreamPlan { fetch: vec![0], give_up: vec![1] }, "for a file that is needed in 0.25 s");
    schedule.arrived(0);
    assert_eq!(schedule.plan(0.0, &heads, &limits), StreamPlan::default(), "and the other does not come back");
}

#[test]
fn the_present_takes_the_place_of_a_picture_that_stays() {
    let files = [([0, 0], 0, 10), ([0, 0], 0, 10), ([3, 3], 0, 10), ([3, 3], 0, 10)];
    let mut schedule = schedule(4, &files);
    let limits = limits(20, 4);
    let near = StreamLimits { ahead: 0.0, ..limits };
    let first = settle(&mut schedule, &[head(0.5, 1.0, Turn::Stop)], &near)[0].clone();
    assert_eq!(first, [0, 1], "there is room for the picture of one moment");
    let held = Playhead { range: [0.5; 2], delay: 1e-3, ..head(0.5, 0.0, Turn::Stop) };
    let jumped = settle(&mut schedule, &[head(3.5, 0.0, Turn::Stop), held], &limits);
    assert_eq!(jumped, [vec![2, 3], vec![1, 0]], "the player does not wait for good");
}

#[test]
fn the_first_file_without_room_holds_up_the_others() {
    let files = [([0, 0], 0, 60), ([1, 1], 0, 50), ([2, 2], 0, 10)];
    let mut schedule = schedule(3, &files);
    let found = settle(&mut schedule, &[head(0.5, 1.0, Turn::Stop)], &limits(100, 4));
    assert_eq!(found, [vec![0], vec![]], "a small file does not overtake one that is more urgent");
    let now = settle(&mut schedule, &[head(1.5, 1.0, Turn::Stop)], &limits(100, 4));
    assert_eq!(now, [vec![1, 2], vec![0]], "there is room when the first is not needed any more");
}

#[test]
fn only_one_long_file_is_on_its_way_and_short_ones_overtake_the_others() {
    // Urgencies: 0, 1.5, 3, 0, 1.5 s.
    let files = [([0, 2], 0, 60), ([0, 2], 1, 60), ([0, 2], 2, 60), ([0, 0], 0, 10), ([2, 2], 0, 10)];
    let mut schedule = schedule(3, &files);
    let limits = StreamLimits { long_bytes: 10, ..limits(1000, 2) };
    let heads = [head(0.5, 1.0, Turn::Stop)];
    assert_eq!(schedule.plan(0.0, &heads, &limits).fetch, [0, 3], "a long file and a short one");
    assert!(schedule.arrived(3), "the short one is there");
    assert_eq!(schedule.plan(0.0, &heads, &limits).fetch, [4], "the next short one overtakes long ones");
    assert!(schedule.arrived(4), "it is there");
    assert_eq!(schedule.plan(0.0, &heads, &limits).fetch, [0; 0], "the other long files wait");
    assert!(schedule.arrived(0), "the long file is there");
    assert_eq!(schedule.plan(0.0, &heads, &limits).fetch, [1], "the next");
}

#[test]
fn a_long_file_does_not_hold_up_layer_0_of_now() {
    let files = [([0, 5], 1, 60), ([0, 0], 0, 60), ([4, 4], 0, 60), ([5, 5], 0, 60)];
    let mut schedule = schedule(6, &files);
    let limits = StreamLimits { long_bytes: 10, ahead: 1.0, ..limits(1000, 4) };
    assert_eq!(schedule.plan(0.0, &[head(2.5, 1.0, Turn::Stop)], &limits).fetch, [0], "a long file");
    let jumped = [head(4.5, 1.0, Turn::Stop)];
    assert_eq!(schedule.plan(0.0, &jumped, &limits).fetch, [2], "after a jump, layer 0 of then comes beside it");
    assert_eq!(schedule.plan(0.0, &jumped, &limits).fetch, [0; 0], "what is played later waits");
}

#[test]
fn a_file_that_is_larger_than_all_memory_is_left_out() {
    let files = [([0, 2], 0, 101), ([0, 0], 0, 50), ([1, 1], 0, 50)];
    let mut schedule = schedule(3, &files);
    let heads = [head(0.5, 1.0, Turn::Stop)];
    assert_eq!(settle(&mut schedule, &heads, &limits(100, 1))[0], [1, 2], "the others are fetched");
    assert_eq!(settle(&mut schedule, &heads, &limits(201, 1))[0], [0], "until there is memory for it");
}

#[test]
fn files_in_pages_need_room_for_whole_pages() {
    // Two pages and one page each, of Gaussians of a byte.
    let files = [([0, 1], 0, 257), ([0, 0], 0, 1), ([1, 1], 0, 1)];
    assert_eq!(schedule(2, &files).gpu_bytes_of(0), 257, "each Gaussian by itself");
    assert_eq!(schedule(2, &files).in_pages().gpu_bytes_of(0), 512, "whole pages");
    let fetched = |mut schedule: StreamSchedule, gpu_bytes| {
        let [fetched, _] = settle(&mut schedule, &[head(0.5, 1.0, Turn::Stop)], &limits(gpu_bytes, 1));
        (fetched, schedule.gpu_bytes())
    };
    assert_eq!(fetched(schedule(2, &files), 259), (vec![0, 1, 2], 259), "there is room for each Gaussian");
    let in_pages = |gpu_bytes| fetched(schedule(2, &files).in_pages(), gpu_bytes);
    assert_eq!(in_pages(259), (vec![1], 256), "there is one page: the first file is larger, the last has no room");
    assert_eq!(in_pages(767), (vec![0], 512), "two pages");
    assert_eq!(in_pages(1024), (vec![0, 1, 2], 1024), "four pages");
}

#[test]
fn files_in_pages_make_room_by_whole_pages() {
    let files = [([0, 0], 0, 1), ([0, 0], 0, 1), ([0, 0], 0, 1), ([0, 0], 0, 1), ([1, 1], 0, 257)];
    let mut schedule = schedule(2, &files).in_pages();
    let near = StreamLimits { ahead: 0.0, ..limits(1024, 1) };
    settle(&mut schedule, &[head(0.5, 1.0, Turn::Stop)], &near);
    assert_eq!((schedule.resident(), schedule.gpu_bytes()), (4, 1024), "four Gaussians in four pages");
    let heads = [head(1.5, 1.0, Turn::Stop)];
    assert_eq!(settle(&mut schedule, &heads, &near), [vec![4], vec![3, 2]], "two pages for two");
    let less = schedule.plan(0.0, &heads, &StreamLimits { gpu_bytes: 1023, ..near });
    assert_eq!(less, StreamPlan { fetch: vec![], give_up: vec![1] }, "a page less");
    let least = schedule.plan(0.0, &heads, &StreamLimits { gpu_bytes: 511, ..near });
    assert_eq!(least, StreamPlan { fetch: vec![], give_up: vec![4] }, "the file of two pages has no room");
    assert_eq!(schedule.gpu_bytes(), 256, "one page is left");
}

#[test]
fn requests_are_limited_in_number_and_in_memory() {
    let files = [([0, 0], 0, 10), ([0, 0], 0, 10), ([0, 0], 0, 100), ([0, 0], 0, 10)];
    let mut schedule = schedule(1, &files);
    let heads = [head(0.5, 1.0, Turn::Stop)];
    assert_eq!(schedule.plan(0.0, &heads, &limits(1000, 0)), StreamPlan::default(), "no request, no file");
    assert_eq!(schedule.plan(0.0, &heads, &limits(1000, 1)).fetch, [0], "one request");
    // Each file takes its bytes twice in memory: as a file, and as Gaussians.
    let small = |host_bytes| StreamLimits { host_bytes, ..limits(1000, 9) };
    assert_eq!(schedule.plan(0.0, &heads, &small(39)).fetch, [0; 0], "a second file has no room");
    assert_eq!(schedule.plan(0.0, &heads, &small(40)).fetch, [1], "two files of 20 bytes");
    assert_eq!((schedule.host_bytes(), schedule.gpu_bytes(), schedule.requested()), (40, 20, 2), "two on the way");
    schedule.arrived(0);
    assert_eq!(schedule.plan(0.0, &heads, &small(40)).fetch, [0; 0], "a file of 200 bytes waits for the others");
    schedule.arrived(1);
    assert_eq!(schedule.plan(0.0, &heads, &small(40)).fetch, [2], "the large file alone");
    schedule.arrived(2);
    assert_eq!((schedule.host_bytes(), schedule.gpu_bytes(), schedule.resident()), (0, 120, 3), "three are there");
}

#[test]
fn files_are_given_up_if_the_memory_shrinks() {
    let mut schedule = schedule(6, &SINGLE);
    let heads = [head(2.5, 1.0, Turn::Stop)];
    settle(&mut schedule, &[head(0.0, 1.0, Turn::Stop)], &limits(60, 6));
    let shrunk = schedule.plan(0.0, &heads, &limits(35, 6));
    assert_eq!(shrunk, StreamPlan { fetch: vec![], give_up: vec![1, 0, 5] }, "what is behind, then the last");
    assert_eq!(schedule.gpu_bytes(), 30, "three files are left");
    assert_eq!(schedule.plan(0.0, &heads, &limits(35, 6)), StreamPlan::default(), "nothing more");
    assert_eq!(schedule.plan(0.0, &heads, &limits(0, 6)).give_up, [4, 3, 2], "no memory at all");
    assert_eq!(settle(&mut schedule, &heads, &limits(60, 6)), [vec![2, 3, 4, 5], vec![]], "memory again");
}

#[test]
fn requests_go_on_if_memory_shrinks_unless_a_file_is_larger_than_all_of_it() {
    let files = [([0, 0], 0, 10), ([0, 0], 0, 10), ([0, 0], 0, 30)];
    let mut schedule = schedule(1, &files);
    let heads = [head(0.5, 1.0, Turn::Stop)];
    assert_eq!(schedule.plan(0.0, &heads, &limits(50, 3)).fetch, [0, 1, 2], "all are on the way");
    let shrunk = schedule.plan(0.0, &heads, &limits(15, 3));
    assert_eq!(shrunk, StreamPlan { fetch: vec![], give_up: vec![2] }, "two requests of 20 bytes go on");
    schedule.arrived(0);
    let landed = schedule.plan(0.0, &heads, &limits(15, 3));
    assert_eq!(landed.give_up, [0], "a file that is there makes room for the one on the way");
    assert_eq!(schedule.gpu_bytes(), 10, "within the limit again");
}

#[test]
fn a_jump_in_time_gives_up_requests_and_ignores_their_files() {
    let mut schedule = schedule(6, &SINGLE);
    let limits = StreamLimits { ahead: 0.0, ..limits(60, 1) };
    assert_eq!(schedule.plan(0.0, &[head(0.5, 1.0, Turn::Loop)], &limits).fetch, [0], "before the jump");
    let plan = schedule.plan(0.0, &[head(4.5, 1.0, Turn::Loop)], &limits);
    assert_eq!(plan, StreamPlan { fetch: vec![4], give_up: vec![0] }, "the new time does not wait for the old one");
    assert!(!schedule.arrived(0), "a file that lands after it was given up does not count");
    schedule.failed(0, 0.0);
    assert_eq!((schedule.state(0), schedule.failures()), (FileState::Absent, 0), "nor does its failure");
    assert!(schedule.arrived(4) && !schedule.arrived(4) && !schedule.arrived(99), "a file arrives once");
}

#[test]
fn without_players_nothing_is_fetched_and_everything_stays() {
    let mut schedule = schedule(6, &SINGLE);
    let heads = [head(0.5, 1.0, Turn::Stop)];
    let first = schedule.plan(0.0, &heads, &limits(60, 2)).fetch;
    schedule.arrived(first[0]);
    let nobody = schedule.plan(0.0, &[], &limits(60, 2));
    assert_eq!(nobody, StreamPlan { fetch: vec![], give_up: vec![1] }, "the request is given up");
    assert_eq!((schedule.resident(), schedule.requested()), (1, 0), "the file that is there stays");
    assert_eq!(settle(&mut schedule, &heads, &limits(60, 2))[0], [1, 2, 3, 4, 5], "the player comes back");
}

#[test]
fn a_file_that_fails_waits_and_does_not_hold_up_others() {
    let mut schedule = schedule(6, &SINGLE);
    let heads = [head(0.5, 1.0, Turn::Stop)];
    let limits = limits(60, 1);
    assert_eq!(schedule.plan(1.0, &heads, &limits).fetch, [0], "first try");
    schedule.failed(0, 1.0);
    assert_eq!(schedule.plan(1.125, &heads, &limits).fetch, [1], "another file meanwhile");
    schedule.arrived(1);
    assert_eq!(schedule.plan(1.25, &heads, &limits).fetch, [0], "second try after 0.25 s");
    schedule.failed(0, 1.25);
    assert_eq!(schedule.plan(1.625, &heads, &limits).fetch, [2], "and another one");
    schedule.failed(2, 1.625);
    assert_eq!(schedule.plan(1.75, &heads, &limits).fetch, [0], "third try after 0.5 s");
    schedule.arrived(0);
    assert_eq!((schedule.failures(), schedule.resident()), (3, 2), "three failures, two files");
    schedule.plan(2.0, &heads, &StreamLimits { gpu_bytes: 0, ..limits });
    assert_eq!(schedule.plan(2.0, &heads, &limits).fetch, [0], "the file has been given up, and is fetched again");
    schedule.failed(0, 2.0);
    assert_eq!(schedule.plan(2.25, &heads, &limits).fetch, [0], "it had arrived: the first failure in a row again");
}

#[test]
fn a_request_that_does_not_end_counts_as_failed() {
    let mut schedule = schedule(6, &SINGLE);
    let heads = [head(0.5, 1.0, Turn::Stop)];
    let limits = limits(60, 1);
    assert_eq!(schedule.plan(1.0, &heads, &limits).fetch, [0], "first try");
    assert_eq!(schedule.plan(30.9, &heads, &limits), StreamPlan::default(), "it has 30 s");
    let plan = schedule.plan(31.5, &heads, &limits);
    assert_eq!(plan, StreamPlan { fetch: vec![1], give_up: vec![0] }, "another file takes its place");
    assert_eq!((schedule.failures(), schedule.failures_in_a_row(0), schedule.waits(0)), (1, 1, true), "a failure");
    assert!(!schedule.arrived(0), "a file that lands too late does not count");
    schedule.arrived(1);
    assert_eq!(schedule.plan(31.75, &heads, &limits).fetch, [0], "second try after 0.25 s");
    assert!(!schedule.waits(0) && schedule.arrived(0), "it is in time");
    assert_eq!(schedule.failures_in_a_row(0), 0, "no failure any more");
    assert_eq!(schedule.plan(99.0, &heads, &limits).give_up, [0; 0], "a file that is there has no deadline");
}

#[test]
fn a_clock_that_goes_back_or_makes_no_sense_stands_still() {
    let mut schedule = schedule(6, &SINGLE);
    let heads = [head(0.5, 1.0, Turn::Stop)];
    let limits = StreamLimits { ahead: 0.0, ..limits(60, 1) };
    assert_eq!(schedule.plan(2.0, &heads, &limits).fetch, [0], "first try");
    schedule.failed(0, f64::NAN);
    for now in [0.0, f64::NAN, f64::NEG_INFINITY, f64::INFINITY, 2.125] {
        assert_eq!(schedule.plan(now, &heads, &limits), StreamPlan::default(), "the file waits at {now}");
    }
    assert_eq!(schedule.plan(2.25, &heads, &limits).fetch, [0], "second try");
}

#[test]
fn the_buffered_seconds_end_at_the_first_missing_file_of_layer_0() {
    // The file of layer 1 is never there: it is larger than the memory.
    let files = [SINGLE.as_slice(), &[([0, 5], 1, 5000)]].concat();
    let mut schedule = schedule(6, &files);
    let near = StreamLimits { ahead: 1.0, ..limits(1000, 1) };
    let buffered = |schedule: &StreamSchedule, seconds, velocity, turn| {
        let buffered = schedule.buffered(&head(seconds, velocity, turn));
        (buffered * 1e6).round() / 1e6
    };
    assert_eq!(buffered(&schedule, 2.5, 1.0, Turn::Loop), 0.0, "nothing is there");
    schedule.plan(0.0, &[head(2.5, 1.0, Turn::Loop)], &near);
    assert_eq!(buffered(&schedule, 2.5, 1.0, Turn::Loop), 0.0, "nothing has arrived");
    schedule.arrived(2);
    settle(&mut schedule, &[head(2.5, 1.0, Turn::Loop)], &near);
    assert_eq!(buffered(&schedule, 2.5, 1.0, Turn::Loop), 1.5, "stretches 2 and 3");
    assert_eq!(buffered(&schedule, 2.5, 3.0, Turn::Loop), 0.5, "at three times the speed");
    assert_eq!(buffered(&schedule, 3.5, -1.0, Turn::Loop), 1.5, "backwards");
    settle(&mut schedule, &[head(2.5, 1.0, Turn::Loop)], &limits(1000, 9));
    assert_eq!(buffered(&schedule, 2.5, -2.0, Turn::Loop), 3.0, "all is there: one pass");
    assert_eq!(buffered(&schedule, 2.5, 1.0, Turn::Stop), 3.5, "to the end");
    assert_eq!(buffered(&schedule, 2.5, 1.0, Turn::Return), 9.5, "to the end, and back to the start");
    let still = Playhead { range: [2.5; 2], ..head(2.5, 1.0, Turn::Loop) };
    assert_eq!(schedule.buffered(&still), 0.0, "nothing is played in an empty range");
}

#[test]
fn a_time_needs_the_files_that_contain_its_stretch() {
    let files = [([4, 5], 0, 30), ([0, 5], 0, 10), ([2, 4], 1, 60), ([3, 3], 0, 99)];
    let mut schedule = schedule(6, &files);
    let needed = |seconds: f64| schedule.needed_at(seconds).collect::<Vec<usize>>();
    assert_eq!([needed(4.5), needed(0.0), needed(99.0)], [vec![0, 1, 2], vec![1], vec![0, 1]], "in ascending order");
    assert_eq!(needed(f64::NAN), [1], "NaN counts as 0");
    schedule.plan(0.0, &[head(4.5, 1.0, Turn::Stop)], &limits(1000, 1));
    schedule.arrived(0);
    let coverage = schedule.coverage(4.5);
    assert_eq!((coverage.files, coverage.resident, coverage.share()), (3, 1, 0.3), "the first has arrived");
    assert!(!coverage.is_coarse, "a file of layer 0 is missing");
    settle(&mut schedule, &[head(4.5, 1.0, Turn::Stop)], &limits(1000, 1));
    assert!(schedule.coverage(4.5).is_whole(), "all are there");
}

#[test]
fn tables_and_players_without_sense_have_plans() {
    let wild = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, 5e-324, 1e308, -1e308];
    let files = [([0, 0], 0, u64::MAX), ([5, 2], 99, 7), ([0, u32::MAX], u32::MAX, u64::MAX), ([1, 1], 0, 0)];
    for duration in wild {
        for (stretches, is_in_pages) in [(0, true), (1, false), (3, false), (3, true), (u32::MAX, false)] {
            let mut table = table(stretches, &files);
            table.gaussian_bytes = u32::MAX;
            let schedule = StreamSchedule::new(table.into(), duration);
            let mut schedule = if is_in_pages { schedule.in_pages() } else { schedule };
            for (number, a) in wild.iter().enumerate() {
                let b = wild[(number + 1) % wild.len()];
                for turn in [Turn::Stop, Turn::Loop, Turn::Return] {
                    let head = Playhead { seconds: *a, velocity: b, range: [b, *a], turn, delay: *a };
                    let (all, requests) = (u64::MAX, usize::MAX);
                    let limits = StreamLimits {
                        gpu_bytes: all,
                        host_bytes: all,
                        requests,
                        ahead: *a,
                        layer_seconds: b,
                        ..StreamLimits::default()
                    };
                    for file in schedule.plan(*a, &[head, head], &limits).fetch {
                        schedule.arrived(file);
                    }
                    assert!(schedule.buffered(&head) >= 0.0, "{head:?} for {duration} s");
                    assert!(schedule.coverage(*a).share() >= 0.0, "{head:?} for {duration} s");
                    schedule.plan(*a, &[head], &StreamLimits { gpu_bytes: 0, ..limits });
                    assert_eq!(schedule.gpu_bytes(), 0, "{head:?} for {duration} s: no memory");
                }
            }
        }
    }
}

#[test]
fn the_largest_table_is_played_through() {
    // A minute in 10,000 stretches, of which the base has 10 files and each stretch 8, in two layers.
    let base = (0..10).map(|number| ([0, 9999], number % 2, 1000));
    let own = (0..80_000).map(|number| ([number / 8; 2], number % 2, 10));
    let files: Vec<File> = base.chain(own).collect();
    let mut schedule = StreamSchedule::new(table(10_000, &files).into(), 60.0);
    let limits = StreamLimits { ahead: 1.0, ..limits(40_000, 256) };
    for frame in 0..600 {
        let seconds = f64::from(frame) * 0.09;
        let head = head(seconds, 1.0, Turn::Loop);
        for file in schedule.plan(seconds, &[head], &limits).fetch {
            schedule.arrived(file);
        }
        assert!(schedule.gpu_bytes() <= limits.gpu_bytes, "within the memory at {seconds} s");
        assert!(schedule.buffered(&head) <= 60.0, "at most one pass at {seconds} s");
    }
    let head = head(53.91, 1.0, Turn::Loop);
    settle(&mut schedule, &[head], &limits);
    assert!(schedule.coverage(53.91).is_whole(), "all of the last time is there");
    assert!((0.9..1.3).contains(&schedule.buffered(&head)), "a second ahead: {}", schedule.buffered(&head));
}

#[test]
fn a_host_knows_what_playing_needs_and_whether_what_is_ahead_has_room() {
    // Ten seconds of 500 bytes each.
    let files: Vec<File> = (0..10).map(|stretch| ([stretch; 2], 0, 500)).collect();
    let schedule = schedule(10, &files);
    let needed = |velocities: &[f64]| {
        let heads: Vec<Playhead> = velocities.iter().map(|velocity| head(0.0, *velocity, Turn::Loop)).collect();
        schedule.bytes_per_second(&heads)
    };
    assert_eq!([needed(&[0.0]), needed(&[1.0, -4.0]), needed(&[])], [500.0, 2000.0, 500.0], "the fastest decides");
    let has_room = |bytes, ahead| schedule.has_room(bytes, ahead);
    assert!(has_room(2000, 2.0) && !has_room(1999, 2.0), "two seconds ahead, and two behind");
    assert!(has_room(5000, 1e9) && !has_room(4999, 1e9), "all of it");
    let still = StreamSchedule::new(table(1, &[([0, 0], 0, 500)]).into(), 0.0);
    assert!(still.has_room(500, 2.0) && !still.has_room(499, 2.0), "a still is all of it");
}
