//! The examples as programs: what they write without a window, and how they take wrong arguments.
//!
//! In: the examples that `cargo test` has built beside the tests. Out: proof that each writes as many pictures as it is asked for and
//! ends well, that there is something on them, and that it moves. Drawing is skipped where there is no GPU, not even a software one.

#[path = "common/skip.rs"]
mod skip;

use bevy_gs4d::testing::{TestingError, has_gpu};
use image::RgbaImage;
use skip::skip;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const EXAMPLES: [&str; 5] = ["minimal", "play", "timeline", "walkthrough", "headless"];

/// Tests are in `deps`, beside `examples`.
fn program(example: &str) -> PathBuf {
    let test = std::env::current_exe().expect("tests know where they are");
    let folder = test.ancestors().nth(2).expect("tests are in a folder of the target folder").join("examples");
    let program = folder.join(format!("{example}{}", std::env::consts::EXE_SUFFIX));
    assert!(
        program.is_file(),
        "{} is missing: plain `cargo test` builds the examples, `cargo test --test` does not; \
         `cargo build --examples --features viewer` does",
        program.display()
    );
    program
}

fn run(example: &str, arguments: &[&str]) -> Output {
    let root = env!("CARGO_MANIFEST_DIR");
    let mut command = Command::new(program(example));
    command.args(arguments).current_dir(root).env("BEVY_ASSET_ROOT", root);
    command.output().unwrap_or_else(|error| panic!("{example} can be started: {error}"))
}

/// What an example writes without a window, in the order of the names, `frames` moments.
fn pictures(example: &str, options: &[&str], frames: usize) -> Option<Vec<RgbaImage>> {
    if !has_gpu() {
        skip(TestingError::NoGpu);
        return None;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("pictures");
    let (target_name, count) = (target.to_str().expect("temporary folders have plain names"), frames.to_string());
    let output = run(example, &[&["--headless", target_name, "--frames", &count][..], options].concat());
    let said = [&output.stdout, &output.stderr].map(|said| String::from_utf8_lossy(said).into_owned()).concat();
    assert!(output.status.success(), "{example} ended with {}:\n{said}", output.status);
    assert!(said.contains(target_name), "{example} says where the pictures are:\n{said}");
    Some(read(&target))
}

fn read(folder: &Path) -> Vec<RgbaImage> {
    let entries = std::fs::read_dir(folder).expect("the folder has been made");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a file").path()).collect();
    paths.sort();
    assert!(
        paths.iter().all(|path| path.extension().is_some_and(|end| end == "png")),
        "nothing but pictures: {paths:?}"
    );
    paths.iter().map(|path| image::open(path).expect("a whole picture").into_rgba8()).collect()
}

/// Draws two moments and looks at them.
fn check(example: &str, options: &[&str], expected: usize) {
    let Some(pictures) = pictures(example, options, 2) else { return };
    assert_eq!(pictures.len(), expected, "{example} writes as many pictures as it is asked for");
    for picture in &pictures {
        let first = picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|pixel| pixel != first), "{example} shows more than one colour");
    }
    for pair in pictures.windows(2) {
        assert!(pair[0] != pair[1], "{example} shows something that moves");
    }
}

#[test]
fn minimal_writes_pictures() {
    check("minimal", &[], 2);
}

#[test]
fn play_writes_pictures() {
    check("play", &[], 2);
}

#[test]
fn timeline_writes_pictures() {
    check("timeline", &[], 2);
}

#[test]
fn walkthrough_writes_pictures() {
    check("walkthrough", &[], 2);
}

#[test]
fn walkthrough_writes_pairs_of_pictures() {
    check("walkthrough", &["--two-targets"], 4);
}

#[test]
fn headless_writes_pictures() {
    check("headless", &["--size", "200x120"], 2);
}

#[test]
fn wrong_arguments_are_named() {
    for example in EXAMPLES {
        for (arguments, named) in [
            (&["--nonsense"][..], "--nonsense"),
            (&["--headless"][..], "--headless"),
            (&["--frames", "many"][..], "many"),
            (&["one.gs4d", "two.gs4d"][..], "two.gs4d"),
        ] {
            let output = run(example, arguments);
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(!output.status.success(), "{example} {arguments:?} is an error");
            assert!(said.contains(named), "{example} {arguments:?} names what is wrong:\n{said}");
        }
    }
}

#[test]
fn help_says_what_there_is_to_see_and_how_to_call_it() {
    for example in EXAMPLES {
        let output = run(example, &["--help"]);
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{example} --help ends with {}", output.status);
        for expected in ["--headless", "--frames", &format!("--example {example}")] {
            assert!(said.contains(expected), "{example} --help mentions {expected}:\n{said}");
        }
    }
}
