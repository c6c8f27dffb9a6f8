//! `gs4d render` and `bench`, run as a user runs them.
//!
//! In: a synthetic scene; with `GS4D_DATA` set, the trained captures. Out: proof that pictures are written and frames
//! timed, and that renders match the original. Skipped where there is no GPU.

use crate::support::capture::Capture;
use crate::support::command::{arguments, folder, gs4d, has_gpu, scene};
use crate::support::data::data;
use crate::support::folders::contents;
use crate::support::no_gpu::no_gpu;
use crate::support::npz;
use crate::support::skip::skip;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::offline::work::save;
use bevy_gs4d::renderer::GpuContext;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{SceneForm, Trained};
use bevy_gs4d::view::Picture;
use glam::{UVec2, Vec3};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn pictures_are_drawn_and_written() {
    if !has_gpu() {
        return;
    }
    let folder = folder();
    let (path, frames) = (scene(&folder, "3000"), folder.path().join("deep/frames"));
    let json = gs4d(&arguments![
        "render", &path, "--orbit", "3", "--size", "64x48", "--raw", "--checks", "--json", "--out", &frames,
    ])
    .json();
    let list = json["frames"].as_array().expect("a list of frames");
    assert_eq!(list.len(), 3, "the requested number of pictures");
    assert_eq!((&list[0]["time"], &list[2]["time"]), (&0.0.into(), &1.0.into()), "the pictures span the time interval");
    for index in 0..3 {
        let raw = raw_picture(&frames.join(format!("orbit_{index:04}.f32")), UVec2::new(64, 48));
        let png = image::open(frames.join(format!("orbit_{index:04}.png"))).expect("a picture").into_rgb8();
        assert_eq!(png, raw.to_rgb8(), "the PNG is the raw picture in 8 bits");
        let lit = raw.pixels.iter().filter(|pixel| pixel.max_element() > 0.1).count();
        assert!(lit > 64 * 48 / 50, "the picture shows the scene: {lit} pixels");
    }
    let alike = gs4d(&arguments!["compare", &frames, &frames, "--size", "64x48", "--json"]).json();
    assert_eq!(
        alike["pictures"].as_array().map(Vec::len),
        Some(3),
        "raw pictures are compared in place of PNG files of the same name"
    );
    assert_eq!(
        alike["mean"]["identical"].as_u64(),
        alike["pictures"].as_array().map(|list| list.len() as u64),
        "pictures are identical to themselves"
    );
}

#[test]
fn images_of_a_camera_file_are_written_only_if_none_of_them_exists() {
    if !has_gpu() {
        return;
    }
    let trained = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
    let capture = Capture::new(trained, Vec3::ZERO, 4, 2, UVec2::splat(48), true);
    let (cameras, out) = (capture.data.join("transforms_test.json"), capture.data.join("test"));
    let render = || gs4d(&arguments!["render", &capture.scene, "--cameras", &cameras, "--out", &out]);
    let images: Vec<PathBuf> = contents(&out).into_keys().collect();
    assert_eq!(images.len(), 4, "two test cameras at two times");
    for image in &images {
        render().must_fail("the input itself");
        fs::remove_file(image).expect("the folder can be written to");
    }
    render().text();
    assert_eq!(contents(&out).into_keys().collect::<Vec<_>>(), images, "the images that the camera file names");
    render().must_fail("the input itself");
}

#[test]
fn empty_pictures_of_gaussians_nearer_than_the_near_limit_are_noted() {
    if !has_gpu() {
        return;
    }
    let folder = folder();
    let [path, cameras, frames] = ["scene.gs4d", "near.json", "frames"].map(|name| folder.path().join(name));
    let mut scene = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
    let SceneForm::Trained(Trained { parameters, .. }) = &mut scene.form else { panic!("the trained form") };
    parameters.mean.as_flattened_mut().iter_mut().for_each(|value| *value *= 0.01);
    parameters.log_scale.as_flattened_mut().iter_mut().for_each(|value| *value += 0.01f32.ln());
    let frame = |name: &str, x: f32| {
        let matrix = [[1.0, 0.0, 0.0, x], [0.0, 0.0, -1.0, -0.05], [0.0, 1.0, 0.0, 0.005], [0.0, 0.0, 0.0, 1.0]];
        json!({ "file_path": name, "time": 0.5, "transform_matrix": matrix })
    };
    let views = json!({ "camera_angle_x": 0.7, "w": 32, "h": 32, "frames": [frame("a", 0.0), frame("b", 0.001)] });
    fs::write(&cameras, views.to_string()).expect("the folder can be written to");
    for (near, note) in [(0.2, true), (0.001, false)] {
        scene.trained_with.near = near;
        save(&path, &scene, &WriteSettings::default()).expect("the folder can be written to");
        let run = gs4d(&arguments!["render", &path, "--cameras", &cameras, "--out", &frames]);
        assert_eq!(run.code, Some(0), "the pictures are drawn: {}", run.err);
        let said = run.err.contains("2 of 2 pictures show nothing") && run.err.contains("0.2 units");
        assert_eq!(said, note, "with a near limit of {near}: {}", run.err);
    }
}

