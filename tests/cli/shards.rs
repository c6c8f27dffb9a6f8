//! `gs4d score`, `mask` and `eval` with `--shard` and `--merge`.
//!
//! In: a small synthetic scene, its own pictures as a dataset. Out: proof that the parts of all shards give the results
//! of one computation, that a part that is there is not made again, that parts that do not belong together are refused
//! by name, and that a part is whole or absent if its run is killed or the disk is full.

use crate::support::capture::Capture;
use crate::support::command::{GS4D, Run, arguments, gs4d};
use crate::support::folders::names;
use crate::support::random::Random;
use crate::support::small_capture::small_capture;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::Instant;

/// Returns a scene and its dataset: four cameras at five times.
fn capture() -> Capture {
    small_capture(400, 5)
}

impl Capture {
    /// Returns the arguments of a verb with the scene, the dataset and `more`, on the CPU.
    fn verb(&self, verb: &str, more: &[&str]) -> Vec<OsString> {
        let fixed = arguments![verb, &self.scene, "--data", &self.data, "--engine", "cpu"];
        fixed.into_iter().chain(more.iter().map(OsString::from)).collect()
    }

    /// Makes the parts of all shards of a verb. Returns their paths.
    fn parts(&self, name: &str, verb: &str, more: &[&str], count: usize) -> Vec<PathBuf> {
        let part = |index: usize| {
            let (path, shard) = (self.path(&format!("{name}-{index}.gs4p")), format!("{index}/{count}"));
            gs4d(&[self.verb(verb, more), arguments!["--shard", shard, "-o", &path].to_vec()].concat()).text();
            path
        };
        (0..count).map(part).collect()
    }
}

fn merging(parts: &[PathBuf]) -> Vec<OsString> {
    [OsString::from("--merge")].into_iter().chain(parts.iter().map(OsString::from)).collect()
}

/// Returns the scores of a file.
fn scores(path: &Path) -> Vec<f32> {
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    bytes.as_chunks().0.iter().map(|&four| f32::from_le_bytes(four)).collect()
}

#[test]
fn the_scores_of_all_shards_are_those_of_all_views() {
    let capture = capture();
    let whole = capture.path("whole");
    gs4d(&[capture.verb("score", &["--variant", "all"]), arguments!["-o", &whole].to_vec()].concat()).text();
    assert_eq!(names(&whole).len(), 12, "a file for each score");
    // Fewer shards than times, and more.
    for count in [1, 3, 4, 7] {
        let parts = capture.parts(&format!("of{count}"), "score", &["--variant", "all"], count);
        let [alone, checked] = ["alone", "checked"].map(|name| capture.path(&format!("{name}{count}")));
        // The shards may be named in any order.
        let reversed: Vec<PathBuf> = parts.iter().rev().cloned().collect();
        let fixed = arguments!["score", "--variant", "all", "-o", &alone].to_vec();
        gs4d(&[fixed, merging(&reversed)].concat()).text();
        let fixed = capture.verb("score", &["--variant", "all"]);
        gs4d(&[fixed, arguments!["-o", &checked].to_vec(), merging(&parts)].concat()).text();
        for name in names(&whole) {
            let expected = scores(&whole.join(&name));
            assert!(expected.iter().any(|score| *score > 0.0), "{name} has scores");
            for merged in [&alone, &checked] {
                let found = scores(&merged.join(&name));
                let apart = found.iter().zip(&expected).map(|(a, b)| a.to_bits().abs_diff(b.to_bits())).max();
                assert_eq!((found.len(), apart), (expected.len(), Some(0)), "{name} of {count} shards: the same bits");
            }
        }
    }
}

#[test]
fn the_best_score_of_all_shards_is_that_of_all_views() {
    let capture = capture();
    let [whole, merged] = ["whole.f32", "merged.f32"].map(|name| capture.path(name));
    let run = |more: Vec<OsString>| {
        let mut json = gs4d(&[capture.verb("score", &["--json"]), more].concat()).json();
        ["seconds", "files"].iter().for_each(|name| drop(json[*name].take()));
        json
    };
    let expected = run(arguments!["-o", &whole].to_vec());
    let parts = capture.parts("auto", "score", &[], 3);
    let found = run([arguments!["-o", &merged].to_vec(), merging(&parts)].concat());
    assert_eq!(found, expected, "the same contest");
    assert_eq!(scores(&merged), scores(&whole), "the same scores");
    let alone = gs4d(&[arguments!["score", "-o", &merged].to_vec(), merging(&parts)].concat());
    alone.must_fail("auto draws views to compare scores");
}

