//! Options without an effect, of every verb.
//!
//! In: a table of command lines, whose files need not exist, command lines on captures and datasets made here, and the
//! sentence that refuses each. Out: proof that an option that would be ignored is an error that names it, before any
//! file is read if the command line tells it, and before anything is computed otherwise; that every option of every
//! verb that `--help` lists is refused somewhere or always has an effect; and that the same sentence refuses packed
//! captures in `compress` and `bake`.
//!
//! Options that describe the checkpoint (`--time-interval`, `--rotation-convention` and others of that group) are facts
//! about a file, too: those that contradict a package are refused by the tests of `command`.

use crate::support::capture::Capture;
use crate::support::command::{arguments, folder, gs4d, scene, words};
use crate::support::dataset;
use crate::support::folders::contents;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::scene::Environment;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::thread;
use tempfile::TempDir;

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
    ("compress a b --quality lossless --progressive", "--progressive has no effect with the quality lossless"),
    ("compress a b --quality lossless --chunk 1", "--chunk has no effect with the quality lossless"),
    ("compress a b --layers 50,50", "the following required arguments were not provided"),
    ("compress a b --chunk 1 --progressive", "the argument '--chunk <SECONDS>' cannot be used with '--progressive'"),
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
    ("score a --out o --static", "the following required arguments were not provided"),
    ("score a --out o --resolution 2", "the following required arguments were not provided"),
    ("score a --data d --out o --variant energy --duration 3", "--duration has no effect on the result of this verb"),
    (
        "score a --data d --out o --variant energy --up +y",
        "--up has no effect on the views of a dataset or a camera file",
    ),
    ("score a --data d --out o --shard 0/2 --ratio 0.3", "--ratio has no effect with --shard: give it with --merge"),
    ("score --merge p --out o --variant all --data d", "--data has no effect on parts alone"),
    ("score --merge p --out o --variant all --views 3", "--views has no effect on parts alone"),
    ("score --merge p --out o --variant all --engine gpu", "--engine has no effect on parts alone"),
    ("score --merge p --out o --variant all --time-interval 0,2", "--time-interval has no effect on parts alone"),
    ("score --merge p --out o --variant all --background 1,1,1", "--background has no effect on parts alone"),
    ("score --merge p --out o --variant all --raster-fov corrected", "--raster-fov has no effect on parts alone"),
    ("score --merge p --out o --variant all --trained-cameras fov", "--trained-cameras has no effect on parts alone"),
    ("score --merge p --out o --variant all --sh-direction displaced", "--sh-direction has no effect on parts alone"),
    ("score --merge p --out o --variant all --cutoff 0.1", "--cutoff has no effect on parts alone"),
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
    ("prune a -o o --keep 3 --scores s --static", "the following required arguments were not provided"),
    ("prune a -o o --keep 3 --scores s --size 8x8", "the following required arguments were not provided"),
    ("prune a -o o --keep 3 --scores s --resolution 2", "the following required arguments were not provided"),
    ("prune a -o o --keep 3 --data d --engine cpu --adapter x", "--adapter has no effect with --engine cpu"),
    // mask
    ("mask a -o o --data d", "--data has no effect with --filter support unless --every is given"),
    ("mask a -o o --data d --size 8x8", "--size has no effect with --filter support"),
    ("mask a -o o --data d --every 2 --resolution 2", "--resolution has no effect with --filter support"),
    ("mask a -o o --static", "the following required arguments were not provided"),
    (
        "mask a -o o --filter interval --data d --shard 0/2 --level 3",
        "--level has no effect with --shard: give it with --merge",
    ),
    ("mask a -o o --shard 0/2", "--shard has no effect with --filter support"),
    ("mask a -o o --merge p", "--merge has no effect with --filter support"),
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
    ("eval a --data d --merge p --out o", "--out has no effect with --merge, which draws no pictures"),
    ("eval a --data d --duration 3", "--duration has no effect on the result of this verb, which is not played"),
    ("eval a --data d --up +y", "--up has no effect on the views of a dataset or a camera file"),
    // split
    ("split a -o o --engine gpu", "--engine has no effect without --data: no layer is measured"),
    ("split a -o o --adapter x", "--adapter has no effect without --data"),
    ("split a -o o --checks", "--checks has no effect without --data"),
    ("split a -o o --validation times", "--validation has no effect without --data"),
    ("split a -o o --trust-images", "--trust-images has no effect without --data"),
    ("split a -o o --data d --engine cpu --checks", "--checks has no effect with --engine cpu"),
    ("split a -o o --size 8x8", "the following required arguments were not provided"),
    ("split a -o o --resolution 2", "the following required arguments were not provided"),
    ("split a -o o --static", "the following required arguments were not provided"),
    // ablate
    ("ablate a --data d --split test --validation times", "--validation has no effect with a --split of the dataset"),
    ("ablate a --data d --duration 3", "--duration has no effect on the result of this verb, which is not played"),
    ("ablate a --data d --up +y", "--up has no effect on the views of a dataset or a camera file"),
    ("ablate a --data d --engine cpu --adapter x", "--adapter has no effect with --engine cpu"),
    ("ablate a --data d --variants energy --volume-rank 1", "--volume-rank has no effect on scores that do not use"),
    (
        "ablate a --data d --variants energy,peak --volume-power 1",
        "--volume-power has no effect on scores that do not use",
    ),
    ("ablate a --data d --engine cpu --checks", "--checks has no effect with --engine cpu"),
    // train
    ("train -o o --data d --validation none --patience 3", "--patience has no effect without validation views"),
    ("train -o o --data d --densify original --noise 1", "--noise has no effect with --densify original"),
    ("train -o o --data d --densify original --dropout 0.2", "--dropout has no effect with --densify original"),
    (
        "train -o o --data d --densify original --relocate-every 9",
        "--relocate-every has no effect with --densify original",
    ),
    ("train -o o --data d --densify original --rigid-weight 1", "--rigid-weight has no effect with --densify original"),
    ("train -o o --data d --start random --points p.ply", "--points has no effect with --start hull or random"),
    ("train -o o --data d --steps 999 --trust-images", "--trust-images has no effect with fewer than 1000 steps"),
    (
        "train -o o --data d --sh-degree 0 --raise-degree-every 9",
        "--raise-degree-every has no effect with --sh-degree 0",
    ),
    ("train -o o --data d --sh-degree 2 --sh-degree-t 1", "--sh-degree-t has no effect with --sh-degree below 3"),
    // finetune
    ("finetune a -o o --data d --validation none --patience 3", "--patience has no effect without validation views"),
    ("finetune a -o o --data d --compress-steps 3", "the following required arguments were not provided"),
    ("finetune a -o o --data d --progressive", "--progressive has no effect without --compress"),
    (
        "finetune a -o o --data d --compress lossless --progressive",
        "--progressive has no effect with the quality lossless",
    ),
    (
        "finetune a -o o --data d --compress small --progressive --round-geometry",
        "the argument '--progressive' cannot be used with '--round-geometry'",
    ),
    ("finetune a -o o --data d --layers 100", "the following required arguments were not provided"),
    ("finetune a -o o --data d --chunk 1", "--chunk has no effect without --compress"),
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
    ("bake a -o o --data d --layers 100", "the following required arguments were not provided"),
    ("bake a -o o --data d --quality lossless --chunk 2", "--chunk has no effect with the quality lossless"),
    ("bake a -o o --data d --quality lossless --progressive", "--progressive has no effect with the quality lossless"),
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
    ("bake a -o o --data d --engine cpu --exposure", "--exposure has no effect with --engine cpu"),
    ("bake a -o o --data d --engine cpu --checks", "--checks has no effect with --engine cpu"),
    ("bake a -o o --data d --volume-rank 1", "--volume-rank has no effect on scores that do not use"),
    ("bake a -o o --data d --gaussians 9", "--gaussians has no effect with a checkpoint"),
    ("bake a -o o --data d --train-steps 9", "--train-steps has no effect with a checkpoint"),
    ("bake a -o o --data d --environment 9", "--environment has no effect with a checkpoint"),
    ("bake a -o o --data d --engine cpu --adapter x", "--adapter has no effect with --engine cpu"),
    ("bake a -o o --data d --volume-power 1", "--volume-power has no effect on scores that do not use"),
    ("bake a -o o --data d --key-frames 3 --every 3", "the argument '--key-frames <K>' cannot be used with"),
    // the others
    ("info a --cameras c.png", "--cameras has no effect on a capture: it is for the folder of a dataset"),
    ("info a --static", "--static has no effect on a capture: it is for the folder of a dataset"),
    (
        "export a o.ply --background 1,1,1",
        "--background has no effect on the result of this verb, which has no background",
    ),
    (
        "export a o.ply --time 0 --duration 3",
        "--duration has no effect on the result of this verb, which is not played",
    ),
    ("export a o.ftgs.ply --time 0", "--time has no effect on a format with motion"),
    ("export a o --sequence --format free-time", "--sequence has no effect on a format with motion"),
    ("bench a --background 1,1,1", "--background has no effect on the result of this verb, which has no background"),
    ("bench a --duration 3", "--duration has no effect on the result of this verb, which is not played"),
    ("bench a --cameras c.json --up +y", "--up has no effect on the views of a dataset or a camera file"),
    (
        "render a --out o --orbit 3 --duration 3",
        "--duration has no effect on the result of this verb, which is not played",
    ),
    ("render a --out o --cameras c.json --up +y", "--up has no effect on the views of a dataset or a camera file"),
    ("render a --out o --orbit 3 --level 1 --antialias", "--antialias has no effect with --level"),
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
    ("detail a -o o --static", "the following required arguments were not provided"),
    ("detail a -o o --trust-images", "the following required arguments were not provided"),
    ("edit a b -o o --size 8x8", "the following required arguments were not provided"),
    ("edit a b -o o --resolution 2", "the following required arguments were not provided"),
    ("edit a b -o o --static", "the following required arguments were not provided"),
    ("edit a b --dry-run --level 3", "the argument '--"),
    ("edit a b --dry-run --out o", "the argument '--"),
    (
        "join chunk-00001-of-00001.gs4d -o o --keep-times",
        "--keep-times has no effect on the chunks of one capture; leave it out",
    ),
    ("socket a --list --name n", "the argument '--list' cannot be used with '--name <NAME>'"),
    ("socket a --list --out o", "the argument '--list' cannot be used with '--out <OUT>'"),
    ("socket a --points p --name n", "the argument '--points <FILE>' cannot be used with '--name <NAME>'"),
    ("socket a --points p --out o", "the argument '--points <FILE>' cannot be used with '--out <OUT>'"),
    ("socket a --name n --remove --out o --at 0,0,0", "the argument '--remove' cannot be used with '--at <X,Y,Z>'"),
    ("socket a --name n --remove --out o --time 0", "the argument '--remove' cannot be used with '--time <T>'"),
    ("socket a --name n --remove --out o --rate 9", "the argument '--remove' cannot be used with '--rate <HZ>'"),
    ("collide a -o o --remove --cells 9", "the argument '--remove' cannot be used with '--cells <N>'"),
    ("collide a -o o --remove --level 0.5", "the argument '--remove' cannot be used with '--level <X>'"),
    ("collide a -o o --remove --rate 9", "the argument '--remove' cannot be used with '--rate <HZ>'"),
    ("collide a -o o --remove --error 1", "the argument '--remove' cannot be used with '--error <CELLS>'"),
    ("collide a -o o --remove --smallest 9", "the argument '--remove' cannot be used with '--smallest <N>'"),
    (
        "collide a -o o --remove --bounds 0,0,0,1,1,1",
        "the argument '--remove' cannot be used with '--bounds <X0,Y0,Z0,X1,Y1,Z1>'",
    ),
    ("collide a -o o --remove --obj f", "the argument '--remove' cannot be used with '--obj <FOLDER>'"),
    ("synth o --sh-degree 2 --sh-degree-t 1", "--sh-degree-t has no effect with --sh-degree below 3"),
    ("convert a o --sh-degree 2 --sh-degree-t 1", "--sh-degree-t has no effect with --sh-degree below 3"),
    ("footage a -o o --sync no --offset b=1", "the argument '--"),
    ("footage a -o o --rehearse --no-points", "the argument '--"),
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

