//! Options without an effect, in every verb that takes options which depend on others.
//!
//! In: a table of command lines, whose files need not exist, and the sentence that refuses each. Out: proof that an option that would be ignored
//! is an error that names it, before any file is read; and that the same sentence refuses packed captures in `compress` and `bake`.
//!
//! Options that describe the checkpoint (`--time-interval`, `--up` and the others of that group) are facts about a file, not requests: those that
//! contradict a package are refused by the tests of `command`.

use crate::support::capture::Capture;
use crate::support::command::{arguments, folder, gs4d, scene};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use serde_json::{Value, json};
use std::fs;

/// Command lines, words separated by spaces, and the beginning of the sentence after `error: `.
const REFUSED: &[(&str, &str)] = &[
    // compress
    ("compress a b --quality lossless --mean-bits 3", "--mean-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --mean-t-bits 3", "--mean-t-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --velocity-bits 3", "--velocity-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --sigma-t-bits 3", "--sigma-t-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --scale-bits 3", "--scale-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --rotation-bits 3", "--rotation-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --opacity-bits 3", "--opacity-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --base-bits 3", "--base-bits has no effect with --quality lossless"),
    ("compress a b --quality lossless --escape 0.1", "--escape has no effect with --quality lossless"),
    ("compress a b --quality lossless --color-step 0.1", "--color-step has no effect with --quality lossless"),
    ("compress a b --quality lossless --codebooks 4", "--codebooks has no effect with --quality lossless"),
    ("compress a b --quality lossless --weights w.f32", "--weights has no effect with --quality lossless"),
    ("compress a b --codebooks 4 --color-step 0.1", "--color-step has no effect on colors that are coded by codebooks"),
    ("compress a b --quality small --color-step 0", "--color-step has no effect on colors that are coded by codebooks"),
    ("compress a b --quality visually-lossless --base-bits 3", "--base-bits has no effect without codebooks"),
    ("compress a b --quality visually-lossless --weights w.f32", "--weights has no effect without codebooks"),
    ("compress a b --verify 0 --cameras c.json", "--cameras has no effect with --verify 0"),
    ("compress a b --verify 0 --orbit 3", "--orbit has no effect with --verify 0"),
    ("compress a b --verify 0 --time 0.5", "--time has no effect with --verify 0"),
    ("compress a b --verify 0 --size 8x8", "--size has no effect with --verify 0"),
    ("compress a b --verify 0 --cameras c.json --resolution 2", "--cameras has no effect with --verify 0"),
    ("compress a b --verify 0 --engine gpu", "--engine has no effect with --verify 0"),
    ("compress a b --verify 0 --adapter x", "--adapter has no effect with --verify 0"),
    ("compress a b --verify 0 --checks", "--checks has no effect with --verify 0"),
    ("compress a b --resolution 2", "the following required arguments were not provided"),
    ("compress a b --engine cpu --adapter x", "--adapter has no effect with --engine cpu"),
    ("compress a b --engine cpu --checks", "--checks has no effect with --engine cpu"),
    // score
    ("score a --data d --out o --variant energy --ratio 0.3", "--ratio has no effect without --variant auto"),
    ("score a --data d --out o --variant all --validation times", "--validation has no effect without --variant auto"),
    ("score a --data d --out o --variant all --trust-images", "--trust-images has no effect without --variant auto"),
    (
        "score a --data d --out o --variant energy --volume-power 1",
        "--volume-power has no effect on scores that do not use",
    ),
    (
        "score a --data d --out o --variant peak --volume-rank 1",
        "--volume-rank has no effect on scores that do not use",
    ),
    ("score a --data d --out o --volume-power 0 --volume-rank 1", "--volume-rank has no effect with --volume-power 0"),
    ("score a --data d --out o --engine cpu --adapter x", "--adapter has no effect with --engine cpu"),
    ("score a --data d --out o --engine cpu --checks", "--checks has no effect with --engine cpu"),
    ("score a --out o --size 8x8", "the following required arguments were not provided"),
    // prune
    ("prune a -o o --keep 3 --scores s --variant energy", "the argument '--scores <FILE>' cannot be used with"),
    ("prune a -o o --keep 3 --scores s --views 3", "the argument '--scores <FILE>' cannot be used with"),
    ("prune a -o o --keep 3 --scores s --volume-power 1", "the argument '--scores <FILE>' cannot be used with"),
    ("prune a -o o --keep 3 --scores s --volume-rank 1", "the argument '--scores <FILE>' cannot be used with"),
    ("prune a -o o --keep 3 --scores s --data d", "--data has no effect with --scores unless --max-loss is given"),
    ("prune a -o o --ratio 0.3 --scores s --validation times", "--validation has no effect with --scores unless"),
    ("prune a -o o --ratio 0.3 --scores s --trust-images", "--trust-images has no effect with --scores unless"),
    ("prune a -o o --ratio 0.3 --scores s --engine gpu", "--engine has no effect with --scores unless"),
    ("prune a -o o --ratio 0.3 --scores s --adapter x", "--adapter has no effect with --scores unless"),
    ("prune a -o o --ratio 0.3 --scores s --checks", "--checks has no effect with --scores unless"),
    (
        "prune a -o o --ratio 0.3 --data d --variant energy --validation times",
        "--validation has no effect without --max-loss",
    ),
    (
        "prune a -o o --keep 3 --data d --variant energy --trust-images",
        "--trust-images has no effect without --max-loss",
    ),
    ("prune a -o o --keep 3 --data d --variant energy --volume-power 1", "--volume-power has no effect on scores that"),
    ("prune a -o o --keep 3 --data d --engine cpu --checks", "--checks has no effect with --engine cpu"),
    // mask
    ("mask a -o o --data d", "--data has no effect with --filter support unless --every is given"),
    ("mask a -o o --data d --size 8x8", "--size has no effect with --filter support"),
    ("mask a -o o --data d --every 2 --resolution 2", "--resolution has no effect with --filter support"),
    ("mask a -o o --engine gpu", "--engine has no effect with --filter support"),
    ("mask a -o o --adapter x", "--adapter has no effect with --filter support"),
    ("mask a -o o --checks", "--checks has no effect with --filter support"),
    ("mask a -o o --every 2", "the following required arguments were not provided"),
    ("mask a -o o --filter interval --data d --engine cpu --checks", "--checks has no effect with --engine cpu"),
    // eval
    ("eval a --data d --gain 3", "the following required arguments were not provided"),
    ("eval a --data d --engine cpu --renderer bins", "--renderer has no effect with --engine cpu"),
    ("eval a --data d --engine cpu --adapter x", "--adapter has no effect with --engine cpu"),
    ("eval a --data d --engine cpu --checks", "--checks has no effect with --engine cpu"),
    // ablate
    ("ablate a --data d --split test --validation times", "--validation has no effect with --split test"),
    (
        "ablate a --data d --variants energy,peak --volume-power 1",
        "--volume-power has no effect on scores that do not use",
    ),
    ("ablate a --data d --engine cpu --checks", "--checks has no effect with --engine cpu"),
    // train
    ("train -o o --data d --validation none --patience 3", "--patience has no effect with --validation none"),
    ("train -o o --data d --sh-degree 2 --sh-degree-t 1", "--sh-degree-t has no effect with --sh-degree below 3"),
    // finetune
    ("finetune a -o o --data d --validation none --patience 3", "--patience has no effect with --validation none"),
    ("finetune a -o o --data d --compress-steps 3", "the following required arguments were not provided"),
    ("finetune a -o o --data d --round-geometry", "the following required arguments were not provided"),
    (
        "finetune a -o o --data d --compress visually-lossless --compress-steps 3",
        "--compress-steps has no effect with a quality without codebooks",
    ),
    (
        "finetune a -o o --data d --compress lossless --round-geometry",
        "--round-geometry has no effect with a quality without codebooks",
    ),
    // bake
    (
        "bake a -o o --data d --no-fine-tune --steps 3",
        "the argument '--no-fine-tune' cannot be used with '--steps <N>'",
    ),
    (
        "bake a -o o --data d --no-fine-tune --batch 3",
        "the argument '--no-fine-tune' cannot be used with '--batch <N>'",
    ),
    (
        "bake a -o o --data d --no-fine-tune --rounds 3",
        "the argument '--no-fine-tune' cannot be used with '--rounds <N>'",
    ),
    ("bake a -o o --data d --engine cpu --steps 3", "--steps has no effect with --engine cpu"),
    ("bake a -o o --data d --engine cpu --batch 3", "--batch has no effect with --engine cpu"),
    ("bake a -o o --data d --engine cpu --rounds 3", "--rounds has no effect with --engine cpu"),
    ("bake a -o o --data d --engine cpu --sums atomic", "--sums has no effect with --engine cpu"),
    ("bake a -o o --data d --engine cpu --adapter x", "--adapter has no effect with --engine cpu"),
    ("bake a -o o --data d --volume-power 1", "--volume-power has no effect on scores that do not use"),
    ("bake a -o o --data d --key-frames 3 --every 3", "the argument '--key-frames <K>' cannot be used with"),
    // the others
    ("bench a --orbit 3 --views 3", "the argument '--orbit <N>' cannot be used with '--views <N>'"),
    ("bench a --resolution 2", "the following required arguments were not provided"),
    ("bench a --times 3 --time 0.5", "the argument '--times <K>' cannot be used with '--time <T>'"),
    (
        "render a --out o --orbit 3 --cameras c.json",
        "the argument '--orbit <N>' cannot be used with '--cameras <FILE>'",
    ),
    ("render a --out o --orbit 3 --resolution 2", "the argument '--orbit <N>' cannot be used with '--resolution <N>'"),
    ("render a --out o --cameras c.json --size 8x8 --resolution 2", "the argument '--size <WxH>' cannot be used with"),
    ("detail a -o o --size 8x8", "the following required arguments were not provided"),
    ("detail a -o o --resolution 2", "the following required arguments were not provided"),
    ("synth o --sh-degree 2 --sh-degree-t 1", "--sh-degree-t has no effect with --sh-degree below 3"),
    ("convert a o --sh-degree 2 --sh-degree-t 1", "--sh-degree-t has no effect with --sh-degree below 3"),
    ("synth o --grow 2 a --count 3", "the argument '--grow <K> <CAPTURE>' cannot be used with '--count <N>'"),
    (
        "synth o --grow 2 a --duration 3",
        "the argument '--grow <K> <CAPTURE>' cannot be used with '--duration <SECONDS>'",
    ),
];