#[test]
fn pictures_that_do_not_fit_are_refused_before_they_are_drawn() {
    let limit = match GpuContext::headless(None) {
        Ok(context) => context.device.limits().max_buffer_size,
        Err(_) => return no_gpu(),
    };
    let folder = folder();
    let (path, frames) = (scene(&folder, "100"), folder.path().join("frames"));
    for (size, bytes) in [("16384x16384", 1u64 << 32), ("16384x8192", 1 << 31)] {
        if bytes <= limit {
            skip(format_args!("this GPU has room for a picture of {size}"));
            continue;
        }
        let run = gs4d(&arguments!["render", &path, "--orbit", "1", "--size", size, "--out", &frames]);
        run.must_fail("smaller");
        let has_size = run.err.contains("GB are available") || run.err.contains(&format!("{bytes} bytes"));
        assert!(has_size, "{size}: the error has the needed memory: {}", run.err);
        assert!(!frames.join("orbit_0000.png").exists(), "{size}: no picture is written");
    }
}

#[test]
fn bench_reports_times_and_counts() {
    if !has_gpu() {
        return;
    }
    let folder = folder();
    let path = scene(&folder, "1000");
    let bench = |path: &Path, more: &[&str]| {
        let fixed =
            arguments!["bench", path, "--frames", "3", "--views", "2", "--times", "2", "--size", "64x64"].to_vec();
        gs4d(&[fixed, more.iter().map(Into::into).collect()].concat())
    };
    let json = bench(&path, &["--json"]).json();
    let row = &json["rows"][0];
    assert_eq!((&row["views"], &row["timings"]["frames"]), (&4.into(), &3.into()), "two views at two times");
    assert!(row["timings"]["wall_milliseconds"].as_f64().is_some_and(|ms| ms > 0.0), "frames take time");
    let [evaluated, contributing] =
        ["evaluated", "contributing"].map(|name| row["splats_per_pixel"][name].as_f64().expect("a number"));
    assert!(0.0 < contributing && contributing <= evaluated, "{contributing} of {evaluated} splats are blended");
    assert_eq!(row["timings"]["active"], 1000, "no filter");
    let ways = ["--renderer", "bins,sort", "--filter", "on,off", "--form", "stored,fp32", "--rounds", "2", "--json"];
    let (masked, packed) = (folder.path().join("masked.gs4d"), folder.path().join("packed.gs4d"));
    gs4d(&arguments!["mask", &path, "-o", &masked]).text();
    gs4d(&arguments!["compress", &masked, &packed, "--codebooks", "4", "--verify", "0"]).text();
    let json = bench(&packed, &ways).json();
    let rows = json["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 8, "every combination");
    let counts: Vec<_> = rows.iter().map(|row| &row["timings"]["counts"]).collect();
    assert!(counts.iter().all(|found| *found == counts[0]), "the same counts in every row: {counts:?}");
    assert!(rows.iter().all(|row| row["rounds"]["count"] == 2), "two rounds");
    assert!(bench(&path, &[]).text().contains("frame, many in flight"), "a table");
    gs4d(&arguments!["bench", &path, "--adapter", "no such card"]).must_fail("no such card");
}

fn raw_picture(path: &Path, size: UVec2) -> Picture {
    let bytes = fs::read(path).expect("the raw picture exists");
    assert_eq!(bytes.len(), size.x as usize * size.y as usize * 12, "height x width x 3 float32");
    let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Picture { size, pixels: values.chunks_exact(3).map(Vec3::from_slice).collect() }
}

#[test]
fn trained_captures_match_the_original() {
    let Some(data) = data() else { return };
    if !has_gpu() {
        return;
    }
    // The limits are 3 dB below the worst view; the pictures of standup are of half precision.
    for (checkpoint, golden, least) in [
        ("toybox/toybox_chkpnt.pth", "toybox/golden_vanilla", 105.0),
        ("toybox/toybox_4dgs1k.pth", "toybox/golden_4dgs1k", 97.0),
        ("toybox/toybox_45k.pth", "toybox/golden_45k", 101.0),
        ("standup/standup_chkpnt.pth", "standup/standup_golden", 90.0),
    ] {
        let out = folder();
        let cameras = data.join(format!("{golden}.json"));
        let scene = data.join(checkpoint);
        gs4d(&arguments!["render", &scene, "--raw", "--cameras", &cameras, "--out", out.path()]).text();
        let views: Value =
            serde_json::from_slice(&fs::read(&cameras).expect("the camera file exists")).expect("cameras are JSON");
        let truth = npz::pictures(&data.join(format!("{golden}.npz")), "images");
        let views = views["views"].as_array().expect("a list of views");
        assert_eq!(views.len(), truth.len(), "{golden}: a picture for each view");
        for (view, truth) in views.iter().zip(&truth) {
            let name = Path::new(view["file"].as_str().expect("a file")).file_stem().expect("a stem");
            let drawn = raw_picture(&out.path().join(name).with_extension("f32"), truth.size);
            let psnr = SquaredError::of(&drawn, truth).expect("one size").psnr();
            let apart = drawn.pixels.iter().zip(&truth.pixels).map(|(a, b)| (*a - *b).abs().max_element());
            let worst = apart.clone().fold(0.0, f32::max);
            let beyond = apart.filter(|apart| *apart > 1e-3).count();
            let found = format!("{checkpoint} {}: {psnr:.2} dB, worst {worst:.1e}, {beyond} pixels", name.display());
            println!("{found}");
            assert!(psnr >= least, "{found}: {least} dB at least");
            // In some pixels an alpha is within rounding of 1/255, and is blended by one of the two only.
            assert!(worst <= 1e-2 && beyond <= 16, "{found} beyond 1e-3");
        }
    }
}