/// The verbs that read captures, and their arguments after the capture. Words in capitals are files: see [`words`].
const READERS: &[(&str, &str)] = &[
    ("info", ""),
    ("convert", "-o OUT.gs4d"),
    ("export", "OUT.ply --time 0"),
    ("render", "--out OUT --orbit 1 --adapter none-such"),
    ("compress", "-o OUT.gs4d"),
    ("detail", "-o OUT.gs4d"),
    ("edit", "EDITS.ron -o OUT.gs4d"),
    ("bench", ""),
    ("score", "--data DATA --out OUT.f32 --variant energy"),
    ("prune", "--data DATA --keep 3 -o OUT.gs4d"),
    ("mask", "-o OUT.gs4d"),
    ("eval", "--data DATA --engine cpu"),
    ("ablate", "--data DATA --engine cpu"),
    ("finetune", "--data DATA -o OUT.gs4d"),
    ("bake", "--data DATA -o OUT.gs4d --engine cpu"),
];

/// Options of reading that some captures do not take, in every verb: a capture, the option, and the beginning of the
/// sentence.
const OF_FORMATS: &[(&str, &str, &str)] = &[
    ("SCENE.gs4d", "--fps 5", "--fps has no effect on this capture"),
    ("SCENE.gs4d", "--tolerance 0.5", "--tolerance has no effect on this capture"),
    ("STILL.ply", "--fps 5", "--fps has no effect on this capture"),
    ("STILL.ply", "--rotation-convention unflipped", "--rotation-convention has no effect on this capture"),
    ("STILL.ply", "--force-sh-3d", "--force-sh-3d has no effect on a file of another make"),
    ("STILL.ply", "--prefilter-var 0.5", "--prefilter-var has no effect on a file of another make"),
];