#[test]
fn options_without_an_effect_are_refused_before_any_file_is_read() {
    for (command, sentence) in REFUSED {
        let run = gs4d(&command.split(' ').collect::<Vec<_>>());
        run.must_fail(sentence);
        assert!(run.err.starts_with(&format!("error: {sentence}")), "{command}: no other error: {}", run.err);
    }
}

#[test]
fn sizes_of_pictures_without_an_effect_are_refused() {
    let folder = folder();
    let [a, b, cameras] = ["a.png", "b.png", "golden.json"].map(|name| folder.path().join(name));
    for picture in [&a, &b] {
        image::RgbImage::new(12, 12).save(picture).expect("the folder can be written to");
    }
    gs4d(&arguments!["compare", &a, &b, "--size", "12x12"]).must_fail("--size has no effect without .f32 pictures");
    gs4d(&arguments!["compare", &a, &b]).text();
    let pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]];
    let view =
        json!({ "file": "0.png", "width": 12, "height": 12, "fl_x": 12, "fl_y": 12, "world_to_camera_opencv": pose });
    fs::write(&cameras, json!({ "views": [view] }).to_string()).expect("the folder can be written to");
    let (scene, out) = (scene(&folder, "50"), folder.path().join("out.gs4d"));
    let fixed = arguments!["compress", &scene, &out, "--engine", "cpu", "--codebooks", "4", "--cameras", &cameras];
    gs4d(&[fixed.to_vec(), arguments!["--resolution", "2"].to_vec()].concat())
        .must_fail("golden.json: has the sizes of its pictures, on which --resolution has no effect");
    gs4d(&fixed).text();
}

