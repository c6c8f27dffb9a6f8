//! Use of the page by people: with a keyboard alone, on a phone, in forced colors, inside another page, on slow
//! devices, over slow links, with broken files.
//!
//! In: the built page, Chromium, Node.js, and the programs of npm that `GS4D_WEB_TOOLS` names
//! (`examples/web/package.json`). Out: groups of checks that `people.mjs` has made, each true or what was found
//! instead.

use crate::support::skip::skip;
use crate::{browser, busy};
use bevy_gs4d::codec::package::{self, Beginning, WriteSettings};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, Packing, PlaybackHints};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Returns the results of `people.mjs`, which runs once for all tests; if it fails, all tests fail. `None` if this
/// machine lacks one of its inputs.
fn found() -> Option<&'static Value> {
    static FOUND: OnceLock<Result<Result<Value, String>, &str>> = OnceLock::new();
    let found = FOUND.get_or_init(|| {
        let folder = std::env::var_os("GS4D_WEB").ok_or("GS4D_WEB names no folder of a built page: `bash .ci/web`")?;
        let tools = std::env::var_os("GS4D_WEB_TOOLS").map(PathBuf::from).filter(|tools| tools.is_dir());
        let tools = tools.ok_or("GS4D_WEB_TOOLS names no node_modules of examples/web: `bash .ci/web` says where")?;
        let program = browser::program().ok_or("there is no Chromium: `apt-get install chromium`")?;
        Ok(run(Path::new(&folder), &tools, &program))
    });
    match found {
        Ok(found) => Some(found.as_ref().unwrap_or_else(|message| panic!("people could not try the page: {message}"))),
        Err(reason) => {
            skip(reason);
            None
        }
    }
}

fn run(folder: &Path, tools: &Path, program: &Path) -> Result<Value, String> {
    let scratch = tempfile::tempdir().map_err(|error| error.to_string())?;
    let [still, progressive] = ["still.gs4d", "progressive.gs4d"].map(|name| scratch.path().join(name));
    let (package, layer) = a_progressive();
    for (path, bytes) in [(&still, a_still()), (&progressive, package)] {
        std::fs::write(path, bytes).map_err(|error| error.to_string())?;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/web/people.mjs");
    let mut command = Command::new("node");
    command.arg(script).args([folder, tools, program]).args(std::env::var_os("GS4D_WEB_SHOTS"));
    command.env("GS4D_STILL", still).env("GS4D_PROGRESSIVE", progressive).env("GS4D_LAYER", layer.to_string());
    let output = command.env("GS4D_BUSY", busy().to_string()).output();
    let output = output.map_err(|error| format!("node does not run: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    println!("{said}");
    serde_json::from_slice(&output.stdout).map_err(|error| format!("{error}; it said: {said}"))
}

/// Returns a package whose Gaussians do not move.
fn a_still() -> Vec<u8> {
    let mut scene = synthesize(&SynthSettings { count: 2_000, ..SynthSettings::default() });
    scene.playback = PlaybackHints { duration_seconds: 0.0, ..scene.playback };
    let mut package = Vec::new();
    package::write(&mut package, &scene, &WriteSettings::default()).expect("a synthetic scene can be written");
    package
}

/// Returns a package in layers, and the bytes after which the first of them can be drawn.
fn a_progressive() -> (Vec<u8>, usize) {
    let scene = synthesize(&SynthSettings { count: 10_000, degree: 1, ..SynthSettings::default() });
    let scene = scene.into_runtime().expect("a synthetic scene can be drawn");
    let packed = scene.pack(&Packing { progressive: true, ..Packing::default() }).expect("its values fit");
    let mut package = Vec::new();
    package::write(&mut package, &GaussianScene::from(packed), &WriteSettings::default()).expect("it can be written");
    let beginning = Beginning::of(&package).expect("the header is intact").expect("the header is whole");
    let layer = *beginning.layers().first().expect("the first layer can be drawn before the others");
    (package, layer)
}

/// Checks a group, whose checks are all true.
fn check(group: &str, least: usize) {
    let Some(found) = found() else { return };
    let checks = found[group].as_object().unwrap_or_else(|| panic!("`{group}` of {found}"));
    let wrong: Vec<_> = checks.iter().filter(|(_, value)| **value != Value::Bool(true)).collect();
    assert!(wrong.is_empty(), "{group}: {wrong:#?}");
    assert!(checks.len() >= least, "{group}: only {} checks were made", checks.len());
}

#[test]
fn axe_finds_nothing_serious_in_dark_light_and_forced_colors() {
    check("accessibility", 15);
}

#[test]
fn a_keyboard_alone_reaches_and_moves_everything() {
    check("keyboard", 15);
}

#[test]
fn a_phone_has_all_controls_at_390_and_320_pixels() {
    check("phone", 25);
}

#[test]
fn failures_are_told_apart_and_leave_the_capture() {
    check("failures", 20);
}

#[test]
fn links_keep_what_they_were_opened_with() {
    check("links", 10);
}

#[test]
fn the_page_around_keeps_its_wheel_and_gets_errors_and_times() {
    check("embedding", 16);
}

#[test]
fn a_frame_without_a_height_is_no_error() {
    check("collapsed", 3);
}

#[test]
fn a_slow_device_plays_at_low_resolution_and_rests_at_full_resolution() {
    check("waiting", 10);
    if let Some(found) = found() {
        println!("{}", found["figures"]);
    }
}

#[test]
fn a_slow_link_shows_the_beginning_of_a_capture() {
    check("beginning", 20);
}

#[test]
fn a_still_has_no_controls_of_time() {
    check("stills", 6);
}

#[test]
fn the_page_around_an_app_of_bevy_is_the_same() {
    match found() {
        Some(found) if found["bevy"].is_null() => skip("the page has no app of Bevy: `bash .ci/web --bevy`"),
        Some(_) => check("bevy", 5),
        None => {}
    }
}
