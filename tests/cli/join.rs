//! `gs4d join` and `gs4d split`, run as a user runs them.
//!
//! In: synthetic segments. Out: proof that a joined capture looks like each segment within its time and shows nothing of
//! another one, that it is not larger than its segments, that its chunk files are the same capture, and that files which
//! cannot be joined or split are refused with a remedy that works.

use crate::support::command::{arguments, folder, gs4d};
use crate::support::folders::{contents, names};
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::reference;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Background, Camera, Picture, RasterFov};
use glam::{UVec2, Vec3};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Gaussians of each segment.
const COUNT: usize = 600;

/// Writes segments of one second each, with their indices as seeds. Returns their paths.
fn segments(folder: &TempDir, number: usize) -> Vec<PathBuf> {
    let write = |index: usize| {
        let path = folder.path().join(format!("part-{index}.gs4d"));
        let (count, seed) = (COUNT.to_string(), (index + 1).to_string());
        gs4d(&arguments!["synth", &path, "--count", count, "--seed", seed, "--duration", "1"]).text();
        path
    };
    (0..number).map(write).collect()
}

/// Runs `gs4d join` on paths. Returns the joined package and the report.
fn joined(folder: &TempDir, parts: &[PathBuf], name: &str, more: &[&str]) -> (PathBuf, serde_json::Value) {
    let out = folder.path().join(name);
    let mut command = arguments!["join", "-o", &out, "--json"].to_vec();
    command.extend(parts.iter().map(Into::into));
    command.extend(more.iter().map(Into::into));
    let report = gs4d(&command).json();
    (out, report)
}

fn read(path: &Path) -> RuntimeScene {
    let scene = codec::load(path, &ReadOptions::default()).expect("the package can be read");
    scene.into_runtime().expect("every Gaussian can be drawn")
}

fn picture(scene: &RuntimeScene, time: f32) -> Picture {
    let camera = Camera::look_at(Vec3::new(2.2, 0.6, 1.4), Vec3::Z * 0.1, Vec3::Z, 0.8, UVec2::new(64, 48));
    reference::render(scene, &camera.view(time, RasterFov::Corrected), Background::Color([0.0; 3])).picture
}

fn psnr(a: &Picture, b: &Picture) -> f64 {
    SquaredError::of(a, b).expect("one size").psnr()
}

fn size(path: &Path) -> u64 {
    fs::metadata(path).expect("the file exists").len()
}

#[test]
fn each_segment_of_a_joined_capture_looks_as_alone() {
    let folder = folder();
    let parts = segments(&folder, 3);
    let (out, report) = joined(&folder, &parts, "long.gs4d", &[]);
    assert_eq!((&report["gaussians"], &report["duration_seconds"]), (&1800.into(), &3.0.into()), "of all: {report}");
    assert_eq!(report["exact"], true, "equal lengths have exact seams");
    assert_eq!(report["segments"][2]["interval"], serde_json::json!([2.0, 3.0]), "the third begins after the second");
    let sum: u64 = parts.iter().map(|part| size(part)).sum();
    assert_eq!((&report["bytes_in"], &report["bytes_out"]), (&sum.into(), &size(&out).into()), "the sizes");
    assert!(size(&out) as f64 <= 1.02 * sum as f64, "{} bytes of {sum}", size(&out));

    let whole = read(&out);
    let filter = whole.filter.as_ref().expect("windows of time");
    for (index, part) in parts.iter().enumerate() {
        let alone = read(part);
        for time in [0.125, 0.5, 0.875] {
            let at = index as f32 + time;
            let found = psnr(&picture(&alone, time), &picture(&whole, at));
            assert!(found >= 80.0, "{found} dB at {time} of segment {index}");
            let segment = filter.segment_of(at, whole.trained_with.time_interval);
            let is_own = |gaussian: &usize| gaussian / COUNT == index;
            let mut active = (0..whole.len()).filter(|&gaussian| filter.is_active(segment, gaussian));
            assert!(active.all(|gaussian| is_own(&gaussian)), "only Gaussians of segment {index} are active at {at}");
        }
    }
    // The last moment before a seam, and the first after it.
    let (before, after) = (1.0_f32.next_down(), 1.0 + 1e-5);
    for (time, own) in [(before, 0), (after, 1)] {
        let segment = filter.segment_of(time, whole.trained_with.time_interval);
        let mut active = (0..whole.len()).filter(|&gaussian| filter.is_active(segment, gaussian));
        assert!(active.all(|gaussian| gaussian / COUNT == own), "only Gaussians of segment {own} at {time}");
    }
}