#[test]
fn the_refreshing_of_a_filter_needs_one_that_is_refreshed() {
    let folder = folder();
    let (scene, out) = (scene(&folder, "50"), folder.path().join("out.gs4d"));
    let data = folder.path().join("data");
    gs4d(&arguments!["finetune", &scene, "--data", &data, "-o", &out, "--refresh-filter", "3"]).must_fail(
        "--refresh-filter has no effect on a scene without a temporal filter of the kind key-frame or interval",
    );
}

#[test]
fn packed_captures_are_refused_by_one_sentence() {
    let folder = folder();
    let (scene, packed) = (scene(&folder, "200"), folder.path().join("packed.gs4d"));
    gs4d(&arguments!["compress", &scene, &packed, "--codebooks", "4", "--verify", "0"]).text();
    let out = folder.path().join("out.gs4d");
    let data = folder.path().join("data");
    let sentence =
        "packed.gs4d: the scene is packed already: name the checkpoint or the lossless package that it was made from";
    gs4d(&arguments!["compress", &packed, &out]).must_fail(sentence);
    gs4d(&arguments!["bake", &packed, "--data", &data, "--engine", "cpu", "-o", &out]).must_fail(sentence);
    assert!(!out.exists(), "no output is written");
}

#[test]
fn a_bake_of_a_package_in_the_runtime_form_has_the_quality_asked_for() {
    let trained = synthesize(&SynthSettings { count: 300, ..SynthSettings::default() });
    let capture = Capture::new(trained, Vec3::ZERO, 3, 2, UVec2::splat(32), true);
    let (runtime, out) = (capture.path("runtime.gs4d"), capture.path("out.gs4d"));
    gs4d(&arguments!["convert", &capture.scene, &runtime, "--form", "runtime"]).text();
    let goal = arguments!["--ratio", "0.5", "--variant", "energy", "--engine", "cpu", "--quality", "small"];
    let fixed = arguments!["bake", &runtime, "--data", &capture.data, "-o", &out];
    gs4d(&[fixed.to_vec(), goal.to_vec()].concat()).text();
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!((&info["form"], &info["gaussians"]), (&"packed".into(), &150.into()), "compressed: {info}");
}

#[test]
fn the_error_of_an_option_is_json_with_json() {
    let run = gs4d(&["compress", "a", "b", "--quality", "lossless", "--mean-bits", "3", "--json"]);
    let document: Value = serde_json::from_str(&run.out).expect("one JSON document");
    assert_eq!(
        document["error"], "--mean-bits has no effect with --quality lossless, which changes no value; leave it out",
        "the whole sentence"
    );
}

#[cfg(not(feature = "storage"))]
#[test]
fn urls_are_refused_with_the_feature_that_reads_them() {
    for command in [
        arguments!["info", "s3://bucket/a.gs4d"].to_vec(),
        arguments!["synth", "--count", "9", "-o", "https://host/a.gs4d"].to_vec(),
    ] {
        gs4d(&command).must_fail("built with the feature storage");
    }
}
