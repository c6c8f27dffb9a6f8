//! The examples as programs: the pictures that they write without a window, and their errors for wrong arguments.
//!
//! In: the examples that `cargo test` has built with the tests. Out: proof that each example exits with success and
//! writes the requested number of pictures, that the pictures show captures, and that the captures move. Tests that
//! draw are skipped without a GPU; a software driver is enough.

use crate::support::no_gpu::no_gpu;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::offline;
use bevy_gs4d::scene::GaussianScene;
use bevy_gs4d::testing::has_gpu;
use image::RgbaImage;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

const EXAMPLES: [&str; 9] =
    ["minimal", "play", "scene", "timeline", "walkthrough", "headless", "budget", "sound", "sockets"];

/// Returns the path of an example: tests are in the folder `deps` next to `examples`.
fn program(example: &str) -> PathBuf {
    let test = std::env::current_exe().expect("the path of the test binary");
    let folder = test.ancestors().nth(2).expect("tests are in a subfolder of the target folder").join("examples");
    let program = folder.join(format!("{example}{}", std::env::consts::EXE_SUFFIX));
    assert!(
        program.is_file(),
        "{} is missing: plain `cargo test` builds the examples, `cargo test --test` does not; \
         `cargo build --examples --features viewer,cli` does",
        program.display()
    );
    program
}

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn run(example: &str, arguments: &[&str]) -> Output {
    run_with(Path::new(ROOT), example, arguments)
}

/// Runs an example with the folder `assets` in `root`.
fn run_with(root: &Path, example: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(program(example));
    command.args(arguments).current_dir(root).env("BEVY_ASSET_ROOT", root);
    command.output().unwrap_or_else(|error| panic!("{example} can be started: {error}"))
}

/// Returns the pictures of `frames` times that an example writes without a window, in order of their names; `None` if
/// there is no GPU.
fn pictures(root: &Path, example: &str, options: &[&str], frames: usize) -> Option<Vec<RgbaImage>> {
    if !has_gpu() {
        no_gpu();
        return None;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("pictures");
    let (target_name, count) = (target.to_str().expect("temporary folders have plain names"), frames.to_string());
    let output = run_with(root, example, &[&["--headless", target_name, "--frames", &count][..], options].concat());
    let said = [&output.stdout, &output.stderr].map(|said| String::from_utf8_lossy(said).into_owned()).concat();
    assert!(output.status.success(), "{example} ended with {}:\n{said}", output.status);
    assert!(said.contains(target_name), "{example} prints the folder of the pictures:\n{said}");
    Some(read(&target))
}

fn read(folder: &Path) -> Vec<RgbaImage> {
    let entries = std::fs::read_dir(folder).expect("the folder has been made");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a file").path()).collect();
    paths.sort();
    assert!(
        paths.iter().all(|path| path.extension().is_some_and(|end| end == "png")),
        "all files are pictures: {paths:?}"
    );
    paths.iter().map(|path| image::open(path).expect("a readable picture").into_rgba8()).collect()
}

/// Returns the fraction of pixels that differ between two pictures.
fn differing(a: &RgbaImage, b: &RgbaImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions(), "the pictures have the same size");
    let differ = a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count();
    differ as f64 / f64::from(a.width() * a.height())
}

/// Checks the pictures of an example.
fn check(example: &str, pictures: &[RgbaImage], expected: usize) {
    assert_eq!(pictures.len(), expected, "{example} writes the requested number of pictures");
    for picture in pictures {
        let first = picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|pixel| pixel != first), "the picture of {example} has more than one color");
    }
    for pair in pictures.windows(2) {
        let fraction = differing(&pair[0], &pair[1]);
        assert!(fraction > 0.001, "the picture of {example} changes over time: {fraction} of the pixels");
    }
}