/// Options of captures, with values.
const OF_CAPTURES: &[&str] = &[
    "--rotation-convention unflipped",
    "--raster-fov corrected",
    "--trained-cameras fov",
    "--sh-direction displaced",
    "--force-sh-3d",
    "--prefilter-var 0.5",
    "--up +y",
    "--cutoff 0.1",
    "--fps 5",
    "--tolerance 0.5",
];

/// Command lines on files, and the beginning of the sentence after `error: `.
const REFUSED_ON_FILES: &[(&str, &str)] = &[
    ("info DATA --time-interval 0,2", "--time-interval has no effect on a dataset: it is for captures"),
    ("info DATA --background 1,1,1", "--background has no effect on a dataset: it is for captures"),
    ("info DATA --duration 3", "--duration has no effect on a dataset: it is for captures"),
    ("convert FRAMES -o OUT.gs4d --tolerance 0.5", "--tolerance has no effect on this capture"),
    ("convert MOVING.ftgs.ply -o OUT.gs4d --tolerance 0.5", "--tolerance has no effect on this capture"),
    ("convert MOVING.ftgs.ply -o OUT.gs4d --fps 5 --duration 2", "--fps has no effect with --duration"),
    (
        "eval SCENE.gs4d --data DATA --engine cpu --no-filter",
        "--no-filter has no effect on a capture without a temporal filter",
    ),
    ("bench SCENE.gs4d --filter off", "--filter has no effect on a capture without a temporal filter"),
    ("bench SCENE.gs4d --form fp32", "--form has no effect on a capture that is not packed"),
    ("compare A.png B.png --size 8x8", "--size has no effect without .f32 pictures"),
    ("edit SCENE.gs4d EDITS.ron -o OUT.gs4d --data DATA", "--data has no effect on a list of edits without"),
    (
        "finetune SCENE.gs4d --data DATA -o OUT.gs4d --refresh-filter 3",
        "--refresh-filter has no effect on a scene without a temporal filter of the kind key-frame or interval",
    ),
    (
        "finetune SCENE.gs4d --data DATA -o OUT.gs4d --mask-weight 0.1",
        "--mask-weight has no effect on images without transparent pixels and masks",
    ),
    (
        "finetune SCENE.gs4d --data DATA -o OUT.gs4d --behind fixed",
        "--behind has no effect on images without transparent pixels and masks",
    ),
    (
        "finetune SURROUNDED.gs4d --data DATA -o OUT.gs4d --behind fixed",
        "--behind has no effect on a capture with an environment map",
    ),
    (
        "finetune STILL.ply --data DATA -o OUT.gs4d --motion-weight 0.1",
        "--motion-weight has no effect on a capture at rest",
    ),
    (
        "finetune STILL.ply --data DATA -o OUT.gs4d --rigid-weight 0.1",
        "--rigid-weight has no effect on a capture at rest",
    ),
    ("finetune SCENE.gs4d --data FEW -o OUT.gs4d --patience 3", "--patience has no effect without validation views"),
    ("train --data FEW -o OUT.gs4d --patience 3", "--patience has no effect without validation views"),
    (
        "train --data DATA -o OUT.gs4d --mask-weight 0.1",
        "--mask-weight has no effect on images without transparent pixels and masks",
    ),
    (
        "train --data DATA -o OUT.gs4d --behind fixed",
        "--behind has no effect on images without transparent pixels and masks",
    ),
    (
        "bake SCENE.gs4d --data BARE -o OUT.gs4d --keep 9 --steps 3",
        "--steps has no effect where no Gaussians are trained",
    ),
    (
        "bake SCENE.gs4d --data BARE -o OUT.gs4d --keep 9 --rounds 3",
        "--rounds has no effect where no Gaussians are trained",
    ),
    ("bake SCENE.gs4d --data DATA -o OUT.gs4d --engine cpu --shards 2", "--shards has no effect without --plan"),
    (
        "bake SCENE.gs4d --data DATA -o OUT.gs4d --engine cpu --only mask --shard 0/2",
        "--shard has no effect on this stage",
    ),
];

