//! `gs4d eval` and `gs4d ablate`, run as a user runs them, on pictures of the scene itself.
//!
//! In: a small synthetic scene and a dataset drawn from it by the CPU reference. Out: proof that the scene matches its
//! own pictures, that figures over any background equal an independent composite, that identical views are counted,
//! that missing data is named, and that the tables have the documented rows and columns.

use crate::support::capture::Capture;
use crate::support::command::{arguments, gs4d};
use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions, TrainingView};
use bevy_gs4d::reference;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Environment, RuntimeScene};
use bevy_gs4d::view::{Background, RasterFov};
use glam::{Mat4, UVec2, Vec3};
use image::{GrayImage, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

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
    assert!((0.0..0.01).contains(&mean("flip")), "a FLIP below 0.01: {}", json["mean"]);
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

/// Returns the color of a pixel of the composite test, 0 to 1, and its alpha as a byte: full, partial and none.
fn texel(view: usize, x: u32, y: u32) -> (Vec3, u8) {
    let alpha = [255, 255, 180, 64, 0, 0][((x + view as u32) / 8) as usize % 6];
    let value = |step: u32| ((x * step + y * (step + 4) + 9 * view as u32) % 256) as f32 / 255.0;
    (Vec3::new(value(3), value(5), value(7)), alpha)
}

/// Returns the mean over views of the mean PSNR of the channels, from an independent composite in double precision.
fn independent_psnr(scene: &RuntimeScene, cameras: &Path, background: [f32; 3]) -> f64 {
    let views = CameraFile::load(cameras, &CameraOptions::default()).expect("a valid camera file");
    let of_view = |(index, view): (usize, &TrainingView)| {
        let size = view.camera.size;
        let drawn = view.camera.view(view.time, RasterFov::Reference);
        let drawn = reference::render(scene, &drawn, Background::Color(background)).picture;
        let mut squares = [0.0; 3];
        for (y, x) in (0..size.y).flat_map(|y| (0..size.x).map(move |x| (y, x))) {
            let (color, alpha) = texel(index, x, y);
            let alpha = f64::from(alpha) / 255.0;
            for channel in 0..3 {
                let truth = f64::from(color[channel]) * alpha + (1.0 - alpha) * f64::from(background[channel]);
                let found = f64::from(drawn.pixel(x, y)[channel]).clamp(0.0, 1.0);
                squares[channel] += (truth - found).powi(2);
            }
        }
        let pixels = f64::from(size.x * size.y);
        squares.iter().map(|square| -10.0 * (square / pixels).log10()).sum::<f64>() / 3.0
    };
    views.iter().enumerate().map(of_view).sum::<f64>() / views.len() as f64
}

#[test]
fn figures_over_any_background_equal_an_independent_composite() {
    let size = UVec2::new(48, 40);
    let Capture { folder: _folder, scene, data } = capture(size);
    let trained = synthesize(&SynthSettings { count: 1500, ..SynthSettings::default() });
    let runtime = trained.into_runtime().expect("a synthetic scene can be drawn");
    let cameras = data.join("transforms_test.json");
    let views = CameraFile::load(&cameras, &CameraOptions::default()).expect("a valid camera file");
    for masks in [false, true] {
        let mut file: Value = serde_json::from_slice(&fs::read(&cameras).expect("cameras")).expect("JSON");
        for (index, view) in views.iter().enumerate() {
            let byte = |value: f32| (value * 255.0).round() as u8;
            if masks {
                let premultiplied = RgbImage::from_fn(size.x, size.y, |x, y| {
                    let (color, alpha) = texel(index, x, y);
                    Rgb((color * f32::from(alpha) / 255.0).to_array().map(byte))
                });
                premultiplied.save(&view.image).expect("the folder can be written to");
                let mask = GrayImage::from_fn(size.x, size.y, |x, y| Luma([texel(index, x, y).1]));
                mask.save(data.join(format!("mask_{index}.png"))).expect("the folder can be written to");
                file["frames"][index]["mask_path"] = json!(format!("mask_{index}.png"));
            } else {
                let image = RgbaImage::from_fn(size.x, size.y, |x, y| {
                    let (color, alpha) = texel(index, x, y);
                    let [red, green, blue] = color.to_array().map(byte);
                    Rgba([red, green, blue, alpha])
                });
                image.save(&view.image).expect("the folder can be written to");
            }
        }
        fs::write(&cameras, file.to_string()).expect("the folder can be written to");
        let cases = [([0.0; 3], [1.0; 3]), ([1.0; 3], [0.0; 3]), ([0.2, 0.4, 0.6], [1.0; 3])];
        for (background, other) in cases {
            let option = background.map(|value: f32| value.to_string()).join(",");
            let arguments = arguments![
                "eval",
                &scene,
                "--data",
                &data,
                "--background",
                &option,
                "--metrics",
                "psnr",
                "--engine",
                "cpu"
            ];
            let json = gs4d(&[arguments.to_vec(), arguments!["--json"].to_vec()].concat()).json();
            assert_eq!(json["contrast"]["background"], json!(other), "the contrasting background of {background:?}");
            for (found, background) in [(&json["mean"], background), (&json["contrast"], other)] {
                let found = found["psnr"].as_f64().expect("a number");
                let expected = independent_psnr(&runtime, &cameras, background);
                assert!((found - expected).abs() < 0.05, "masks {masks}, {background:?}: {found} and {expected} dB");
            }
            let text = gs4d(&arguments).text();
            let name = if other == [1.0; 3] { "white" } else { "black" };
            let line = text.lines().find(|line| line.starts_with("contrast")).unwrap_or_default();
            assert!(
                line.contains("PSNR") && line.ends_with(&format!("over {name}")),
                "a line has the PSNR and the background: {text}"
            );
        }
    }
}

#[test]
fn identical_views_are_counted_and_left_out_of_the_mean() {
    let size = UVec2::splat(32);
    let Capture { folder: _folder, scene, data } = capture(size);
    let measure =
        || gs4d(&arguments!["eval", &scene, "--data", &data, "--metrics", "psnr", "--engine", "cpu", "--json"]);
    let before = measure().json();
    assert_eq!((&before["mean"]["identical"], &before["contrast"]), (&0.into(), &Value::Null), "opaque images");
    // A camera far outside, at which the scene is not visible, with a black image.
    let cameras = data.join("transforms_test.json");
    let mut file: Value = serde_json::from_slice(&fs::read(&cameras).expect("cameras")).expect("JSON");
    let mut frame = file["frames"][0].clone();
    frame["file_path"] = json!("./test/black");
    for row in 0..3 {
        frame["transform_matrix"][row][3] = json!(1000.0 * (row + 1) as f32);
    }
    RgbImage::new(size.x, size.y).save(data.join("test/black.png")).expect("the folder can be written to");
    file["frames"].as_array_mut().expect("a list").push(frame);
    fs::write(&cameras, file.to_string()).expect("the folder can be written to");
    let after = measure().json();
    let view = &after["views"][6];
    assert_eq!((&view["identical"], &view["psnr"]), (&true.into(), &200.0.into()), "the black view");
    assert_eq!(after["mean"]["identical"], 1, "one of seven");
    let psnr = |json: &Value, name: &str| json["mean"][name].as_f64().expect("a number");
    assert!((psnr(&after, "psnr") - psnr(&before, "psnr")).abs() < 1e-9, "the mean of the other six");
    let more = 10.0 * (7.0f64 / 6.0).log10();
    let pooled = psnr(&after, "psnr_pooled") - psnr(&before, "psnr_pooled");
    assert!((pooled - more).abs() < 1e-6, "all pixels are pooled: {pooled}");
    let text = gs4d(&arguments!["eval", &scene, "--data", &data, "--metrics", "psnr", "--engine", "cpu"]).text();
    assert!(
        text.contains("1 of 7 views are identical and not part of the mean PSNR"),
        "the text counts identical views: {text}"
    );
    assert!(text.contains("the images have no gaps"), "the text has the reason for a single background: {text}");
}

#[test]
fn an_environment_map_has_no_contrasting_background() {
    let mut trained = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
    let texels = (0..3 * 8 * 4).map(|i| i as f32 / 95.0).collect();
    trained.environment = Some(Environment { width: 8, height: 4, texels });
    let Capture { folder: _folder, scene, data } = Capture::new(trained, Vec3::ZERO, 2, 2, UVec2::splat(32), true);
    let path = data.join("test/c00_00.png");
    let mut image = image::open(&path).expect("a picture").into_rgba8();
    image.put_pixel(3, 3, Rgba([0; 4]));
    image.save(&path).expect("the folder can be written to");
    let fixed = arguments!["eval", &scene, "--data", &data, "--metrics", "psnr", "--engine", "cpu"];
    let json = gs4d(&[fixed.to_vec(), arguments!["--json"].to_vec()].concat()).json();
    assert_eq!((&json["has_gaps"], &json["contrast"]), (&true.into(), &Value::Null), "no second background");
    let text = gs4d(&fixed).text();
    assert!(text.contains("over the environment map of the scene"), "a line has the reason: {text}");
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
        fs::write(data.join(format!("transforms_{split}.json")), cameras.to_string())
            .expect("the folder can be written to");
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
        "--validation",
        "cameras",
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
    assert!(psnr("vanilla") > 60.0, "the PSNR against pictures of the scene itself");
    assert_eq!(row("filter only, support, 5 key-frames")["psnr"], row("vanilla")["psnr"], "support changes no pixel");
    assert!(
        row("filter only, support, 5 key-frames")["active_share"].as_f64().is_some_and(|s| s < 1.0),
        "some Gaussians are inactive"
    );
    assert_eq!(row("prune 60% energy")["gaussians"], 600, "1500 less 60 percent");
    assert!(psnr("prune 20% energy") > psnr("prune 60% energy"), "fewer Gaussians have a lower PSNR");
    let lines = fs::read_to_string(&csv).expect("the table is there");
    assert_eq!(lines.lines().count(), rows.len() + 1, "heads and rows: {lines}");
    assert!(lines.starts_with("row,psnr,psnr_pooled,ssim,gaussians,active_share"), "columns: {lines}");
}