#[test]
fn the_masks_of_all_shards_are_those_of_all_views() {
    let capture = capture();
    for filter in ["interval", "key-frame"] {
        let options = ["--filter", filter, "--key-frames", "4"];
        let [whole, merged] = ["whole.gs4d", "merged.gs4d"].map(|name| capture.path(name));
        gs4d(&[capture.verb("mask", &options), arguments!["-o", &whole].to_vec()].concat()).text();
        let parts = capture.parts(filter, "mask", &options, 5);
        gs4d(&[capture.verb("mask", &options), arguments!["-o", &merged].to_vec(), merging(&parts)].concat()).text();
        let [whole, merged] = [whole, merged].map(|path| fs::read(path).expect("the package"));
        assert!(whole == merged, "{filter}: the same package");
    }
    let none = gs4d(&arguments!["mask", &capture.scene, "-o", capture.path("support.gs4p"), "--shard", "0/2"]);
    none.must_fail("--shard has no effect with --filter support");
}

#[test]
fn the_evaluation_of_all_shards_is_that_of_all_views() {
    let capture = capture();
    // The first image has gaps, so that all views are measured over two backgrounds.
    let path = capture.data.join("test").join("c00_00.png");
    let mut image = image::open(&path).expect("a picture").into_rgba8();
    image.pixels_mut().take(300).for_each(|pixel| pixel.0 = [0; 4]);
    image.save(&path).expect("the folder can be written to");
    let evaluate = |more: Vec<OsString>| {
        let mut json = gs4d(&[capture.verb("eval", &["--json"]), more].concat()).json();
        json["seconds"].take();
        json
    };
    let whole = evaluate(Vec::new());
    assert!(whole["contrast"]["psnr"].is_f64() && whole["views"].as_array().is_some_and(|views| views.len() == 10));
    for count in [2, 4, 13] {
        let parts = capture.parts(&format!("of{count}"), "eval", &[], count);
        assert_eq!(evaluate(merging(&parts)), whole, "{count} shards");
    }
}

#[test]
fn a_part_that_is_there_is_not_made_again() {
    let capture = capture();
    let out = capture.path("part.gs4p");
    let shard = |more: &[&str]| {
        let run = [capture.verb("score", more), arguments!["--shard", "1/3", "-o", &out, "--json"].to_vec()].concat();
        gs4d(&run).json()["was_there"].as_bool().expect("a word of the report")
    };
    assert!(!shard(&["--variant", "full"]), "there is none at first");
    let (bytes, written) = (fs::read(&out).expect("the part"), fs::metadata(&out).expect("the part").modified().ok());
    assert!(shard(&["--variant", "full"]), "the same inputs");
    assert!(shard(&["--variant", "energy"]), "a part has the sums of all scores");
    assert_eq!(fs::metadata(&out).expect("the part").modified().ok(), written, "the file is left as it is");
    assert!(!shard(&["--variant", "full", "--volume-power", "0.5"]), "other settings");
    assert_ne!(fs::read(&out).expect("the part"), bytes, "another part");
    fs::write(&out, &bytes[..bytes.len() / 2]).expect("the folder can be written to");
    assert!(!shard(&["--variant", "full"]), "a part that is cut off");
    assert_eq!(fs::read(&out).expect("the part"), bytes, "the same inputs give the same bytes");
    // The folder of the dataset may be at another place.
    let moved = capture.path("moved");
    fs::rename(&capture.data, &moved).expect("the folder can be written to");
    let fixed = arguments!["score", &capture.scene, "--data", &moved, "--engine", "cpu", "--variant", "full"];
    let more = arguments!["--shard", "1/3", "-o", &out, "--json"];
    assert_eq!(gs4d(&[fixed.to_vec(), more.to_vec()].concat()).json()["was_there"], true, "the same contents");
}