/// Command lines on files whose options have an effect.
const ACCEPTED: &[&str] = &[
    "convert FRAMES -o OUT.gs4d --fps 4",
    "convert MOVING.ftgs.ply -o OUT.gs4d --fps 5",
    "convert SCENE.gs4d -o OUT.gs4d --rotation-convention flipped --prefilter-var -1 --up -y --duration 3 \
     --background 1,1,1",
    "export SCENE.gs4d OUT --sequence --fps 2 --duration 1",
    "export SCENE.gs4d OUT.ftgs.ply --fps 2",
    "info STILL.ply --up -y --duration 2 --cutoff 0.1",
    "eval FILTERED.gs4d --data DATA --engine cpu --no-filter --metrics psnr --views 1",
];

/// The options of each verb that always have an effect, or are refused by their values alone.
const ALWAYS: &[(&str, &[&str])] = &[
    ("info", &[]),
    ("footage", &["--agreeing", "--masks", "--out", "--rehearse", "--smallest", "--sync", "--test", "--work-size"]),
    (
        "convert",
        &[
            "--background",
            "--cutoff",
            "--duration",
            "--form",
            "--level",
            "--merge",
            "--out",
            "--raster-fov",
            "--sh-degree",
            "--sh-direction",
            "--time-interval",
            "--trained-cameras",
            "--up",
        ],
    ),
    (
        "export",
        &["--cutoff", "--format", "--raster-fov", "--sh-direction", "--time-interval", "--trained-cameras", "--up"],
    ),
    (
        "render",
        &[
            "--adapter",
            "--background",
            "--checks",
            "--cutoff",
            "--level",
            "--orbit",
            "--out",
            "--raster-fov",
            "--raw",
            "--renderer",
            "--sh-direction",
            "--size",
            "--time",
            "--time-interval",
            "--trained-cameras",
        ],
    ),
    (
        "compress",
        &[
            "--background",
            "--cutoff",
            "--duration",
            "--level",
            "--merge",
            "--out",
            "--quality",
            "--raster-fov",
            "--sh-direction",
            "--time-interval",
            "--trained-cameras",
            "--up",
            "--verify",
        ],
    ),
    (
        "detail",
        &[
            "--adapter",
            "--background",
            "--checks",
            "--cutoff",
            "--data",
            "--directions",
            "--duration",
            "--level",
            "--levels",
            "--min-psnr",
            "--out",
            "--raster-fov",
            "--renderer",
            "--sh-direction",
            "--steps",
            "--time-interval",
            "--times",
            "--trained-cameras",
            "--up",
        ],
    ),
    (
        "edit",
        &[
            "--background",
            "--cutoff",
            "--dry-run",
            "--duration",
            "--raster-fov",
            "--sh-direction",
            "--time-interval",
            "--trained-cameras",
            "--up",
        ],
    ),
    ("compare", &[]),
    ("join", &["--level", "--out"]),
    ("split", &["--chunk", "--data", "--layers", "--level", "--out"]),
    ("socket", &["--list", "--points", "--remove"]),
    ("collide", &["--out", "--remove"]),
    ("sound", &["--extract", "--out", "--remove"]),
    ("synth", &["--grow", "--level", "--out", "--seed", "--sh-degree"]),
    (
        "bench",
        &[
            "--adapter",
            "--cameras",
            "--checks",
            "--cutoff",
            "--depths",
            "--frames",
            "--half",
            "--orbit",
            "--raster-fov",
            "--renderer",
            "--rounds",
            "--sh-direction",
            "--size",
            "--time-interval",
            "--times",
            "--trained-cameras",
        ],
    ),
    ("score", &["--merge", "--out", "--shard", "--variant"]),
    (
        "prune",
        &[
            "--background",
            "--cutoff",
            "--duration",
            "--keep",
            "--level",
            "--max-loss",
            "--out",
            "--raster-fov",
            "--ratio",
            "--scores",
            "--sh-direction",
            "--time-interval",
            "--trained-cameras",
            "--up",
        ],
    ),
    (
        "mask",
        &[
            "--background",
            "--cutoff",
            "--duration",
            "--filter",
            "--key-frames",
            "--out",
            "--raster-fov",
            "--sh-direction",
            "--time-interval",
            "--trained-cameras",
            "--up",
        ],
    ),
    (
        "eval",
        &[
            "--background",
            "--cutoff",
            "--data",
            "--engine",
            "--merge",
            "--metrics",
            "--raster-fov",
            "--resolution",
            "--sh-direction",
            "--shard",
            "--split",
            "--static",
            "--time-interval",
            "--trained-cameras",
            "--views",
        ],
    ),
    (
        "ablate",
        &[
            "--background",
            "--csv",
            "--cutoff",
            "--data",
            "--engine",
            "--filters",
            "--key-frames",
            "--measured-views",
            "--raster-fov",
            "--ratios",
            "--resolution",
            "--sh-direction",
            "--split",
            "--static",
            "--time-interval",
            "--trained-cameras",
            "--trust-images",
            "--variants",
            "--views",
        ],
    ),
    (
        "train",
        &[
            "--adapter",
            "--background",
            "--batch",
            "--births",
            "--checks",
            "--coarse",
            "--data",
            "--densify",
            "--duration",
            "--environment",
            "--evaluate-every",
            "--exposure",
            "--floaters",
            "--gaussians",
            "--last-mean-rate",
            "--last-rate",
            "--least-time-scale",
            "--level",
            "--mean-rate",
            "--motion-weight",
            "--opacity-weight",
            "--out",
            "--renderer",
            "--resolution",
            "--save-every",
            "--scale-weight",
            "--seed",
            "--sh-degree",
            "--similarity",
            "--standing",
            "--start",
            "--start-velocity",
            "--static",
            "--steps",
            "--time-interval",
            "--time-scale",
            "--timed-share",
            "--untimed-scale",
            "--validation",
        ],
    ),
    (
        "finetune",
        &[
            "--adapter",
            "--background",
            "--batch",
            "--checks",
            "--compress",
            "--cutoff",
            "--data",
            "--duration",
            "--evaluate-every",
            "--exposure",
            "--gradients",
            "--last-rate",
            "--level",
            "--mean-rate",
            "--opacity-weight",
            "--out",
            "--raster-fov",
            "--rates",
            "--renderer",
            "--resolution",
            "--save-every",
            "--seed",
            "--sh-direction",
            "--similarity",
            "--static",
            "--steps",
            "--time-interval",
            "--trained-cameras",
            "--trust-images",
            "--up",
            "--validation",
        ],
    ),
    (
        "bake",
        &[
            "--audio",
            "--background",
            "--colliders",
            "--data",
            "--duration",
            "--engine",
            "--filter",
            "--keep",
            "--keep-work",
            "--key-frames",
            "--level",
            "--max-loss",
            "--no-fine-tune",
            "--only",
            "--out",
            "--plan",
            "--quality",
            "--ratio",
            "--resolution",
            "--static",
            "--stream",
            "--target-size",
            "--time-interval",
            "--trust-images",
            "--validation",
            "--variant",
            "--views",
        ],
    ),
    ("report", &["--csv", "--out"]),
];

