//! `gs4d join` and `gs4d split`, run as a user runs them.
//!
//! In: synthetic segments. Out: proof that a joined capture looks like each segment within its time and shows nothing of
//! another one, that it is not larger than its segments, that its chunk files are the same capture and in their index,
//! also packed ones, and that files which cannot be joined or split are refused with a remedy that works.

use crate::support::command::{arguments, folder, gs4d};
use crate::support::folders::{contents, names};
use crate::support::wave::wave;
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
    let report = gs4d(&arguments!["split", &long, "-o", &chunks, "--layers", "100", "--json"]).json();
    let of_report = |fact: &str| -> Vec<_> {
        report["chunks"].as_array().expect("chunks").iter().map(|chunk| chunk[fact].clone()).collect()
    };
    assert_eq!(report["gaussians"], 1200, "all Gaussians");
    assert_eq!(of_report("gaussians"), [600, 600], "a chunk of a second is a segment");
    let files = ["chunk-00001-of-00002.gs4d", "chunk-00002-of-00002.gs4d", "index.gs4d"];
    assert_eq!(names(&chunks), files, "the files and their index");
    let first = gs4d(&arguments!["info", chunks.join("chunk-00001-of-00002.gs4d"), "--json"]).json();
    assert_eq!(first["gaussians"], 600, "each is a package");

    let (back, report) = joined(&folder, std::slice::from_ref(&chunks), "back.gs4d", &[]);
    assert_eq!(report["gaussians"], 1200, "as many as before");
    assert!(fs::read(&back).ok() == fs::read(&long).ok(), "the same bytes");
    let files: Vec<PathBuf> = contents(&chunks).into_keys().collect();
    let (again, _) = joined(&folder, &files, "again.gs4d", &[]);
    assert!(fs::read(&again).ok() == fs::read(&long).ok(), "the same bytes if each file and the index is named");

    // Runs of several lengths change the order of Gaussians, and no picture.
    gs4d(&arguments!["split", &long, "-o", &finer, "--chunk", "0.25", "--layers", "100"]).text();
    assert!(names(&finer).len() > 3, "several runs, and the index: {:?}", names(&finer));
    let (other, report) = joined(&folder, std::slice::from_ref(&finer), "other.gs4d", &[]);
    assert_eq!(report["gaussians"], 1200, "as many as before");
    let [whole, other] = [&long, &other].map(|path| read(path));
    for time in [0.3, 0.95, 1.05, 1.7] {
        let found = psnr(&picture(&whole, time), &picture(&other, time));
        assert!(found >= 80.0, "{found} dB at {time}");
    }
}

#[test]
fn chunks_are_in_layers_and_the_index_lists_them() {
    let folder = folder();
    let (long, _) = joined(&folder, &segments(&folder, 2), "long.gs4d", &[]);
    let [chunks, again] = ["chunks", "again"].map(|name| folder.path().join(name));
    let report = gs4d(&arguments!["split", &long, "-o", &chunks, "--json"]).json();
    let listed = report["chunks"].as_array().expect("chunks");
    let facts: Vec<_> =
        listed.iter().map(|chunk| (&chunk["layer"], &chunk["gaussians"], &chunk["stretches"])).collect();
    let (first, second) = (serde_json::json!([0, 0]), serde_json::json!([1, 1]));
    let numbers = [0, 1, 300].map(serde_json::Value::from);
    let [zero, one, half] = &numbers;
    let expected = [(zero, half, &first), (one, half, &first), (zero, half, &second), (one, half, &second)];
    assert_eq!(facts, expected, "a quarter of 600 is few: two layers of each second");

    let index = chunks.join("index.gs4d");
    let sizes: Vec<u64> = contents(&chunks).into_keys().map(|file| size(&file)).collect();
    let sum: u64 = sizes.iter().sum();
    assert_eq!((sizes.len(), &report["bytes_out"]), (5, &sum.into()), "four files and the index");
    assert_eq!(report["index"]["bytes"], size(&index), "the size of the index");
    let coarse = size(&index) + listed[0]["bytes"].as_u64().expect("a size");
    assert_eq!(report["first_picture_bytes"], coarse, "the index, and layer 0 of the first second");
    let rates: Vec<f64> =
        report["megabits_per_second"].as_array().expect("rates").iter().filter_map(serde_json::Value::as_f64).collect();
    assert_eq!(rates.len(), 2, "of layer 0, and of both: {report}");
    assert!((rates[1] - sum as f64 * 8e-6 / 2.0).abs() < 1e-9 && rates[0] < rates[1], "all bytes in two seconds");
    let text = gs4d(&arguments!["split", &long, "-o", &chunks]).text();
    for expected in ["layer", "index.gs4d", "first picture", "Mbit/s for layer 0", "up to layer 1"] {
        assert!(text.contains(expected), "{expected} in {text}");
    }

    let info = gs4d(&arguments!["info", &index, "--json"]).json();
    let bytes = sum - size(&index);
    let expected = serde_json::json!({
        "files": 4, "stretches": 2, "layers": 2, "gaussians": 1200, "bytes": bytes, "first_byte": null, "decibels_per_megabyte": [],
    });
    assert_eq!((&info["chunks"], &info["gaussians"]), (&expected, &0.into()), "the files of an empty package: {info}");
    let text = gs4d(&arguments!["info", &index]).text();
    assert!(text.contains("the index of 4 chunk files: 1200 Gaussians in 2 layers over 2 stretches"), "{text}");
    let out = folder.path().join("out.gs4d");
    for verb in ["convert", "compress", "collide", "mask"] {
        gs4d(&arguments![verb, &index, "-o", &out]).must_fail("gs4d join FOLDER -o CAPTURE");
    }

    let (back, report) = joined(&folder, std::slice::from_ref(&chunks), "back.gs4d", &[]);
    assert_eq!(report["gaussians"], 1200, "as many as before");
    gs4d(&arguments!["split", &back, "-o", &again]).text();
    let files = |folder: &Path| contents(folder).into_values().collect::<Vec<_>>();
    assert!(files(&again) == files(&chunks), "the files of the joined chunks are the same byte for byte");
    let [whole, other] = [&long, &back].map(|path| read(path));
    let found = psnr(&picture(&whole, 0.3), &picture(&other, 0.3));
    assert!(found >= 80.0, "the order of Gaussians changes no picture: {found} dB");
}

