//! `gs4d train`, run as a user runs it, on pictures of a synthetic scene.
//!
//! In: a dataset drawn here. Out: proof that a capture is trained from the pictures alone, that the package is written
//! while training goes on and after an interruption, and that data that no capture can be trained on is refused and
//! leaves no files. Skipped where there is no GPU.

use crate::support::capture::Capture;
use crate::support::command::{GS4D, Run, arguments, gs4d, has_gpu};
use crate::support::folders;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use image::{RgbImage, Rgba, RgbaImage};
use serde_json::{Value, json};
use std::fs;

/// Returns a dataset of 4 cameras and 4 times; `None` if there is no GPU.
fn dataset() -> Option<Capture> {
    if !has_gpu() {
        return None;
    }
    let scene = synthesize(&SynthSettings { count: 400, ..SynthSettings::default() });
    let capture = Capture::new(scene, Vec3::ZERO, 4, 4, UVec2::splat(40), true);
    fs::remove_file(&capture.scene).expect("the scene exists");
    Some(capture)
}

#[test]
fn a_capture_is_trained_from_the_pictures_of_a_dataset() {
    let Some(capture) = dataset() else { return };
    let out = capture.path("out.gs4d");
    let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "300", "--sh-degree", "1"];
    let short = ["--steps", "240", "--evaluate-every", "80", "--mean-rate", "4", "--json"].map(Into::into);
    let json = gs4d(&[command.to_vec(), short.to_vec()].concat()).json();
    assert_eq!(
        (json["gaussians"].as_u64(), json["views"].as_u64(), json["start"].as_str()),
        (Some(300), Some(12), Some("random")),
        "the images have no silhouettes, and one of four cameras is held out: {json}"
    );
    let curve = json["curve"].as_array().expect("a curve");
    let (first, best) = (curve[0]["psnr"].as_f64().expect("a number"), json["psnr"].as_f64().expect("a number"));
    assert!(
        curve.len() == 4 && best - first > 5.0 && best > 18.0,
        "training raises the PSNR of the camera held out from {first:.2} to {best:.2} dB, 18 expected"
    );
    assert_eq!(folders::names(capture.folder.path()), ["data", "out.gs4d"], "no state is left");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!((info["gaussians"].as_u64(), info["form"].as_str()), (Some(300), Some("trained")), "{info}");
    gs4d(&arguments!["eval", &out, "--data", &capture.data, "--metrics", "psnr", "--json"]).json();
}

#[test]
fn training_begins_with_points_of_the_dataset_or_of_a_file() {
    let Some(capture) = dataset() else { return };
    let out = capture.path("out.gs4d");
    let run = |more: &[&str]| {
        let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "50", "--sh-degree", "0"];
        let more = ["--steps", "2", "--validation", "none", "--json"].iter().chain(more).map(Into::into).collect();
        gs4d(&[command.to_vec(), more].concat())
    };
    run(&["--start", "points"]).must_fail("the dataset has no file of points");
    let beside = capture.data.join("points3d.ply");
    let header =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    fs::write(&beside, format!("{header}0 0 0\n0.1 0 0\n")).expect("the folder can be written to");
    assert_eq!(run(&[]).json()["start"].as_str(), Some("points"), "points before random places");
    assert_eq!(run(&["--start", "random"]).json()["start"].as_str(), Some("random"), "as asked");
    let given = capture.path("points3D.txt");
    fs::write(&given, "1 0 0 0 255 0 0 0.5\n").expect("the folder can be written to");
    let points = given.to_str().expect("a path in UTF-8");
    let red = run(&["--points", points]);
    assert_eq!(red.json()["start"].as_str(), Some("points"), "the file that is given");
    run(&["--points", points, "--start", "hull"]).must_fail("--points has no effect with --start hull");
    fs::write(&given, "").expect("the folder can be written to");
    run(&["--points", points]).must_fail("points3D.txt: has no points with finite places");
    fs::write(&beside, "ply\n").expect("the folder can be written to");
    run(&[]).must_fail("points3d.ply");
}