/// Returns every command line that is refused on files, and the beginning of the sentence.
fn refused_on_files() -> Vec<(String, String)> {
    let of_formats = READERS.iter().flat_map(|(verb, more)| {
        let case = move |(capture, option, sentence): &(&str, &str, &str)| {
            (format!("{verb} {capture} {more} {option}"), (*sentence).to_owned())
        };
        OF_FORMATS.iter().map(case)
    });
    let of_datasets = OF_CAPTURES.iter().flat_map(|option| {
        let name = option.split(' ').next().unwrap_or_default();
        [
            (format!("info DATA {option}"), format!("{name} has no effect on a dataset: it is for captures")),
            (
                format!("bake DATA -o OUT.gs4d --keep 5 {option}"),
                format!("{name} has no effect with a dataset: it is for checkpoints"),
            ),
        ]
    });
    let others = REFUSED_ON_FILES.iter().map(|(command, sentence)| ((*command).to_owned(), (*sentence).to_owned()));
    of_formats.chain(of_datasets).chain(others).collect()
}

/// Makes the files that the command lines name.
fn files() -> TempDir {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let scene = scene(&folder, "60");
    gs4d(&arguments!["export", &scene, path("still.ply"), "--time", "0.5"]).text();
    gs4d(&arguments!["export", &scene, path("moving.ftgs.ply")]).text();
    gs4d(&arguments!["export", &scene, path("frames"), "--sequence", "--fps", "2"]).text();
    gs4d(&arguments!["mask", &scene, "-o", path("filtered.gs4d")]).text();
    let mut trained = synthesize(&SynthSettings { count: 60, ..SynthSettings::default() });
    let runtime = trained.clone().into_runtime().expect("a synthetic scene can be drawn");
    for (name, cameras, times, images) in [("data", 4, 4, true), ("few", 3, 2, true), ("bare", 4, 4, false)] {
        dataset::write(&path(name), &runtime, Vec3::ZERO, cameras, times, UVec2::splat(16), images);
    }
    trained.environment = Some(Environment { width: 4, height: 2, texels: vec![0.5; 24] });
    let settings = WriteSettings::default();
    offline::work::save(&path("surrounded.gs4d"), &trained, &settings).expect("the folder can be written to");
    fs::write(path("edits.ron"), "[]").expect("the folder can be written to");
    for picture in ["a.png", "b.png"] {
        image::RgbImage::new(8, 8).save(path(picture)).expect("the folder can be written to");
    }
    folder
}