/// Writes a synthetic capture, compressed with the order of chunks of half a second. Returns the package.
fn packed(folder: &TempDir, more: &[&str]) -> PathBuf {
    let [whole, packed] = ["whole.gs4d", "packed.gs4d"].map(|name| folder.path().join(name));
    gs4d(&arguments!["synth", &whole, "--count", "30000", "--duration", "2"]).text();
    let order = arguments!["compress", &whole, &packed, "--chunk", "0.5", "--verify", "0"].to_vec();
    gs4d(&[order, more.iter().map(Into::into).collect()].concat()).text();
    packed
}

#[test]
fn packed_chunks_are_the_package_as_it_was() {
    let folder = folder();
    for (name, colors) in [("coded", ["--codebooks", "64,64"]), ("whole", ["--quality", "visually-lossless"])] {
        let package = packed(&folder, &[&colors[..], &["--layers", "10,40,50"]].concat());
        let chunks = folder.path().join(name);
        let report = gs4d(&arguments!["split", &package, "-o", &chunks, "--json"]).json();
        let info = gs4d(&arguments!["info", &package, "--json"]).json();
        assert_eq!((&report["stretches"], &report["layers"]), (&4.into(), &3.into()), "as it was compressed: {report}");
        assert_eq!(report["gaussians"], info["gaussians"], "every Gaussian, with the fillers of blocks");
        assert_eq!((&info["runs"]["stretches"], &info["runs"]["layers"]), (&4.into(), &3.into()), "the order: {info}");
        let files: Vec<PathBuf> = contents(&chunks).into_keys().collect();
        assert!(files.len() > 5, "several runs in three layers, and the index: {files:?}");
        let bytes: u64 = files.iter().map(|file| size(file)).sum();
        // Of 30,000 Gaussians the headers of the files are a large part.
        assert!(bytes as f64 <= 1.2 * size(&package) as f64, "{name}: {bytes} of {} bytes", size(&package));

        let (back, _) = joined(&folder, std::slice::from_ref(&chunks), "back.gs4d", &[]);
        assert!(fs::read(&back).ok() == fs::read(&package).ok(), "{name}: the same bytes");
        let one = folder.path().join("one.gs4d");
        let in_one = gs4d(&arguments!["split", &package, "-o", &one, "--json"]).json();
        let mut together = fs::read(&one).expect("it is written");
        let start = in_one["chunks"][0]["first_byte"].as_u64().expect("a number") as usize;
        assert_eq!(
            (&in_one["bytes_out"], &in_one["index"]["bytes"]),
            (&together.len().into(), &start.into()),
            "{name}"
        );
        let followed: Vec<u8> = files
            .iter()
            .filter(|file| !file.ends_with("index.gs4d"))
            .fold(vec![], |all, file| [all, fs::read(file).expect("a chunk file")].concat());
        assert!(together.split_off(start) == followed, "{name}: the same chunk files follow the index");
        let (back, _) = joined(&folder, std::slice::from_ref(&one), "from-one.gs4d", &[]);
        assert!(fs::read(&back).ok() == fs::read(&package).ok(), "{name}: the package again, from one file");
        assert!(read(&one) == read(&package), "{name}: any program reads all of it");
        let info_of_one = gs4d(&arguments!["info", &one, "--json"]).json();
        assert_eq!(info_of_one["gaussians"], info["gaussians"], "{name}: the whole capture: {info_of_one}");
        assert_eq!(info_of_one["chunks"]["first_byte"], start, "{name}: and where its chunk files are");

        let alone = read(&files[0]);
        let range = alone.len() < read(&package).len();
        assert!(range && alone.chunks.is_none(), "a chunk file is a capture of some of the Gaussians");
        if name == "coded" {
            fs::remove_file(chunks.join("index.gs4d")).expect("the index is there");
            gs4d(&arguments!["info", &files[0]]).must_fail("index.gs4d");
        }
    }
}