/// Draws two times and checks the pictures.
fn draw(example: &str, options: &[&str], expected: usize) {
    let Some(pictures) = pictures(Path::new(ROOT), example, options, 2) else { return };
    check(example, &pictures, expected);
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it"]
fn walkthrough_writes_pairs_of_pictures() {
    draw("walkthrough", &["--two-targets"], 4);
}

#[test]
fn headless_writes_pictures() {
    draw("headless", &["--size", "200x120"], 2);
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it"]
fn budget_writes_pictures() {
    draw("budget", &["--size", "160x90", "--copies", "2", "--settle", "4"], 2);
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it"]
fn sockets_hold_violet_hats_that_move() {
    let violet = |picture: &RgbaImage| {
        let violet = picture.enumerate_pixels().filter(|(.., pixel)| {
            let [red, green, blue, _] = pixel.0;
            blue > 100 && blue > red && red > blue / 3 && green < red / 2
        });
        violet.map(|(x, y, _)| (x, y)).collect::<Vec<_>>()
    };
    let Some(pictures) = pictures(Path::new(ROOT), "sockets", &[], 2) else { return };
    check("sockets", &pictures, 2);
    let [first, second] = [0, 1].map(|index| violet(&pictures[index]));
    assert!(first.len() > 150, "three hats are seen, in {} pixels", first.len());
    let moved = first.iter().filter(|pixel| !second.contains(pixel)).count();
    assert!(moved > 20 && moved < first.len(), "those on the lanterns move: {moved} of {} pixels", first.len());
}

#[test]
fn sockets_says_how_a_capture_gets_them() {
    if !has_gpu() {
        no_gpu();
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("pictures");
    let target = target.to_str().expect("temporary folders have plain names");
    for (place, named) in [("", "gs4d socket"), ("50,0,0,0.5", "the point 50,0,0 at 0.5"), ("1,2", "X,Y,Z,T")] {
        let places: &[&str] = if place.is_empty() { &[] } else { &["--place", place] };
        let output = run("sockets", &[&["toybox.gs4d", "--headless", target][..], places].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "sockets --place {place} fails");
        assert!(
            said.lines().any(|line| line.starts_with("Error") && line.contains(named)),
            "sockets --place {place} says what to do:\n{said}"
        );
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it"]
fn stream_measures_chunk_files_and_writes_pictures() {
    if !has_gpu() {
        no_gpu();
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("temporary folders have plain names").to_owned();
    let [whole, chunks, target] = ["long.gs4d", "chunks", "pictures"].map(path);
    for arguments in [
        vec!["synth", whole.as_str(), "--count", "6000", "--duration", "4", "--sh-degree", "0"],
        vec!["split", whole.as_str(), "-o", chunks.as_str(), "--chunk", "0.5"],
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_gs4d")).args(&arguments).output().expect("the command starts");
        assert!(output.status.success(), "gs4d {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let index = Path::new(&chunks).join("index.gs4d");
    let index = index.to_str().expect("temporary folders have plain names");
    let measured = ["--link", "80", "--latency", "5", "--seconds", "1", "--size", "160x90", "--whole", whole.as_str()];
    let output = run("stream", &[&[index, "--headless", target.as_str(), "--frames", "2"][..], &measured].concat());
    let said = [&output.stdout, &output.stderr].map(|said| String::from_utf8_lossy(said).into_owned()).concat();
    assert!(output.status.success(), "stream ended with {}:\n{said}", output.status);
    let result = said.lines().find(|line| line.starts_with("result: "));
    assert!(result.is_some_and(|result| result.contains(" failures=0")), "all figures are in one line:\n{said}");
    assert!(said.contains("first picture (coarse)"), "the time of the first picture:\n{said}");
    check("stream", &read(Path::new(&target)), 2);
}

#[test]
fn stream_says_what_makes_an_index() {
    for (arguments, named) in [(&[][..], "gs4d split"), (&["--link", "none"][..], "--link none")] {
        let output = run("stream", arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "stream {arguments:?} fails");
        assert!(said.contains(named) && !said.contains("panicked"), "stream {arguments:?} says what to do:\n{said}");
    }
    let output = run("stream", &["--help"]);
    assert!(output.status.success(), "stream --help ends with {}", output.status);
    assert!(String::from_utf8_lossy(&output.stdout).contains("--link MBIT"), "the help has the options");
}

/// Returns a folder with the assets of the crate, except that the captures are fully transparent. Their durations and
/// bounds are unchanged.
fn invisible() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (from, to) = (Path::new(ROOT).join("assets"), folder.path().join("assets"));
    std::fs::create_dir(&to).expect("the folder can be written to");
    std::fs::copy(from.join("demo.timeline.ron"), to.join("demo.timeline.ron")).expect("the timeline can be copied");
    for name in ["toybox.gs4d", "island.gs4d"] {
        let scene = codec::load(&from.join(name), &ReadOptions::default()).expect("a bundled capture");
        let mut scene = scene.unpacked().into_runtime().expect("it can be drawn");
        for gaussian in &mut scene.form.as_sliced_mut().expect("unpacked").gaussians {
            gaussian.opacity = 0.0;
        }
        let scene = GaussianScene::from(scene);
        offline::work::save(&to.join(name), &scene, &WriteSettings { level: 1 }).expect("the folder can be written to");
    }
    folder
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it"]
fn every_example_writes_pictures_that_show_its_captures_and_change() {
    let invisible = invisible();
    // A capture that is transparent has nothing that a socket can follow.
    for example in EXAMPLES.into_iter().filter(|&example| example != "sockets") {
        let roots = [Path::new(ROOT), invisible.path()];
        // In the first picture the timeline's capture has not yet faded in.
        let frames = if example == "timeline" { 4 } else { 2 };
        let options: &[&str] = if example == "budget" { &["--settle", "2"] } else { &[] };
        let [Some(seen), Some(unseen)] = roots.map(|root| pictures(root, example, options, frames)) else { return };
        check(example, &seen, frames);
        let fraction = differing(&seen[frames - 1], &unseen[frames - 1]);
        assert!(fraction > 0.01, "{example} shows its captures: without them {fraction} of the pixels differ");
        assert!(fraction < 0.9, "{example} also shows other objects: {fraction} of the pixels differ");
    }
}

#[test]
fn errors_name_a_missing_file() {
    if !has_gpu() {
        no_gpu();
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("pictures");
    let target_name = target.to_str().expect("temporary folders have plain names");
    for example in EXAMPLES {
        let file = if example == "timeline" { "there-is-none.timeline.ron" } else { "there-is-none.gs4d" };
        let output = run(example, &["--headless", target_name, "--frames", "1", file]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{example} fails without its file");
        assert!(
            said.lines().any(|line| line.starts_with("Error") && line.contains(file)),
            "{example} names the file:\n{said}"
        );
        assert!(!said.contains("panicked"), "{example} does not panic:\n{said}");
        assert!(!target.exists(), "{example} writes no pictures");
    }
}

#[test]
fn errors_name_wrong_arguments() {
    for example in EXAMPLES {
        for (arguments, named) in [
            (&["--nonsense"][..], "--nonsense"),
            (&["--headless"][..], "--headless"),
            (&["--frames", "many"][..], "many"),
            (&["one.gs4d", "two.gs4d"][..], "two.gs4d"),
        ] {
            let output = run(example, arguments);
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(!output.status.success(), "{example} {arguments:?} fails");
            assert!(said.contains(named), "{example} {arguments:?} names the wrong argument:\n{said}");
        }
    }
}

#[test]
fn the_option_edits_of_play_needs_a_file() {
    let output = run("play", &["--edits"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "play fails without the file");
    assert!(said.contains("--edits needs a file"), "play says what is missing:\n{said}");
}

#[test]
fn the_example_film_refuses_wrong_arguments_and_has_help() {
    let used = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(used.path().join("notes.txt"), "mine").expect("the folder can be written to");
    let used = used.path().to_str().expect("temporary folders have plain names");
    for (arguments, named) in [
        (&["--nonsense"][..], "--nonsense"),
        (&["--times"], "--times needs a value"),
        (&["--size", "8y8"], "--size 8y8"),
        (&["--rig", "ball"], "hemisphere and grid"),
        (&["--test-at", "2"], "--test-at 2"),
        (&["--cameras", "many"], "--cameras many"),
        (&["one", "two"], "two: more than one folder"),
        (&["none", "--cameras", "0"], "at least one camera"),
        (&[used, "--cameras", "1"], "name a new folder"),
    ] {
        let output = run("film", arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "film {arguments:?} fails");
        assert!(said.contains(named), "film {arguments:?} names the wrong argument:\n{said}");
        assert!(!said.contains("panicked"), "film {arguments:?} does not panic:\n{said}");
    }
    let output = run("film", &["--help"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "film --help ends with {}", output.status);
    for expected in ["--test-at", "--example film", "island.sh"] {
        assert!(said.contains(expected), "film --help mentions {expected}:\n{said}");
    }
}

#[test]
fn help_lists_options_and_the_command() {
    for example in EXAMPLES {
        let output = run(example, &["--help"]);
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{example} --help ends with {}", output.status);
        for expected in ["--headless", "--frames", &format!("--example {example}")] {
            assert!(said.contains(expected), "{example} --help mentions {expected}:\n{said}");
        }
    }
}
