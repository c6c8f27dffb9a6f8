//! `info` on the folders of datasets.
//!
//! In: small datasets. Out: proof that counts, splits, missing files and assumptions are shown, that cameras are drawn,
//! and that wrong folders are refused.

use crate::support::capture::Capture;
use crate::support::command::{arguments, folder, gs4d, has_gpu, scene};
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::offline;
use bevy_gs4d::scene::Origin;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Writes a nerfstudio file of cameras on a line, without images.
fn write(folder: &Path, cameras: usize) {
    let frame = |index: usize| {
        json!({
            "file_path": format!("images/f{index}.png"), "time": index,
            "transform_matrix": [[1, 0, 0, index], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]],
        })
    };
    let frames: Vec<Value> = (0..cameras).map(frame).collect();
    let file = json!({ "w": 40, "h": 30, "fl_x": 50, "fl_y": 50, "cx": 20, "cy": 15, "frames": frames });
    fs::write(folder.join("transforms.json"), file.to_string()).expect("the folder can be written to");
}

#[test]
fn a_dataset_is_described_and_its_cameras_are_drawn() {
    let folder = folder();
    let data = folder.path().join("data");
    fs::create_dir(&data).expect("the folder can be made");
    write(&data, 10);
    let picture = folder.path().join("cameras.png");
    let json = gs4d(&arguments!["info", &data, "--cameras", &picture, "--json"]).json();
    assert_eq!((&json["cameras"], &json["times"]), (&10.into(), &10.into()), "ten cameras, each at its own time");
    assert_eq!(json["sizes"], json!([[40, 30]]), "the size of the pictures");
    assert_eq!(json["time_interval"], json!([0.0, 9.0]), "the first and the last time");
    let views: Vec<&Value> = json["splits"].as_array().expect("splits").iter().map(|split| &split["views"]).collect();
    assert_eq!(views, [8, 2], "training and test views");
    assert!(json["missing"][0].as_str().is_some_and(|text| text.starts_with("10 images")), "no image: {json}");
    let drawn = image::open(&picture).expect("the picture can be read").into_rgb8();
    assert_eq!(drawn.dimensions(), (1024, 512), "two parts");
    assert!(drawn.pixels().any(|pixel| pixel.0[0] > 150 && pixel.0[2] < 80), "the cameras are drawn in red");
    let text = gs4d(&arguments!["info", &data]).text();
    for part in ["nerfstudio", "10 from 0 to 9", "40 x 30", "train", "10 images or masks are not on disk"] {
        assert!(text.contains(part), "{part:?} is not in: {text}");
    }
}

#[test]
fn wrong_datasets_are_refused_with_their_cause() {
    let folder = folder();
    gs4d(&arguments!["info", folder.path()]).must_fail("poses_bounds.npy");
    write(folder.path(), 1);
    gs4d(&arguments!["info", folder.path()]).must_fail("one view");
    write(folder.path(), 3);
    let inside = folder.path().join("transforms.json");
    gs4d(&arguments!["info", folder.path(), "--cameras", &inside]).must_fail("transforms.json");
    gs4d(&arguments!["info", &inside, "--cameras", folder.path().join("a.png")]).must_fail("--cameras");
}

#[test]
fn info_decodes_no_video() {
    let folder = folder();
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 17), }\n";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for x in [0.0, 1.0] {
        let row = [0.0, 1.0, 0.0, x, 30.0, -1.0, 0.0, 0.0, 0.0, 40.0, 0.0, 0.0, 1.0, 3.0, 50.0, 0.1, 100.0];
        bytes.extend(row.into_iter().flat_map(f64::to_le_bytes));
    }
    let data = folder.path().join("data");
    fs::create_dir(&data).expect("the folder can be made");
    fs::write(data.join("poses_bounds.npy"), bytes).expect("the folder can be written to");
    for name in ["cam00.mp4", "cam07.mp4"] {
        fs::write(data.join(name), b"no video").expect("the folder can be written to");
    }
    let json = gs4d(&arguments!["info", &data, "--json"]).json();
    assert_eq!(json["cameras"], 2, "a camera for each row");
    assert!(json["missing"].to_string().contains("2 videos have not been decoded"), "the videos are named: {json}");
    assert!(!json["missing"].to_string().contains("static"), "the times of videos are not known yet: {json}");
    assert!(!folder.path().join("data.frames").exists(), "no frames are written");
}

/// Writes a COLMAP model of images in the subfolders of these names, two in each, without images.
fn write_colmap(folder: &Path, names: [&str; 2]) {
    let model = folder.join("sparse/0");
    fs::create_dir_all(&model).expect("the folder can be made");
    fs::write(model.join("cameras.txt"), "1 PINHOLE 40 30 50 50 20 15\n").expect("the folder can be written to");
    let image = |index: usize| {
        let name = names[index / 2];
        format!("{index} 1 0 0 0 {index} 0 3 1 {name}/{name}_{index}.png\n\n")
    };
    let images: String = (0..4).map(image).collect();
    fs::write(model.join("images.txt"), images).expect("the folder can be written to");
}

#[test]
fn assumptions_about_a_dataset_are_shown() {
    let folder = folder();
    let data = folder.path().join("data");
    write_colmap(&data, ["day", "night"]);
    let json = gs4d(&arguments!["info", &data, "--json"]).json();
    assert_eq!((&json["times"], json["notes"].as_array().map(Vec::len)), (&1.into(), Some(1)), "one time: {json}");
    assert!(json["notes"][0].as_str().is_some_and(|note| note.contains("day, night")), "the folders: {json}");
    write_colmap(&data, ["cam0", "cam1"]);
    let text = gs4d(&arguments!["info", &data]).text();
    assert!(text.contains("4 from 0 to 0.1") && text.contains("--static"), "frames of cameras: {text}");
    let json = gs4d(&arguments!["info", &data, "--static", "--json"]).json();
    assert_eq!((&json["times"], &json["notes"]), (&1.into(), &json!([])), "nothing is assumed");
    gs4d(&arguments!["info", data.join("sparse/0/images.txt"), "--static"]).must_fail("--static");
}

