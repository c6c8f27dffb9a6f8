//! `gs4d detail`, run as a user runs it.
//!
//! In: a small synthetic scene. Out: proof that the package has the levels that the report names, that `gs4d render`
//! draws each level as the plugin does, that verbs which change a scene report that levels are left out, and that
//! datasets which do not show the scene and a size without a dataset are refused. Skipped where there is no GPU.

use crate::support::capture::Capture;
use crate::support::command::{Run, arguments, folder, gs4d, has_gpu, scene};
use crate::support::folders::contents;
use crate::support::no_gpu::no_gpu;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::offline::draw::orbit;
use bevy_gs4d::offline::engine::GpuSettings;
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::Picture;
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Options of a quick run that keeps its level.
const QUICK: [&str; 11] =
    ["--levels", "1", "--min-psnr", "0", "--steps", "5", "--directions", "2", "--times", "1", "--json"];

#[test]
fn levels_are_written_reported_and_left_out_by_other_verbs() {
    if !has_gpu() {
        return;
    }
    let folder = folder();
    let input = scene(&folder, "800");
    let [out, changed] = ["out.gs4d", "next.gs4d"].map(|name| folder.path().join(name));
    let mut command = arguments!["detail", &input, "-o", &out].to_vec();
    command.extend(QUICK.map(Into::into));
    let report = gs4d(&command).json();
    assert_eq!(report["kept"], 1, "every level meets a PSNR of 0: {report}");
    let gaussians = report["levels"][0]["gaussians"].as_u64().expect("a number");
    assert!((1..=114).contains(&gaussians), "at most a seventh of 800: {gaussians}");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    for fact in ["pixels", "gaussians"] {
        assert_eq!(info["levels"][0][fact], report["levels"][0][fact], "{fact} are those of the report");
    }
    assert_eq!(info["gaussians"], 800, "the scene has all Gaussians");
    let run = gs4d(&arguments!["mask", &out, "-o", &changed]);
    assert!(run.err.contains("levels of detail are left out"), "the report says that levels are left out: {}", run.err);
    run.text();
    let info = gs4d(&arguments!["info", &changed, "--json"]).json();
    assert_eq!(info["levels"].as_array().map(Vec::len), Some(0), "no levels of another scene");

    let draw = |name: &str, scene: &Path, more: &[&str]| {
        let mut command =
            arguments!["render", scene, "-o", folder.path().join(name), "--orbit", "1", "--json"].to_vec();
        command.extend(["--size", "64x64"].iter().chain(more).map(Into::into));
        gs4d(&command)
    };
    let [(all, zero), (level, one)] = [("all", [].as_slice()), ("level", &["--level", "1"])].map(|(name, more)| {
        let drawn = draw(name, &out, more).json();
        (drawn["frames"][0]["visible"].as_u64(), drawn["level"].as_u64())
    });
    assert_eq!((zero, one), (Some(0), Some(1)), "the requested levels");
    assert!(level > Some(0) && level <= Some(gaussians) && level < all, "{level:?} of {all:?}");
    draw("missing", &out, &["--level", "2"]).must_fail("has no level of detail 2; the coarsest is 1");
    draw("none", &changed, &["--level", "1"]).must_fail("gs4d detail");
}

#[test]
fn a_size_without_a_dataset_is_refused() {
    let folder = folder();
    let [input, out] = [scene(&folder, "20"), folder.path().join("out.gs4d")];
    for option in [["--size", "64x64"], ["--resolution", "2"]] {
        let mut command = arguments!["detail", &input, "-o", &out].to_vec();
        command.extend(option.map(Into::into));
        gs4d(&command).must_fail("--data");
        assert!(!out.exists(), "no output is written");
    }
}

