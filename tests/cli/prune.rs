//! `gs4d score`, `prune` and `mask`, run as a user runs them.
//!
//! In: a synthetic scene with training views of it. Out: proof that the files and reports are right, and that unusable
//! data is refused.

use crate::support::command::{Run, arguments, gs4d};
use bevy_gs4d::reference;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::{Background, Camera, RasterFov};
use glam::{UVec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

const COUNT: usize = 400;
const VIEWS: usize = 12;
const SIZE: UVec2 = UVec2::new(60, 44);
const ANGLE: f32 = 0.8;

/// A folder with a scene, `scene.gs4d`, and its training data.
struct Bench {
    folder: TempDir,
}

impl Bench {
    /// Writes the scene and its data. `images`: whether the training images exist; `astray`: whether the cameras look
    /// away from the scene.
    fn new(images: bool, astray: bool) -> Self {
        let bench = Self { folder: tempfile::tempdir().expect("a temporary folder") };
        gs4d(&arguments!["synth", bench.path("scene.gs4d"), "--count", COUNT.to_string(), "--seed", "5", "--json"])
            .json();
        let target = if astray { Vec3::Z * 40.0 } else { Vec3::Z * 0.1 };
        let scene = synthesize(&SynthSettings { count: COUNT, seed: 5, ..SynthSettings::default() });
        let scene = scene.into_runtime().expect("a valid scene");
        let frames: Vec<Value> = (0..VIEWS)
            .map(|i| {
                let (angle, time) = (i as f32 * 2.0, i as f32 / (VIEWS - 1) as f32);
                let eye = Vec3::new(2.4 * angle.cos(), 2.4 * angle.sin(), 1.2);
                let camera = Camera::look_at(eye, target, Vec3::Z, ANGLE, SIZE);
                if images {
                    let view = camera.view(time, RasterFov::Reference);
                    let picture = reference::render(&scene, &view, Background::Color([0.0; 3])).picture;
                    picture.to_rgb8().save(bench.path(&format!("r_{i:02}.png"))).expect("a picture");
                }
                let flip = glam::Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
                let pose = (camera.world_to_camera.inverse() * flip).transpose().to_cols_array_2d();
                json!({ "file_path": format!("r_{i:02}"), "time": time, "transform_matrix": pose })
            })
            .collect();
        let json = json!({ "camera_angle_x": ANGLE, "w": SIZE.x, "h": SIZE.y, "frames": frames });
        fs::write(bench.path("transforms_train.json"), json.to_string()).expect("the folder can be written to");
        bench
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().expect("temporary folders have plain names").to_owned()
    }

    /// Runs `gs4d VERB scene.gs4d --data FOLDER ...` on the CPU.
    fn run(&self, verb: &str, more: &[&str]) -> Run {
        let (scene, data) = (self.path("scene.gs4d"), self.path(""));
        let fixed = arguments![verb, scene, "--data", data, "--engine", "cpu", "--json"].to_vec();
        gs4d(&[fixed, more.iter().map(Into::into).collect()].concat())
    }
}

fn floats(path: String) -> Vec<f32> {
    let bytes = fs::read(PathBuf::from(path)).expect("the file exists");
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

#[test]
fn every_score_is_written_by_one_run() {
    let bench = Bench::new(false, false);
    let out = bench.path("scores");
    let json = bench.run("score", &["--variant", "all", "--out", &out]).json();
    assert_eq!((&json["views"], &json["gaussians"]), (&VIEWS.into(), &COUNT.into()), "all views, all Gaussians");
    let files = json["files"].as_array().expect("files");
    assert_eq!(files.len(), 12, "every score");
    for file in files {
        let scores = floats(file.as_str().expect("a path").to_owned());
        assert_eq!(scores.len(), COUNT, "{file}: one for each Gaussian");
        assert!(scores.iter().all(|s| s.is_finite() && *s >= 0.0) && scores.iter().any(|s| *s > 0.0), "{file}");
    }
    let single = bench.path("energy.f32");
    bench.run("score", &["--variant", "energy", "--out", &single]).json();
    assert_eq!(
        floats(single),
        floats(bench.path("scores/energy.f32")),
        "the same scores if only one variant is written"
    );
    let few = bench.run("score", &["--variant", "full", "--views", "5", "--out", &bench.path("few.f32")]).json();
    assert_eq!(few["views"], 5, "the requested number of views");
    bench.run("score", &["--variant", "full", "--out", &out]).must_fail("is a folder");
}

#[test]
fn auto_keeps_the_best_of_the_scores_it_tries() {
    let bench = Bench::new(true, false);
    let json = bench.run("prune", &["--ratio", "0.4", "-o", &bench.path("pruned.gs4d")]).json();
    assert_eq!(json["gaussians"], 240, "six of ten");
    let rows = json["contest"]["candidates"].as_array().expect("candidates").clone();
    let psnr = |row: &Value| row["psnr"].as_f64().expect("a number");
    let best = rows.iter().map(psnr).fold(f64::NEG_INFINITY, f64::max);
    assert_eq!((rows.len(), psnr(&json)), (4, best), "the best of four: {rows:?}");
    let named = rows.iter().find(|row| row["score"] == json["score"]).expect("the score is one of them");
    assert_eq!(psnr(named), best, "and is named");
    assert_eq!(json["contest"]["views"], 1, "the views of one camera are held out");
    let info = gs4d(&arguments!["info", bench.path("pruned.gs4d"), "--json"]).json();
    assert_eq!((&info["gaussians"], &info["form"]), (&240.into(), &"trained".into()), "the written package");
}

#[test]
fn the_allowed_loss_determines_the_number_of_gaussians() {
    let bench = Bench::new(true, false);
    let prune = |loss: &str| {
        let out = bench.path("pruned.gs4d");
        bench.run("prune", &["--variant", "energy", "--max-loss", loss, "-o", &out]).json()
    };
    let (little, much) = (prune("0.5"), prune("25"));
    for (json, loss) in [(&little, 0.5), (&much, 25.0)] {
        let (before, after) = (&json["contest"]["psnr_before"], &json["psnr"]);
        let lost = before.as_f64().expect("dB") - after.as_f64().expect("dB");
        assert!(lost <= loss, "{lost} dB lost of {loss}");
    }
    let kept = |json: &Value| json["gaussians"].as_u64().expect("a count");
    assert!(kept(&much) < kept(&little), "{} and {}", kept(&much), kept(&little));
    let trials = much["contest"]["candidates"][0]["trials"].as_array().expect("trials").len();
    assert!(trials > 3, "every count that was tried is reported: {trials}");
}

#[test]
fn missing_images_are_an_error_only_if_they_are_needed() {
    let bench = Bench::new(false, false);
    let out = bench.path("pruned.gs4d");
    let auto = bench.run("prune", &["--ratio", "0.5", "-o", &out]);
    assert!(auto.err.contains("images are missing"), "missing images are reported: {}", auto.err);
    assert_eq!(auto.json()["contest"]["compared_with"], "against the whole scene", "compared with the whole scene");
    bench.run("prune", &["--max-loss", "0.1", "-o", &out]).must_fail("images are missing");
    gs4d(&arguments!["prune", bench.path("scene.gs4d"), "--ratio", "0.5", "-o", &out]).must_fail("--data");
}

#[test]
fn truncated_images_are_refused() {
    let bench = Bench::new(true, false);
    for view in 0..VIEWS {
        let (png, jpeg) = (bench.path(&format!("r_{view:02}.png")), bench.path("whole.jpg"));
        image::open(&png).expect("a picture").into_rgb8().save(&jpeg).expect("the folder can be written to");
        let whole = fs::read(&jpeg).expect("a picture");
        fs::write(&png, &whole[..whole.len() * 2 / 3]).expect("the folder can be written to");
    }
    let out = bench.path("pruned.gs4d");
    bench.run("prune", &["--ratio", "0.5", "-o", &out]).must_fail("r_");
    assert!(!PathBuf::from(out).exists(), "no output is written");
}

#[test]
fn a_score_file_must_have_a_finite_score_for_each_gaussian() {
    let bench = Bench::new(false, false);
    let (scores, out) = (bench.path("scores.f32"), bench.path("pruned.gs4d"));
    let mut values: Vec<f32> = (0..COUNT).map(|i| i as f32).collect();
    let write = |values: &[f32]| {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(&scores, bytes).expect("the folder can be written to");
    };
    let scene = bench.path("scene.gs4d");
    let prune = || gs4d(&arguments!["prune", &scene, "--scores", &scores, "--keep", "100", "-o", &out, "--json"]);
    write(&values);
    assert_eq!(prune().json()["gaussians"], 100, "no data is needed");
    values[7] = f32::NAN;
    write(&values);
    prune().must_fail("scores.f32");
    write(&values[1..]);
    prune().must_fail("another checkpoint");
}

#[test]
fn filters_report_their_active_fraction() {
    let bench = Bench::new(false, false);
    let active = |filter: &str| {
        let options = ["--filter", filter, "--key-frames", "5", "-o", &bench.path("filtered.gs4d")];
        let by_views = || bench.run("mask", &options);
        let scene = bench.path("scene.gs4d");
        let alone = || gs4d(&[&["mask", scene.as_str(), "--json"][..], &options].concat());
        let json = if filter == "support" { alone() } else { by_views() }.json();
        assert_eq!((&json["segments"], &json["filter"]), (&4.into(), &filter.into()), "the requested filter");
        assert_eq!(json["overlap"].as_array().map(Vec::len), Some(3), "between four segments");
        json["active_share"].as_f64().expect("a number")
    };
    let (key_frame, interval, support) = (active("key-frame"), active("interval"), active("support"));
    assert!(key_frame > 0.0 && key_frame <= interval && interval <= support, "{key_frame} {interval} {support}");
    assert!(support < 1.0, "some Gaussians are inactive");
    let (scene, data, out) = (bench.path("scene.gs4d"), bench.path(""), bench.path("filtered.gs4d"));
    let every = gs4d(&arguments!["mask", scene, "--data", data, "--every", "3", "-o", out, "--json"]).json();
    assert_eq!(every["key_frames"], 5, "twelve times, every third");
    let alone = arguments!["mask", bench.path("scene.gs4d"), "-o", bench.path("filtered.gs4d"), "--json"];
    assert_eq!(gs4d(&alone).json()["key_frames"], 11, "support needs no data");
}

#[test]
fn data_of_another_capture_is_refused() {
    let bench = Bench::new(false, true);
    let out = bench.path("out.gs4d");
    let belong = "does this data belong to the checkpoint?";
    bench.run("score", &["--variant", "energy", "--out", &bench.path("out.f32")]).must_fail(belong);
    bench.run("prune", &["--variant", "full", "--ratio", "0.5", "-o", &out]).must_fail(belong);
    bench.run("mask", &["--filter", "key-frame", "-o", &out]).must_fail(belong);
    assert!(!PathBuf::from(out).exists(), "no output is written");
}