/// Calls a function with each item and its number, on four threads.
fn on_threads<T: Sync>(items: &[T], run: impl Fn(usize, &T) + Sync) {
    let run = &run;
    thread::scope(|scope| {
        for first in 0..4 {
            scope.spawn(move || {
                items.iter().enumerate().skip(first).step_by(4).for_each(|(number, item)| run(number, item));
            });
        }
    });
}

#[test]
fn options_without_an_effect_on_their_files_are_refused() {
    let folder = files();
    let before = contents(folder.path());
    on_threads(&refused_on_files(), |number, (command, sentence)| {
        let run = gs4d(&words(command, folder.path(), number));
        run.must_fail(sentence);
        assert!(run.err.contains(&format!("error: {sentence}")), "{command}: the sentence: {}", run.err);
        assert!(run.err.contains("; leave it out"), "{command}: the remedy: {}", run.err);
    });
    assert!(contents(folder.path()) == before, "nothing is written");
}

#[test]
fn options_with_an_effect_on_their_files_are_accepted() {
    let folder = files();
    on_threads(ACCEPTED, |number, command| {
        let run = gs4d(&words(command, folder.path(), number));
        assert_eq!(run.code, Some(0), "{command}: {}", run.err);
    });
}

/// Returns the options of a verb that its help lists.
fn options_of(verb: &str) -> BTreeSet<String> {
    let help = gs4d(&[verb, "--help"]).text();
    let name = |line: &str| {
        // `-o, --out`; examples may be wrapped before an option.
        let short = || line.strip_prefix("  -")?.get(1..)?.strip_prefix(", --");
        let long = line.strip_prefix("      --").or_else(short)?;
        let name: String = long.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '-').collect();
        Some(format!("--{name}"))
    };
    help.lines().filter_map(name).filter(|name| !["--json", "--help", "--version"].contains(&name.as_str())).collect()
}

