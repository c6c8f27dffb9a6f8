//! The remedies in errors of the command.
//!
//! In: command lines that fail, on captures and datasets made here. Out: proof that the error names a remedy, and that
//! the command line that follows it succeeds, also for packages that were made with other options.
//! `src/cli/remedies.rs` checks that every verb and option in a message exists.

use crate::support::command::{arguments, folder, gs4d, scene, words};
use crate::support::dataset;
use crate::support::pth::Pth;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use tempfile::TempDir;

/// A command line that fails, the remedy in its error, and the command line that follows it. Words in capitals are
/// files: see [`words`].
const REMEDIES: &[(&str, &str, &str)] = &[
    (
        "prune SCENE.gs4d --ratio 0.5 -o OUT.gs4d",
        "give --data DIR",
        "prune SCENE.gs4d --ratio 0.5 -o OUT.gs4d --data DATA --variant energy --engine cpu",
    ),
    (
        "mask SCENE.gs4d --filter interval -o OUT.gs4d",
        "give --data DIR",
        "mask SCENE.gs4d --filter interval -o OUT.gs4d --data DATA --engine cpu",
    ),
    (
        "bake SCENE.gs4d -o OUT.gs4d",
        "give --data DIR",
        "bake SCENE.gs4d -o OUT.gs4d --data DATA --engine cpu --ratio 0.5 --variant energy",
    ),
    (
        "edit SCENE.gs4d FLOATERS.ron -o OUT.gs4d",
        "give --data DIR",
        "edit SCENE.gs4d FLOATERS.ron -o OUT.gs4d --data DATA",
    ),
    (
        "score SCENE.gs4d --data FEW --out OUT.f32 --engine cpu",
        "or name a score with --variant",
        "score SCENE.gs4d --data FEW --out OUT.f32 --engine cpu --variant energy",
    ),
    (
        "score SCENE.gs4d --data FEW --out OUT.f32 --engine cpu",
        "give --validation cameras or times",
        "score SCENE.gs4d --data FEW --out OUT.f32 --engine cpu --validation cameras --trust-images",
    ),
    (
        "prune SCENE.gs4d --data FEW --max-loss 1 --variant energy --engine cpu -o OUT.gs4d",
        "or give --ratio or --keep in its place",
        "prune SCENE.gs4d --data FEW --keep 9 --variant energy --engine cpu -o OUT.gs4d",
    ),
    (
        "bake SCENE.gs4d --data FEW --engine cpu -o OUT.gs4d",
        "give --validation cameras or times",
        "bake SCENE.gs4d --data FEW --engine cpu -o OUT.gs4d --validation times --trust-images",
    ),
    (
        "ablate SCENE.gs4d --data FEW --engine cpu",
        "or measure on the views of another --split",
        "ablate SCENE.gs4d --data FEW --engine cpu --split test --trust-images --variants energy \
         --ratios 0.5 --filters support",
    ),
    (
        "score SCENE.gs4d --data SIZELESS --out OUT.f32 --variant energy --engine cpu",
        "or give --size WxH",
        "score SCENE.gs4d --data SIZELESS --out OUT.f32 --variant energy --engine cpu --size 16x16",
    ),
    (
        "score SCENE.gs4d --data DATA --out FEW --variant energy --engine cpu",
        "name a file, or give --variant all",
        "score SCENE.gs4d --data DATA --out OUT --variant all --engine cpu",
    ),
    (
        "score --merge SCENE.gs4d --variant energy --out OUT.f32",
        "parts are written by --shard",
        "score SCENE.gs4d --data DATA --variant energy --engine cpu --shard 0/1 --out OUT.gs4p",
    ),
    (
        "bake SCENE.gs4d --data DATA -o OUT.gs4d --ratio 0.5 --plan OUT.json",
        "give --engine gpu or --engine cpu with --plan",
        "bake SCENE.gs4d --data DATA -o OUT.gs4d --ratio 0.5 --plan OUT.json --engine cpu",
    ),
    (
        "bake SCENE.gs4d --data DATA -o OUT.gs4d --ratio 0.5 --variant energy --engine cpu --only prune",
        "run --only score before --only prune",
        "bake SCENE.gs4d --data DATA -o OUT.gs4d --ratio 0.5 --variant energy --engine cpu --only score --trust-images",
    ),
    ("compare A.f32 A.f32", "give --size WxH", "compare A.f32 A.f32 --size 4x4"),
    ("export SCENE.gs4d OUT.ply", "give --time from 0 to 1, or --sequence", "export SCENE.gs4d OUT.ply --time 1"),
    ("export SCENE.gs4d OUT", "or give --format", "export SCENE.gs4d OUT --format ply --time 1"),
    (
        "convert RUNTIME.gs4d -o OUT.gs4d --form trained",
        "convert the checkpoint with --form trained",
        "convert SCENE.gs4d -o OUT.gs4d --form trained",
    ),
    (
        "compress PACKED.gs4d -o OUT.gs4d",
        "name the checkpoint or the lossless package",
        "compress SCENE.gs4d -o OUT.gs4d --verify 0 --codebooks 4",
    ),
    (
        "collide SCENE.gs4d -o OUT.gs4d --rate 100000",
        "choose a lower --rate",
        "collide SCENE.gs4d -o OUT.gs4d --rate 2 --level 0.05 --cells 16 --smallest 1",
    ),
    ("convert CHUNKS/INDEX.gs4d OUT.gs4d", "gs4d join FOLDER -o CAPTURE", "join CHUNKS -o OUT.gs4d"),
    ("info SCENE.gs4d --cutoff 2", "--cutoff: 2 is not from 1/255 to below 1", "info SCENE.gs4d --cutoff 0.1"),
];