#[test]
fn chunks_are_the_same_capture() {
    let folder = folder();
    let parts = segments(&folder, 2);
    let (long, _) = joined(&folder, &parts, "long.gs4d", &[]);
    let [chunks, finer] = ["chunks", "finer"].map(|name| folder.path().join(name));
    let report = gs4d(&arguments!["split", &long, "-o", &chunks, "--json"]).json();
    let of_report = |fact: &str| -> Vec<_> {
        report["chunks"].as_array().expect("chunks").iter().map(|chunk| chunk[fact].clone()).collect()
    };
    assert_eq!(report["gaussians"], 1200, "all Gaussians");
    assert_eq!(of_report("gaussians"), [600, 600], "a chunk of a second is a segment");
    assert_eq!(names(&chunks), ["chunk-00001-of-00002.gs4d", "chunk-00002-of-00002.gs4d"], "the files");
    let first = gs4d(&arguments!["info", chunks.join("chunk-00001-of-00002.gs4d"), "--json"]).json();
    assert_eq!(first["gaussians"], 600, "each is a package");

    let (back, report) = joined(&folder, std::slice::from_ref(&chunks), "back.gs4d", &[]);
    assert_eq!(report["gaussians"], 1200, "as many as before");
    assert!(fs::read(&back).ok() == fs::read(&long).ok(), "the same bytes");
    let files: Vec<PathBuf> = contents(&chunks).into_keys().collect();
    let (again, _) = joined(&folder, &files, "again.gs4d", &[]);
    assert!(fs::read(&again).ok() == fs::read(&long).ok(), "the same bytes if each file is named");

    // Runs of several lengths change the order of Gaussians, and no picture.
    gs4d(&arguments!["split", &long, "-o", &finer, "--chunk", "0.25"]).text();
    assert!(names(&finer).len() > 2, "several runs: {:?}", names(&finer));
    let (other, report) = joined(&folder, std::slice::from_ref(&finer), "other.gs4d", &[]);
    assert_eq!(report["gaussians"], 1200, "as many as before");
    let [whole, other] = [&long, &other].map(|path| read(path));
    for time in [0.3, 0.95, 1.05, 1.7] {
        let found = psnr(&picture(&whole, time), &picture(&other, time));
        assert!(found >= 80.0, "{found} dB at {time}");
    }
}

#[test]
fn what_cannot_be_joined_or_split_is_refused_with_a_remedy() {
    let folder = folder();
    let parts = segments(&folder, 2);
    let path = |name: &str| folder.path().join(name);
    let out = path("out.gs4d");
    let join = |other: &Path| gs4d(&arguments!["join", &parts[0], other, "-o", &out]);
    for (name, options, refusal) in [
        ("packed.gs4d", ["compress", "--verify", "0"].as_slice(), "packed.gs4d: is packed"),
        ("up.gs4d", &["convert", "--up", "-y"], "gs4d convert --up"),
        ("color.gs4d", &["convert", "--sh-degree", "1"], "gs4d convert --sh-degree"),
        ("still.gs4d", &["convert", "--duration", "0"], "gs4d convert --duration"),
        ("slow.gs4d", &["convert", "--duration", "2"], "gs4d convert --sh-degree-t 0"),
    ] {
        let mut command = arguments![options[0], &parts[1], path(name)].to_vec();
        command.extend(options[1..].iter().map(Into::into));
        gs4d(&command).text();
        join(&path(name)).must_fail(refusal);
        assert!(!out.exists(), "{name}: no output is written");
    }
    gs4d(&arguments!["split", path("packed.gs4d"), "-o", path("chunks")]).must_fail("packed.gs4d: is packed");
    gs4d(&arguments!["join", &parts[0], "-o", &out]).must_fail("part-0.gs4d: is one segment");
    gs4d(&arguments!["join", &parts[0], &parts[1], "-o", &parts[0]]).must_fail("the input itself");
    let overlap = gs4d(&arguments!["join", &parts[0], &parts[1], "-o", &out, "--keep-times"]);
    overlap.must_fail("without --keep-times");

    // The remedy of different speeds.
    let calm = |name: &str, from: &Path| {
        gs4d(&arguments!["convert", from, path(name), "--sh-degree-t", "0"]).text();
        path(name)
    };
    let (stretched, report) =
        joined(&folder, &[calm("a.gs4d", &parts[0]), calm("b.gs4d", &path("slow.gs4d"))], "stretched.gs4d", &[]);
    assert_eq!(report["duration_seconds"], 3.0, "one second and two");
    assert_eq!(read(&stretched).trained_with.time_interval, [0.0, 3.0], "at the speed of the first");
}

#[test]
fn a_missing_chunk_is_named_and_other_chunks_are_kept() {
    let folder = folder();
    let (long, _) = joined(&folder, &segments(&folder, 2), "long.gs4d", &[]);
    let chunks = folder.path().join("chunks");
    gs4d(&arguments!["split", &long, "-o", &chunks]).text();
    gs4d(&arguments!["split", &long, "-o", &chunks, "--chunk", "9"]).must_fail("is a chunk of another split");
    gs4d(&arguments!["split", &long, "-o", &chunks]).text();
    gs4d(&arguments!["split", &long, "-o", &chunks, "--chunk", "0.0001"]).must_fail("--chunk");
    let out = folder.path().join("out.gs4d");
    gs4d(&arguments!["join", &chunks, "-o", &out, "--keep-times"]).must_fail("--keep-times has no effect");
    fs::remove_file(chunks.join("chunk-00002-of-00002.gs4d")).expect("the file exists");
    gs4d(&arguments!["join", &chunks, "-o", &out]).must_fail("chunk-00002-of-00002.gs4d is missing");
    assert!(!out.exists(), "no output is written");
}