/// Returns the verbs that the help of the command lists.
fn verbs() -> BTreeSet<String> {
    let help = gs4d(&["--help"]).text();
    let (_, list) = help.split_once("Commands:\n").expect("a list of verbs");
    let list = list.split("\n\n").next().expect("the list ends");
    let first = |line: &str| Some(line.strip_prefix("  ")?.split(' ').next()?.to_owned());
    // Other lines go on after more spaces.
    list.lines().filter_map(first).filter(|word| !word.is_empty() && word != "help").collect()
}

/// Returns the verb and the option that a refused command line is about: that of the sentence, or else the last one of
/// the command.
fn about(command: &str, sentence: &str) -> (String, String) {
    let mut words = command.split(' ');
    let verb = words.next().unwrap_or_default();
    let last = words.rfind(|word| word.starts_with("--")).unwrap_or_default();
    let option = if sentence.starts_with("--") { sentence.split(' ').next().unwrap_or_default() } else { last };
    (verb.to_owned(), option.to_owned())
}

#[test]
fn every_option_of_every_verb_always_has_an_effect_or_is_refused_somewhere() {
    let on_files = refused_on_files();
    let all = on_files.iter().map(|(command, sentence)| (command.as_str(), sentence.as_str()));
    let refused: BTreeSet<_> =
        all.chain(REFUSED.iter().copied()).map(|(command, sentence)| about(command, sentence)).collect();
    let listed: BTreeSet<String> = ALWAYS.iter().map(|(verb, _)| (*verb).to_owned()).collect();
    assert_eq!(listed, verbs(), "every verb");
    for (verb, always) in ALWAYS {
        let known = options_of(verb);
        let conditional: BTreeSet<_> =
            refused.iter().filter(|(of, _)| of == verb).map(|(_, option)| option.clone()).collect();
        let unknown: Vec<_> = conditional.difference(&known).collect();
        assert!(unknown.is_empty(), "{verb}: {unknown:?} are refused and not in the help");
        let rest: Vec<_> = known.difference(&conditional).map(String::as_str).collect();
        let mut always = always.to_vec();
        always.sort_unstable();
        assert_eq!(rest, always, "{verb}: the options that are refused nowhere are those that always have an effect");
    }
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
    let goal = arguments!["--ratio", "0.1", "--variant", "energy", "--engine", "cpu", "--quality", "small"];
    let fixed = arguments!["bake", &runtime, "--data", &capture.data, "-o", &out, "--progressive"];
    gs4d(&[fixed.to_vec(), goal.to_vec()].concat()).text();
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!((&info["form"], &info["gaussians"]), (&"packed".into(), &270.into()), "compressed: {info}");
    assert_eq!(info["package"]["layers"].as_array().map(Vec::len), Some(2), "a block is in the first layer: {info}");
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