#[test]
fn exposures_are_reported_and_not_stored() {
    let Some(capture) = dataset() else { return };
    let out = capture.path("out.gs4d");
    let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "100", "--sh-degree", "0"];
    let short = ["--steps", "20", "--validation", "none", "--exposure"].map(Into::into);
    let command = [command.to_vec(), short.to_vec()].concat();
    let text = gs4d(&command).text();
    assert!(text.contains("of 4 cameras, gains "), "one for each training camera: {text}");
    let json = gs4d(&[command, vec!["--json".into()]].concat()).json();
    let exposures = json["exposures"].as_array().expect("a list");
    let rows = exposures.iter().map(|exposure| exposure.as_array().map_or(0, Vec::len));
    assert_eq!(rows.collect::<Vec<_>>(), [3; 4], "three rows each: {json}");
}

#[test]
fn gaussians_are_cloned_and_split_as_in_the_original_on_request() {
    let Some(capture) = dataset() else { return };
    let out = capture.path("out.gs4d");
    let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "200", "--sh-degree", "0"];
    let command = [command.to_vec(), ["--densify", "original", "--json"].map(Into::into).to_vec()].concat();
    let run = |more: &[&str]| gs4d(&[command.clone(), more.iter().map(Into::into).collect()].concat());
    run(&["--noise", "1"]).must_fail("--noise has no effect with --densify original");
    run(&["--rigid-weight", "1"]).must_fail("--rigid-weight");
    let run = run(&["--steps", "240", "--evaluate-every", "120"]);
    assert!(run.err.contains(" cloned, "), "progress has what was done: {}", run.err);
    let json = run.json();
    let count = json["gaussians"].as_u64().expect("a number");
    assert!(count != 50 && count <= 200, "a quarter at first, at most as many as asked for: {json}");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!(info["gaussians"].as_u64(), Some(count), "the package has no other Gaussians: {info}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_has_written_the_best_parameters() {
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};

    let Some(capture) = dataset() else { return };
    let out = capture.path("out.gs4d");
    let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "200", "--steps", "1000000"];
    let command = [command.to_vec(), ["--evaluate-every", "20", "--json"].map(Into::into).to_vec()].concat();
    let child = Command::new(GS4D).args(command).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.expect("the command starts");
    let mut lines = BufReader::new(child.stderr.take().expect("standard error is piped"));
    let (mut err, mut line) = (String::new(), String::new());
    while lines.read_line(&mut line).expect("standard error can be read") > 0 {
        let step = line.strip_prefix("step ").and_then(|rest| rest.split_once(':'));
        let step: u32 = step.and_then(|(number, _)| number.parse().ok()).unwrap_or(0);
        err.push_str(&std::mem::take(&mut line));
        // A thread writes it, which has to wait for a core.
        assert!(step < 2_000 || out.is_file(), "the package is written while training goes on: {err}");
        if step >= 40 && out.is_file() {
            let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
            assert!(killed.expect("kill runs").success(), "the command can be interrupted");
            break;
        }
    }
    lines.read_to_string(&mut err).expect("standard error can be read");
    let run = Run::of(&child.wait_with_output().expect("the command ends"));
    assert_eq!(run.code, Some(130), "an interrupted run has exit code 130: {err}");
    let json: Value = serde_json::from_str(&run.out).expect("one JSON document");
    assert_eq!((&json["interrupted"], json["gaussians"].as_u64()), (&true.into(), Some(200)), "{json}");
    assert!(err.contains("200 Gaussians") && err.contains(" left"), "progress has count and time left: {err}");
    let shown = capture.path("out.gs4d.train/training.png");
    assert!(err.contains(&format!("{} shows a view", shown.display())), "the picture is named: {err}");
    let picture = image::open(shown).expect("the picture of the last evaluation is whole").to_rgb8();
    assert_eq!(picture.dimensions(), (120, 40), "image, capture and difference side by side");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!(info["gaussians"].as_u64(), Some(200), "the package is whole: {info}");
}