#[test]
fn assumptions_about_a_dataset_are_noted_by_each_command() {
    let folder = folder();
    let data = folder.path().join("data");
    write_colmap(&data, ["cam0", "cam1"]);
    let (scene, out) = (scene(&folder, "50"), folder.path().join("out.f32"));
    let line = arguments!["score", scene, "--data", data, "--engine", "cpu", "--variant", "energy", "--out", out];
    let run = gs4d(&line);
    assert_eq!(run.err.matches("note: ").count(), 1, "one note: {}", run.err);
    assert!(run.err.contains("data: images in subfolders (cam0, cam1; 2 in all)"), "the folder: {}", run.err);
    let run = gs4d(&[&line[..], &arguments!["--static"]].concat());
    assert_eq!((run.code, run.err.contains("note: ")), (Some(0), false), "nothing is assumed: {}", run.err);
}

/// A place in coordinates of UTM, and a time in seconds since 1970.
const FAR: Origin = Origin { place: [500_000.0, 5_400_000.0, 300.0], time: 1_700_000_000.0 };

/// Returns a capture of a synthetic scene, whose dataset is moved to [`FAR`], and the path of the scene with this
/// origin.
fn far_capture() -> (Capture, std::path::PathBuf) {
    let mut trained = synthesize(&SynthSettings { count: 400, ..SynthSettings::default() });
    let capture = Capture::new(trained.clone(), Vec3::ZERO, 3, 3, UVec2::splat(48), true);
    for split in ["train", "test"] {
        let path = capture.data.join(format!("transforms_{split}.json"));
        let text = fs::read_to_string(&path).expect("the dataset was just written");
        let mut json: Value = serde_json::from_str(&text).expect("JSON");
        for frame in json["frames"].as_array_mut().expect("frames") {
            frame["time"] = json!(frame["time"].as_f64().expect("a number") + FAR.time);
            for (axis, from) in FAR.place.into_iter().enumerate() {
                let at = &mut frame["transform_matrix"][axis][3];
                *at = json!(at.as_f64().expect("a number") + from);
            }
        }
        fs::write(path, json.to_string()).expect("the folder can be written to");
    }
    trained.trained_with.origin = FAR;
    let scene = capture.path("far.gs4d");
    offline::work::save(&scene, &trained, &WriteSettings::default()).expect("the folder can be written to");
    (capture, scene)
}

#[test]
fn datasets_far_from_0_are_read_from_the_origin_of_the_scene() {
    let (capture, scene) = far_capture();
    let run =
        gs4d(&arguments!["eval", &scene, "--data", &capture.data, "--engine", "cpu", "--metrics", "psnr", "--json"]);
    assert!(!run.err.contains("outside"), "every view is inside the time interval: {}", run.err);
    let json = run.json();
    let psnr = json["mean"]["psnr"].as_f64().expect("a number");
    assert!(psnr > 55.0, "the scene is where its pictures show it, but for the rounding to 8 bits: {psnr} dB");
    let json = gs4d(&arguments!["info", &capture.data, "--json"]).json();
    assert_eq!(
        (&json["cameras"], &json["times"]),
        (&5.into(), &3.into()),
        "the cameras and times are told apart: {json}"
    );
    assert_eq!(json["time_interval"], json!([0.0, 1.0]), "times are counted from the first");
    let notes = json["notes"].to_string();
    for part in ["500000, 5400000, 302", "1700000000"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
    if !has_gpu() {
        return;
    }
    let (cameras, out) = (capture.data.join("transforms_test.json"), capture.path("pictures"));
    let run = gs4d(&arguments!["render", &scene, "--cameras", &cameras, "--out", &out]);
    assert!(!run.err.contains("outside"), "the times of a camera file are counted from the origin, too: {}", run.err);
    run.text();
}

#[test]
fn a_capture_of_a_dataset_far_from_0_has_an_origin() {
    if !has_gpu() {
        return;
    }
    let (capture, _) = far_capture();
    let out = capture.path("trained.gs4d");
    let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "50", "--sh-degree", "0"];
    let more = ["--steps", "2", "--validation", "none", "--time-interval", "1700000000,1700000002", "--json"];
    let run = gs4d(&[command.to_vec(), more.map(Into::into).to_vec()].concat());
    assert_eq!(run.err.matches("500000, 5400000, 302").count(), 1, "the origin is noted once: {}", run.err);
    assert_eq!(run.json()["time_interval"], json!([0.0, 2.0]), "an interval of the dataset, counted from its origin");
    let found = codec::load(&out, &ReadOptions::default()).expect("a package").trained_with;
    let expected = Origin { place: [500_000.0, 5_400_000.0, 302.0], ..FAR };
    assert_eq!((found.origin, found.time_interval), (expected, [0.0, 2.0]), "the package has it");
    let run = gs4d(&arguments!["eval", &out, "--data", &capture.data, "--metrics", "psnr", "--json"]);
    assert!(!run.err.contains("outside"), "the dataset is read from the origin of the package: {}", run.err);
    assert_eq!(run.json()["views"].as_array().map(Vec::len), Some(6), "every test view");
}