/// Makes the files that the command lines name.
fn files() -> TempDir {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let scene = scene(&folder, "60");
    let runtime = synthesize(&SynthSettings { count: 60, ..SynthSettings::default() }).into_runtime();
    let runtime = runtime.expect("a synthetic scene can be drawn");
    for (name, cameras, times, images) in [("data", 4, 4, true), ("few", 3, 2, true), ("sizeless", 4, 4, false)] {
        dataset::write(&path(name), &runtime, Vec3::ZERO, cameras, times, UVec2::splat(16), images);
    }
    let cameras = path("sizeless/transforms_train.json");
    let mut json: Value = serde_json::from_str(&fs::read_to_string(&cameras).expect("a camera file")).expect("JSON");
    for name in ["w", "h"] {
        json.as_object_mut().expect("an object").remove(name);
    }
    fs::write(&cameras, json.to_string()).expect("the folder can be written to");
    gs4d(&arguments!["convert", &scene, path("runtime.gs4d"), "--form", "runtime"]).text();
    gs4d(&arguments!["split", &scene, "-o", path("chunks")]).text();
    gs4d(&arguments!["compress", &scene, path("packed.gs4d"), "--codebooks", "4", "--verify", "0"]).text();
    fs::write(path("a.f32"), [0; 4 * 4 * 3 * 4]).expect("the folder can be written to");
    let floaters = "[remove_floaters(cameras_below: 2, distance_below: 0.4)]";
    fs::write(path("floaters.ron"), floaters).expect("the folder can be written to");
    folder
}

#[test]
fn the_remedy_of_an_error_succeeds() {
    let folder = files();
    for (number, (failing, remedy, working)) in REMEDIES.iter().enumerate() {
        let run = gs4d(&words(failing, folder.path(), number));
        run.must_fail(remedy);
        let run = gs4d(&words(working, folder.path(), number));
        assert_eq!(run.code, Some(0), "{working}: {}", run.err);
    }
}

#[test]
fn options_are_called_by_their_names_on_the_command_line() {
    let folder = folder();
    scene(&folder, "20");
    for (option, sentence) in [
        ("--cutoff 0.001", "scene.gs4d: --cutoff: 0.001 is not from 1/255 to below 1"),
        ("--fps 0", "scene.gs4d: --fps: 0 is not a positive number of frames a second"),
        ("--tolerance 0", "scene.gs4d: --tolerance: 0 is not a positive part of a scale"),
        ("--time-interval 0,9", "scene.gs4d: --time-interval: the package was made with another value"),
        ("--prefilter-var 0.5", "scene.gs4d: --prefilter-var: the package was made with another value"),
        (
            "--rotation-convention unflipped",
            "scene.gs4d: --rotation-convention: the package was made with another value",
        ),
    ] {
        gs4d(&words(&format!("info SCENE.gs4d {option}"), folder.path(), 0)).must_fail(sentence);
    }
}

#[test]
fn a_package_made_with_another_value_is_made_again_by_the_command_of_the_error() {
    let folder = folder();
    let [checkpoint, package, again] = ["chkpnt.pth", "a.gs4d", "again.gs4d"].map(|name| folder.path().join(name));
    fs::write(&checkpoint, Pth::rotating(20, 48).bytes()).expect("the folder can be written to");
    gs4d(&arguments!["convert", &checkpoint, &package]).text();
    for (option, value) in [
        ("--time-interval", Some("0,2")),
        ("--rotation-convention", Some("unflipped")),
        ("--force-sh-3d", None),
        ("--prefilter-var", Some("0.5")),
    ] {
        let given: Vec<OsString> = [Some(option), value].into_iter().flatten().map(OsString::from).collect();
        let with = |words: &[OsString]| gs4d(&[words, &given].concat());
        with(&arguments!["info", &package]).must_fail(&format!("gs4d convert {option}"));
        with(&arguments!["convert", &checkpoint, &again]).text();
        with(&arguments!["info", &again]).text();
        fs::remove_file(&again).expect("it was made");
    }
}