#[test]
fn data_that_no_capture_can_be_trained_on_is_refused() {
    let Some(capture) = dataset() else { return };
    let out = capture.path("out.gs4d");
    let before = folders::names(capture.folder.path());
    let run = |more: &[&str]| {
        let command = arguments!["train", "--data", &capture.data, "-o", &out, "--steps", "2"];
        gs4d(&[command.to_vec(), more.iter().map(Into::into).collect()].concat())
    };
    run(&["--start", "hull"]).must_fail("--start random");
    run(&["--gaussians", "100000000"]).must_fail("--gaussians");
    let path = capture.data.join("transforms_train.json");
    let text = fs::read_to_string(&path).expect("the dataset was just written");
    let mut json: Value = serde_json::from_str(&text).expect("JSON");
    let frames = json["frames"].as_array_mut().expect("frames");
    let first = frames[0]["transform_matrix"].clone();
    frames.iter_mut().for_each(|frame| frame["transform_matrix"] = first.clone());
    fs::write(&path, json.to_string()).expect("the folder can be written to");
    run(&["--validation", "none"]).must_fail("from one place");
    // Cameras inside the object: each looks away from the axis, horizontally.
    let mut json: Value = serde_json::from_str(&text).expect("JSON");
    for frame in json["frames"].as_array_mut().expect("frames") {
        let rows = &mut frame["transform_matrix"];
        let [x, y, z] = [0, 1, 2].map(|row| rows[row][3].as_f64().expect("a number"));
        let (cos, sin) = (x / x.hypot(y), y / x.hypot(y));
        *rows = json!([[sin, 0, -cos, x], [-cos, 0, -sin, y], [0, 1, 0, z], [0, 0, 0, 1]]);
    }
    fs::write(&path, json.to_string()).expect("the folder can be written to");
    run(&["--validation", "none"]).must_fail("look away from each other");
    fs::write(&path, text).expect("the folder can be written to");
    let image = capture.data.join("train/c01_02.png");
    RgbImage::new(40, 20).save(&image).expect("the folder can be written to");
    run(&[]).must_fail(
        "c01_02.png: 40 x 20 pixels do not have the aspect ratio of the pictures of the camera file, 40 x 40",
    );
    fs::remove_file(image).expect("the image exists");
    run(&[]).must_fail("c01_02.png");
    assert_eq!(folders::names(capture.folder.path()), before, "no file is left");
}

#[test]
fn pictures_are_baked_in_one_command() {
    let Some(capture) = dataset() else { return };
    let (out, trained) = (capture.path("out.gs4d"), capture.path("out.trained.gs4d"));
    let bake = |more: &[&str]| {
        let command = arguments!["bake", &capture.data, "-o", &out, "--engine", "gpu", "--json", "--keep-work"];
        let training =
            ["--gaussians", "300", "--train-steps", "40", "--steps", "10", "--rounds", "1", "--trust-images"];
        gs4d(&[command.to_vec(), training.iter().chain(more).map(Into::into).collect()].concat())
    };
    let first = bake(&["--keep", "200"]);
    assert!(!first.err.contains("skipped, done before"), "nothing was trained before: {}", first.err);
    let json = first.json();
    assert_eq!(json["gaussians"]["after"].as_u64(), Some(200), "the package has as many as are kept: {json}");
    let info = gs4d(&arguments!["info", &trained, "--json"]).json();
    assert_eq!((info["gaussians"].as_u64(), info["form"].as_str()), (Some(300), Some("trained")), "{info}");
    let again = bake(&["--keep", "150"]);
    assert!(again.err.contains("train: skipped, done before"), "the training does not depend on --keep: {}", again.err);
    bake(&["--keep", "150", "--data", "elsewhere"]).must_fail("--data has no effect");
    bake(&["--keep", "150", "--raster-fov", "corrected"]).must_fail("--raster-fov has no effect");
    gs4d(&arguments!["bake", &trained, "-o", &out]).must_fail("give --data DIR");
    gs4d(&arguments!["bake", &trained, "--data", &capture.data, "-o", &out, "--train-steps", "5"])
        .must_fail("--train-steps");
    gs4d(&arguments!["bake", &capture.data, "-o", &out, "--engine", "cpu"]).must_fail("needs a GPU");
}

#[test]
fn a_bake_trains_exposures_and_an_environment_map_on_request() {
    let Some(capture) = dataset() else { return };
    let bake = |name: &str, more: &[&str]| {
        let command = arguments!["bake", &capture.data, "-o", &capture.path(&format!("{name}.gs4d")), "--json"];
        let short = ["--gaussians", "100", "--train-steps", "20", "--steps", "5", "--rounds", "1", "--keep", "80"];
        let rest = ["--engine", "gpu", "--validation", "none", "--trust-images"].iter().chain(more);
        gs4d(&[command.to_vec(), short.iter().chain(rest).map(Into::into).collect()].concat()).json();
        let trained = capture.path(&format!("{name}.trained.gs4d"));
        (gs4d(&arguments!["info", &trained, "--json"]).json(), fs::read(trained).expect("the trained capture"))
    };
    let (_, plain) = bake("plain", &["--exposure=off"]);
    let (info, with_map) = bake("map", &["--exposure=off", "--environment", "4"]);
    assert_eq!(info["environment"], json!([8, 4]), "twice as wide as high: {info}");
    let (info, _) = bake("red", &["--background", "1,0,0"]);
    assert_eq!(info["environment"], json!([64, 32]), "black borders are surroundings before red: {info}");
    let (_, exposed) = bake("exposed", &["--exposure"]);
    assert!(plain != exposed && plain != with_map, "the exposures of the cameras change what is trained");
}

