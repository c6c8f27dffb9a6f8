//! `gs4d eval` and `gs4d ablate`, run as a user runs them on a scene's own pictures.
//!
//! In: a small synthetic scene and a dataset drawn from it by the CPU reference. Out: proof that the scene matches its
//! own pictures, that missing data is named, and that the tables have the documented rows and columns.

use crate::support::capture::Capture;
use crate::support::command::{arguments, gs4d};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{Mat4, UVec2, Vec3};
use serde_json::json;
use std::fs;

/// Returns a scene and its own pictures of that size.
fn capture(size: UVec2) -> Capture {
    let trained = synthesize(&SynthSettings { count: 1500, ..SynthSettings::default() });
    Capture::new(trained, Vec3::ZERO, 3, 3, size, true)
}

#[test]
fn a_scene_matches_its_own_pictures() {
    let Capture { folder, scene, data } = capture(UVec2::new(192, 176));
    let pictures = folder.path().join("pictures");
    let json = gs4d(&arguments!["eval", &scene, "--data", &data, "--out", &pictures, "--json"]).json();
    assert_eq!((&json["split"], json["views"].as_array().map(Vec::len)), (&"test".into(), Some(6)), "the test views");
    let mean = |name: &str| json["mean"][name].as_f64().unwrap_or_else(|| panic!("{name} in {json}"));
    assert!(mean("psnr") > 60.0 && mean("psnr_pooled") > 60.0, "only the rounding to 8 bits differs: {}", json["mean"]);
    assert!(mean("ssim") > 0.9995 && mean("ms_ssim") > 0.9995, "nearly 1: {}", json["mean"]);
    assert!((0.0..0.01).contains(&mean("flip")), "hardly any difference: {}", json["mean"]);
    let name = json["views"][0]["name"].as_str().expect("a name");
    let picture = image::open(pictures.join(format!("{name}.png"))).expect("a picture").into_rgb8();
    assert_eq!(picture.dimensions(), (3 * 192, 176), "reference, render and difference");

    let some = gs4d(&arguments![
        "eval",
        &scene,
        "--data",
        &data,
        "--split",
        "train",
        "--views",
        "4",
        "--metrics",
        "psnr",
        "--resolution",
        "2",
        "--json",
    ])
    .json();
    assert_eq!(some["views"].as_array().map(Vec::len), Some(4), "an even subset");
    assert!(
        some["mean"]["ssim"].is_null() && some["mean"]["psnr"].is_number(),
        "only the requested metrics: {}",
        some["mean"]
    );
    let text = gs4d(&arguments!["eval", &scene, "--data", &data, "--metrics", "psnr,ssim"]).text();
    assert!(text.contains("mean of 6") && text.contains("SSIM") && !text.contains("FLIP"), "a table: {text}");
}

#[test]
fn missing_data_is_named() {
    let Capture { folder, scene, data } = capture(UVec2::splat(32));
    gs4d(&arguments!["eval", &scene, "--data", folder.path().join("nowhere")]).must_fail("transforms_test.json");
    gs4d(&arguments!["eval", &scene, "--data", &data, "--split", "val"]).must_fail("transforms_val.json");
    gs4d(&arguments!["eval", &scene, "--data", &data, "--metrics", "lpips"]).must_fail("lpips");
    // A truncated JPEG with the extension of a PNG.
    let (cut, jpeg) = (data.join("test/c00_01.png"), folder.path().join("whole.jpg"));
    image::open(&cut).expect("a picture").into_rgb8().save(&jpeg).expect("the folder can be written to");
    let whole = fs::read(&jpeg).expect("a picture");
    fs::write(&cut, &whole[..whole.len() - 2]).expect("the folder can be written to");
    gs4d(&arguments!["eval", &scene, "--data", &data]).must_fail("c00_01.png");
    fs::remove_file(cut).expect("the picture exists");
    gs4d(&arguments!["eval", &scene, "--data", &data]).must_fail("c00_01.png");
    gs4d(&arguments!["eval", &scene]).must_fail("--data");
}

#[test]
fn errors_name_only_options_of_the_verb() {
    let Capture { folder, scene, .. } = capture(UVec2::splat(16));
    let data = folder.path().join("sizeless");
    fs::create_dir(&data).expect("the folder can be written to");
    let frame = json!({ "file_path": "nothing", "time": 0, "transform_matrix": Mat4::IDENTITY.to_cols_array_2d() });
    for split in ["train", "test"] {
        let cameras = json!({ "camera_angle_x": 0.7, "frames": [frame] });
        fs::write(data.join(format!("transforms_{split}.json")), cameras.to_string()).expect("it can be written to");
    }
    let eval = gs4d(&arguments!["eval", &scene, "--data", &data]);
    eval.must_fail("the picture size is unknown");
    assert!(!eval.err.contains("--size"), "eval has no such option: {}", eval.err);
    gs4d(&arguments!["score", &scene, "--data", &data, "--out", folder.path().join("out.f32")]).must_fail("--size");
}

#[test]
fn an_ablation_has_every_row() {
    let Capture { folder, scene, data } = capture(UVec2::splat(48));
    let csv = folder.path().join("table.csv");
    let json = gs4d(&arguments![
        "ablate",
        &scene,
        "--data",
        &data,
        "--ratios",
        "0.2,0.6",
        "--variants",
        "energy,full",
        "--filters",
        "support,key-frame",
        "--key-frames",
        "3,5",
        "--csv",
        &csv,
        "--json",
    ])
    .json();
    let rows = json["rows"].as_array().expect("a list of rows");
    assert_eq!(rows.len(), 1 + 2 * 2 + 2 * 2, "vanilla, filters by key-frames, variants by ratios: {json}");
    let row = |name: &str| rows.iter().find(|row| row["row"] == name).unwrap_or_else(|| panic!("{name} in {json}"));
    let psnr = |name: &str| row(name)["psnr"].as_f64().expect("a number");
    assert!(psnr("vanilla") > 60.0, "its own pictures");
    assert_eq!(row("filter only, support, 5 key-frames")["psnr"], row("vanilla")["psnr"], "support changes no pixel");
    assert!(
        row("filter only, support, 5 key-frames")["active_share"].as_f64().is_some_and(|s| s < 1.0),
        "some Gaussians are inactive"
    );
    assert_eq!(row("prune 60% energy")["gaussians"], 600, "1500 less 60 percent");
    assert!(psnr("prune 20% energy") > psnr("prune 60% energy"), "fewer Gaussians lower the PSNR");
    let lines = fs::read_to_string(&csv).expect("the table exists");
    assert_eq!(lines.lines().count(), rows.len() + 1, "a header and the rows: {lines}");
    assert!(lines.starts_with("row,psnr,psnr_pooled,ssim,gaussians,active_share"), "columns: {lines}");
}