#[test]
fn parts_that_do_not_belong_together_are_refused_by_name() {
    let capture = capture();
    let full = ["--variant", "full"];
    let parts = capture.parts("part", "score", &full, 3);
    let other = capture.parts("other", "score", &["--variant", "full", "--volume-power", "0.3"], 3);
    let fewer = capture.parts("fewer", "score", &full, 2);
    let masks = capture.parts("masks", "mask", &["--filter", "interval"], 1);
    let out = capture.path("merged.f32");
    fs::write(&out, b"the old file").expect("the folder can be written to");
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    let refused = |parts: &[&PathBuf], words: &[&str]| {
        let parts: Vec<PathBuf> = parts.iter().copied().cloned().collect();
        let fixed = arguments!["score", "--variant", "full", "-o", &out].to_vec();
        for fixed in [fixed, [capture.verb("score", &full), arguments!["-o", &out].to_vec()].concat()] {
            let run = gs4d(&[fixed, merging(&parts)].concat());
            words.iter().for_each(|word| run.must_fail(word));
        }
    };
    refused(&[&parts[0], &parts[2]], &["1/3 is missing"]);
    refused(&[&parts[0], &parts[1], &parts[2], &parts[1]], &[&name(&parts[1]), "shard 1/3 once more"]);
    refused(&[&parts[0], &other[1], &parts[2]], &[&name(&other[1]), "another power of the volume: 0.3, not 0.1"]);
    refused(&[&parts[0], &fewer[1]], &[&name(&fewer[1]), "is one of 2 shards, not of 3"]);
    refused(&[&parts[0], &masks[0]], &[&name(&masks[0]), "is a part of gs4d mask, not of gs4d score"]);
    refused(&[&parts[0], &capture.scene], &["scene.gs4d: is no part of gs4d"]);
    let damaged = capture.path("damaged.gs4p");
    let mut bytes = fs::read(&parts[1]).expect("the part");
    *bytes.last_mut().expect("bytes") ^= 1;
    fs::write(&damaged, bytes).expect("the folder can be written to");
    refused(&[&parts[0], &damaged, &parts[2]], &["damaged.gs4p: is damaged or cut off"]);
    refused(&[&parts[0], &capture.path("nowhere.gs4p"), &parts[2]], &["nowhere.gs4p"]);
    // Parts of another scene are found if the checkpoint is given.
    let fixed = [capture.verb("score", &["--variant", "full"]), arguments!["--views", "10", "-o", &out].to_vec()];
    gs4d(&[fixed.concat(), merging(&parts)].concat())
        .must_fail("another number of views: all, not 10, as this command");
    assert_eq!(fs::read(&out).expect("the file"), b"the old file", "nothing has been written");
    let run = gs4d(&[capture.verb("score", &full), arguments!["--shard", "3/3", "-o", &out].to_vec()].concat());
    assert!(run.code == Some(2) && run.err.contains("from 0/N to N-1/N"), "there is no such shard: {}", run.err);
    let run = gs4d(&[capture.verb("eval", &[]), arguments!["--shard", "0/3"].to_vec()].concat());
    run.must_fail("name the part to write");
}

#[test]
fn a_part_is_whole_or_absent_after_a_kill_and_on_a_full_disk() {
    let capture = capture();
    let whole = fs::read(&capture.parts("whole", "score", &["--variant", "full"], 1)[0]).expect("the part");
    let folder = capture.path("killed");
    fs::create_dir(&folder).expect("the folder can be written to");
    let out = folder.join("part.gs4p");
    let command =
        [capture.verb("score", &["--variant", "full"]), arguments!["--shard", "0/1", "-o", &out].to_vec()].concat();
    let start = Instant::now();
    gs4d(&command).text();
    let (longest, mut random) = (start.elapsed(), Random::new(3));
    let spawn = || {
        let mut child = Command::new(GS4D);
        child.args(&command).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        child.spawn().expect("the command starts")
    };
    for _ in 0..8 {
        fs::remove_file(&out).ok();
        let mut child = spawn();
        thread::sleep(longest.mul_f64(random.below(1000) as f64 / 1000.0));
        child.kill().ok();
        child.wait().expect("the child can be waited for");
        assert!(!out.exists() || fs::read(&out).expect("the part") == whole, "whole or absent");
    }
    // Two runs of the same shard at once.
    fs::remove_file(&out).ok();
    let mut both = [spawn(), spawn()];
    let codes = both.each_mut().map(|child| child.wait().expect("the child can be waited for").code());
    assert_eq!(codes, [Some(0); 2], "both end well");
    assert!(fs::read(&out).expect("the part") == whole, "at the same bytes");
    assert_eq!(names(&folder), ["part.gs4p"], "no temporary file is left");
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"", GS4D]);
    let other = ["--volume-power", "0.7"].map(OsString::from);
    let run = Run::of(&shell.args(&command).args(other).output().expect("the shell starts"));
    run.must_fail("part.gs4p");
    assert!(fs::read(&out).expect("the part") == whole, "the old part stays on a full disk");
    assert_eq!(names(&folder), ["part.gs4p"], "no temporary file is left");
}