#[test]
fn an_environment_map_is_trained_where_images_show_surroundings() {
    let Some(capture) = dataset() else { return };
    let out = capture.path("out.gs4d");
    let map = |more: &[&str]| {
        let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "50", "--sh-degree", "0"];
        let short = ["--steps", "2", "--validation", "none", "--json"].iter().chain(more).map(Into::into);
        gs4d(&[command.to_vec(), short.collect()].concat()).json()["environment"].clone()
    };
    assert_eq!(map(&[]), Value::Null, "a scene before the color of the background");
    assert_eq!(map(&["--background", "1,0,0"]), json!([64, 32]), "black surroundings are not red");
    assert_eq!(map(&["--background", "1,0,0", "--environment", "0"]), Value::Null, "as asked");
}

#[test]
fn the_duration_is_that_of_the_film_unless_given() {
    let Some(capture) = dataset() else { return };
    let path = capture.data.join("transforms_train.json");
    let mut json: Value = serde_json::from_str(&fs::read_to_string(&path).expect("a camera file")).expect("JSON");
    json["seconds"] = json!([1.5, 5.5]);
    fs::write(&path, json.to_string()).expect("the folder can be written to");
    let out = capture.path("out.gs4d");
    let seconds = |more: &[&str]| {
        let command = arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "50", "--sh-degree", "0"];
        let short = ["--steps", "2", "--validation", "none", "--json"].iter().chain(more).map(Into::into);
        gs4d(&[command.to_vec(), short.collect()].concat()).json()["duration_seconds"].as_f64()
    };
    assert_eq!(seconds(&[]), Some(4.0), "from the seconds of the film");
    assert_eq!(seconds(&["--duration", "2.5"]), Some(2.5), "as given");
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn opaque_images_with_poses_of_others_are_an_error_at_the_end() {
    let Some(capture) = dataset() else { return };
    let path = capture.data.join("transforms_train.json");
    let mut json: Value = serde_json::from_str(&fs::read_to_string(&path).expect("a camera file")).expect("JSON");
    let frames = json["frames"].as_array_mut().expect("frames");
    for (index, frame) in frames.iter_mut().enumerate() {
        // Each looks at the axis from another side.
        let (sin, cos) = (2.4 * index as f64).sin_cos();
        frame["transform_matrix"] =
            json!([[-sin, 0, cos, 4.0 * cos], [cos, 0, sin, 4.0 * sin], [0, 1, 0, 0], [0, 0, 0, 1]]);
    }
    fs::write(&path, json.to_string()).expect("the folder can be written to");
    let out = capture.path("out.gs4d");
    let run = |more: &[&str]| {
        let command =
            arguments!["train", "--data", &capture.data, "-o", &out, "--gaussians", "100", "--sh-degree", "0"];
        let short =
            ["--steps", "1000", "--evaluate-every", "1000", "--validation", "times"].iter().chain(more).map(Into::into);
        gs4d(&[command.to_vec(), short.collect()].concat())
    };
    run(&[]).must_fail("are its poses those of its images? --trust-images skips this check");
    assert!(out.is_file(), "the package is written");
    run(&["--trust-images"]).text();
}

#[test]
fn silhouettes_of_other_poses_are_named_as_the_cause() {
    let Some(capture) = dataset() else { return };
    // Every camera looks at the middle, and has its object in a corner.
    let corner = RgbaImage::from_fn(40, 40, |x, y| Rgba([200, 200, 200, if x < 3 && y < 3 { 255 } else { 0 }]));
    for path in fs::read_dir(capture.data.join("train")).expect("the images") {
        corner.save(path.expect("an image").path()).expect("the folder can be written to");
    }
    let out = capture.path("out.gs4d");
    for start in ["auto", "hull"] {
        let command = arguments!["train", "--data", &capture.data, "-o", &out, "--steps", "2", "--start", start];
        gs4d(&command).must_fail("masks or poses of another scene?");
    }
    assert!(!out.exists(), "no package is written");
}
