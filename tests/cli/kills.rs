//! Killing `gs4d bake`, `finetune` and `train` at random moments.
//!
//! In: a small synthetic scene, its own pictures as a dataset, commands that are killed (SIGKILL) after a random time
//! and started again until they end. Out: proof that the package has the bytes of an uninterrupted run. `GS4D_KILLS` is
//! the number of kills of each command, 4 unless `.ci/full` sets more. Skipped where there is no GPU.

use crate::support::command::{arguments, gs4d, has_gpu};
use crate::support::random::Random;
use crate::support::small_capture::small_capture;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Kills of each command if `GS4D_KILLS` is not set.
const KILLS: u32 = 4;

fn kills() -> u32 {
    std::env::var("GS4D_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(KILLS)
}

/// Runs the command until it ends, killing it after random times, at most `left` times. Returns the number of kills.
fn run_with_kills(command: &[OsString], longest: Duration, left: u32, random: &mut Random) -> u32 {
    for kills in 0..=left {
        let child = Command::new(env!("CARGO_BIN_EXE_gs4d"))
            .args(command)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        let mut child = child.expect("the command starts");
        if kills < left {
            let delay = longest.mul_f64(random.below(1000) as f64 / 1000.0);
            let start = Instant::now();
            while start.elapsed() < delay && child.try_wait().expect("the child can be waited for").is_none() {
                std::thread::sleep(Duration::from_millis(1));
            }
            if child.try_wait().expect("the child can be waited for").is_none() {
                child.kill().expect("the child can be killed");
                child.wait().expect("the child can be waited for");
                continue;
            }
        }
        let status = child.wait().expect("the child can be waited for");
        assert!(status.success(), "the resumed command succeeds after {kills} kills: {status}");
        return kills;
    }
    unreachable!("the last run is not killed")
}

/// Kills and resumes a command that writes `out` until it has been killed as often as wanted, and compares the bytes
/// with those of `whole`.
fn resumed_runs_equal(name: &str, command: &[OsString], out: &Path, others: &[&Path], seed: u64) {
    let start = Instant::now();
    gs4d(command).text();
    let (whole, longest) = (fs::read(out).expect("the package exists"), start.elapsed());
    let (mut random, mut made, mut runs) = (Random::new(seed), 0, 0);
    while made < kills() {
        fs::remove_file(out).expect("the package exists");
        others.iter().for_each(|path| drop(fs::remove_file(path)));
        made += run_with_kills(command, longest, kills() - made, &mut random);
        runs += 1;
        let bytes = fs::read(out).expect("the package exists");
        assert!(
            bytes == whole,
            "{name}: the package after {made} kills in {runs} runs has the bytes of an uninterrupted run"
        );
    }
    println!("{name}: {made} kills in {runs} runs");
}

#[test]
fn a_bake_killed_at_random_ends_at_the_same_bytes() {
    if !has_gpu() {
        return;
    }
    let capture = small_capture(300, 3);
    let out = capture.path("out.gs4d");
    let command = arguments![
        "bake",
        &capture.scene,
        "--data",
        &capture.data,
        "-o",
        &out,
        "--ratio",
        "0.5",
        "--variant",
        "energy",
        "--engine",
        "gpu",
        "--steps",
        "30",
        "--rounds",
        "2"
    ];
    let reports = ["out.report.json", "out.report.html"].map(|name| capture.path(name));
    resumed_runs_equal("bake", &command, &out, &[&reports[0], &reports[1]], 1);
}

#[test]
fn a_fine_tuning_killed_at_random_ends_at_the_same_bytes() {
    if !has_gpu() {
        return;
    }
    let capture = small_capture(300, 3);
    let out = capture.path("out.gs4d");
    let command = arguments![
        "finetune",
        &capture.scene,
        "--data",
        &capture.data,
        "-o",
        &out,
        "--steps",
        "40",
        "--evaluate-every",
        "5",
        "--save-every",
        "5",
        "--compress",
        "balanced",
        "--compress-steps",
        "20"
    ];
    resumed_runs_equal("finetune", &command, &out, &[], 2);
}

#[test]
fn a_training_from_pictures_alone_killed_at_random_ends_at_the_same_bytes() {
    if !has_gpu() {
        return;
    }
    let capture = small_capture(300, 3);
    let out = capture.path("out.gs4d");
    let command = arguments![
        "train",
        "--data",
        &capture.data,
        "-o",
        &out,
        "--gaussians",
        "200",
        "--steps",
        "60",
        "--relocate-every",
        "10",
        "--evaluate-every",
        "5",
        "--save-every",
        "5"
    ];
    resumed_runs_equal("train", &command, &out, &[], 2);
}