#[test]
fn each_packed_gaussian_is_in_a_file_of_its_times() {
    let folder = folder();
    let package = packed(&folder, &["--codebooks", "64"]);
    let chunks = folder.path().join("chunks");
    let report = gs4d(&arguments!["split", &package, "-o", &chunks, "--json"]).json();
    for chunk in report["chunks"].as_array().expect("chunks") {
        let scene = read(Path::new(chunk["file"].as_str().expect("a path")));
        let [first, last] = [0, 1].map(|end| chunk["times"][end].as_f64().expect("a time"));
        let cutoff = scene.trained_with.marginal_cutoff;
        for gaussian in scene.iter() {
            let is_drawn = |time: f64| gaussian.opacity > 0.0 && gaussian.marginal(time as f32) > cutoff;
            assert!(first <= 0.0 || !is_drawn(first - 1e-4), "alive before {first}: {gaussian:?}");
            assert!(last >= 1.0 || !is_drawn(last + 1e-4), "alive after {last}: {gaussian:?}");
        }
    }
    gs4d(&arguments!["split", &package, "-o", &chunks, "--chunk", "1"]).must_fail("--chunk has no effect on a packed");
    // A lower cut-off makes all lifespans longer.
    let longer = folder.path().join("longer.gs4d");
    gs4d(&arguments!["convert", &package, &longer, "--cutoff", "0.01"]).text();
    gs4d(&arguments!["split", &longer, "-o", &chunks]).must_fail("gs4d compress --chunk");
}

#[test]
fn a_damaged_chunk_file_in_one_file_is_named() {
    let folder = folder();
    let [whole, one, sound, with_sound] =
        ["whole.gs4d", "one.gs4d", "a.wav", "with-sound.gs4d"].map(|name| folder.path().join(name));
    gs4d(&arguments!["synth", &whole, "--count", "2000", "--duration", "2"]).text();
    let text = gs4d(&arguments!["split", &whole, "-o", &one]).text();
    assert!(text.contains("chunk files in one file") && text.contains("the beginning, "), "{text}");
    gs4d(&arguments!["split", &one, "-o", &one]).must_fail("the input itself");
    let good = fs::read(&one).expect("it is written");
    let mut bad = good.clone();
    let last = bad.len() - 1;
    bad[last] ^= 1;
    fs::write(&one, &bad).expect("the folder can be written to");
    let damaged = gs4d(&arguments!["info", &one]);
    damaged.must_fail("chunk files are damaged; copy or download the package again");
    gs4d(&arguments!["convert", &one, folder.path().join("out.gs4d")]).must_fail("chunk file ");
    fs::write(&one, &good[..last]).expect("the folder can be written to");
    gs4d(&arguments!["info", &one]).must_fail("cut off");

    fs::write(&sound, wave(1, 8_000, &[0; 800])).expect("the folder can be written to");
    gs4d(&arguments!["sound", &whole, &sound, "-o", &with_sound]).text();
    gs4d(&arguments!["split", &with_sound, "-o", &one]).must_fail("gs4d sound --extract");
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
    gs4d(&arguments!["split", path("packed.gs4d"), "-o", path("chunks")]).must_fail("gs4d compress --chunk");
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
    gs4d(&arguments!["split", &long, "-o", &chunks, "--layers", "25,25"]).must_fail("100 in all");
    let named = folder.path().join("index.gs4d");
    fs::copy(&long, &named).expect("the folder can be written to");
    gs4d(&arguments!["split", &named, "-o", folder.path()]).must_fail("the input itself");
    let out = folder.path().join("out.gs4d");
    gs4d(&arguments!["join", &chunks, "-o", &out, "--keep-times"]).must_fail("--keep-times has no effect");
    fs::remove_file(chunks.join("chunk-00002-of-00004.gs4d")).expect("the file exists");
    gs4d(&arguments!["join", &chunks, "-o", &out]).must_fail("chunk-00002-of-00004.gs4d is missing");
    assert!(!out.exists(), "no output is written");
}