#[test]
fn render_draws_a_level_with_the_training_pixel_of_the_level() {
    let Ok(mut headless) = GpuSettings::default().open() else { return no_gpu() };
    let folder = folder();
    let [out, frames] = ["out.gs4d", "frames"].map(|name| folder.path().join(name));
    let mut command = arguments!["detail", scene(&folder, "800"), "-o", &out].to_vec();
    command.extend(QUICK.map(Into::into));
    let report = gs4d(&command).json();
    assert_eq!(report["pixel"], Value::Null, "without --data the training pixel of all Gaussians is unknown: {report}");
    let size = UVec2::splat(24);
    let command = arguments!["render", &out, "-o", &frames, "--level", "1", "--orbit", "2", "--size", "24x24", "--raw"];
    gs4d(&command).text();

    // The plugin draws `level.scene` with the training pixel of `level.scene`.
    let all = codec::load(&out, &ReadOptions::default()).expect("the package can be read");
    let all = all.into_runtime().expect("the package can be drawn");
    let level = &all.levels[0].scene;
    let pixel = level.trained_with.pixel;
    assert!(pixel.is_some(), "a level has a training pixel");
    let capture = headless.upload(level).expect("the scene fits the GPU");
    for shot in orbit(&all, 2, size).expect("the scene has Gaussians") {
        let bytes = fs::read(frames.join(&shot.name).with_extension("f32")).expect("the raw picture exists");
        let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let drawn = Picture { size, pixels: values.chunks_exact(3).map(Vec3::from_slice).collect() };
        let mut psnr = |pixel| {
            let view = shot.view(&all).antialiased(pixel);
            let frame = headless.render(&capture, &view, all.trained_background()).expect("the view is drawn");
            SquaredError::of(&drawn, &frame.picture).expect("one size").psnr()
        };
        let (plugin, plain) = (psnr(pixel), psnr(None));
        assert!(plugin > 100.0, "{}: the picture is that of the plugin: {plugin} dB", shot.name);
        assert!(plain < 40.0, "{}: anti-aliasing changes the picture: {plain} dB", shot.name);
    }
}

/// Multiplies the camera-to-world matrix of each training frame with these signs and order of its columns.
fn turn_cameras(data: &Path, columns: [(usize, f64); 3]) {
    let path = data.join("transforms_train.json");
    let mut json: Value =
        serde_json::from_slice(&fs::read(&path).expect("the camera file exists")).expect("cameras are JSON");
    for frame in json["frames"].as_array_mut().expect("a list of frames") {
        for row in frame["transform_matrix"].as_array_mut().expect("a matrix") {
            let old = row.clone();
            for (column, (from, sign)) in columns.into_iter().enumerate() {
                row[column] = (sign * old[from].as_f64().expect("a number")).into();
            }
        }
    }
    fs::write(path, json.to_string()).expect("the folder can be written to");
}

/// Replaces all images of a folder by black ones.
fn blacken(folder: &Path) {
    for image in contents(folder).into_keys() {
        image::RgbImage::new(48, 48).save(image).expect("the folder can be written to");
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn datasets_that_do_not_show_the_capture_are_refused() {
    if !has_gpu() {
        return;
    }
    let capture = |images| {
        let trained = synthesize(&SynthSettings { count: 400, ..SynthSettings::default() });
        Capture::new(trained, Vec3::ZERO, 4, 2, UVec2::splat(48), images)
    };
    let detail = |capture: &Capture, more: &[&str]| -> Run {
        let mut command =
            arguments!["detail", &capture.scene, "--data", &capture.data, "-o", capture.path("out.gs4d")].to_vec();
        command.extend(QUICK.iter().chain(more).map(Into::into));
        gs4d(&command)
    };
    let refused = |capture: &Capture, reason: &str| {
        let run = detail(capture, &[]);
        assert_eq!(run.code, Some(2), "{reason}: the dataset is refused: {}", run.out);
        let error = serde_json::from_str::<Value>(&run.out).expect("one JSON document")["error"].to_string();
        assert!(error.contains(reason) && error.contains("--data"), "the error has the reason and the remedy: {error}");
        assert!(!capture.path("out.gs4d").exists(), "{reason}: no package is written");
    };
    let own = capture(true);
    assert!(detail(&own, &[]).json()["pixel"].is_f64(), "the images of the capture are accepted");
    let cameras_only = capture(false);
    assert!(detail(&cameras_only, &[]).json()["pixel"].is_f64(), "cameras without images are accepted");

    let black = capture(true);
    blacken(&black.data.join("train"));
    refused(&black, "do not show this capture");
    let trusted = detail(&black, &["--trust-images"]).json();
    assert!(trusted["pixel"].is_f64(), "--trust-images skips the check of images: {trusted}");

    // To the side, where some Gaussians are in front of the camera and none in its picture, and to the back.
    for columns in [[(2, 1.0), (1, 1.0), (0, -1.0)], [(0, -1.0), (1, 1.0), (2, -1.0)]] {
        for images in [false, true] {
            let away = capture(images);
            turn_cameras(&away.data, columns);
            if images {
                blacken(&away.data.join("train"));
            }
            refused(&away, "no training view shows any of its Gaussians");
        }
    }
}
