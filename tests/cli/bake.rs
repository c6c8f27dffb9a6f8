//! `gs4d bake`, run as a user runs it, on pictures of the scene itself.
//!
//! In: a small synthetic scene and a dataset drawn from it by the CPU reference. Out: proof that the package is smaller
//! and both reports are written, that finished stages are not repeated, and that data of another capture and paths that
//! cannot be written are refused; that a package has at most the requested size or is not written, and that an
//! impossible size is refused before scoring.

use crate::support::capture::Capture;
use crate::support::command::{Run, arguments, gs4d, has_gpu};
use crate::support::folders;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Environment, GaussianScene};
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Returns a scene and a dataset around `center`, which belongs to the scene if it is the origin.
fn capture(center: Vec3, images: bool) -> Capture {
    capture_of(synthesize(&SynthSettings { count: 2000, ..SynthSettings::default() }), center, images)
}

/// Returns a dataset as [`capture`] does, with this scene.
fn capture_of(trained: GaussianScene, center: Vec3, images: bool) -> Capture {
    Capture::new(trained, center, 4, 4, UVec2::splat(48), images)
}

impl Capture {
    fn out(&self) -> PathBuf {
        self.path("out.gs4d")
    }

    /// Bakes on the CPU, without training, to a package of at most `bytes`.
    fn bake_to_size(&self, bytes: f64, more: &[&str]) -> Run {
        let size = (bytes / 1e6).to_string();
        let fixed = arguments!["bake", &self.scene, "--data", &self.data, "-o", self.out(), "--target-size", size];
        let plain = ["--variant", "energy", "--engine", "cpu"].into_iter().chain(more.iter().copied());
        gs4d(&[fixed.to_vec(), plain.map(Into::into).collect()].concat())
    }

    /// Returns the bytes of a package without Gaussians, which the error of a bake to 100 bytes names.
    fn bytes_of_none(&self) -> u64 {
        let refused = self.bake_to_size(100.0, &[]);
        refused.must_fail("without Gaussians has ");
        number_after(&refused.err, "without Gaussians has ")
    }

    /// Returns the bytes of a package of the Gaussian with the highest score, which the error of a bake names if only
    /// an empty package fits.
    fn bytes_of_one(&self) -> u64 {
        let refused = self.bake_to_size(self.bytes_of_none() as f64 + 0.5, &[]);
        refused.must_fail("a single Gaussian has ");
        number_after(&refused.err, "a single Gaussian has ")
    }

    /// Returns the names in the folder.
    pub fn left(&self) -> Vec<String> {
        folders::names(self.folder.path())
    }
}

/// Returns the number after these words.
fn number_after(text: &str, words: &str) -> u64 {
    let rest = text.split_once(words).map_or("", |(_, rest)| rest);
    let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap_or_else(|error| panic!("a number after {words:?}: {error}: {text}"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn a_bake_writes_a_smaller_package_and_both_reports() {
    let capture = capture(Vec3::ZERO, true);
    let out = capture.out();
    let json =
        gs4d(&arguments!["bake", &capture.scene, "--data", &capture.data, "--ratio", "0.4", "-o", &out, "--json"])
            .json();
    assert_eq!(json["gaussians"]["after"], 1200, "60 % of 2000");
    let bytes = |path: &Path| fs::metadata(path).expect("the file exists").len();
    assert!(bytes(&out) < bytes(&capture.scene), "the package is smaller than the scene");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!((&info["gaussians"], &info["package"]["intact"]), (&1200.into(), &true.into()), "an intact package");

    let report: Value = serde_json::from_str(&read(&capture.path("out.report.json"))).expect("JSON");
    assert_eq!(report, json, "the printed report equals the written report");
    for name in ["sections", "trials", "stages", "times", "choices", "filter_share"] {
        assert!(report[name].as_array().is_some_and(|list| !list.is_empty()), "{name} in {report}");
    }
    assert_eq!(report["variances"]["borders"].as_array().map(Vec::len), Some(41), "a histogram");
    assert_eq!(report["activity"]["after"]["overlap"][0], 1.0, "the overlap of the first set with itself");
    assert_eq!(report["bytes"]["after"], bytes(&out), "the size of the package");
    assert!(report["warnings"].as_array().is_some_and(Vec::is_empty), "nothing to warn of: {}", report["warnings"]);
    let psnr = |side: &str| report["evaluation"][side]["mean"]["psnr"].as_f64().expect("a number");
    assert!(
        psnr("before") > 60.0 && psnr("after") > 35.0,
        "the dataset has the pictures of the scene: {}",
        report["evaluation"]
    );

    let html = read(&capture.path("out.report.html"));
    for title in [
        "Size by section",
        "Temporal variance",
        "Active ratio over time",
        "IoU of active sets over time",
        "PSNR against prune ratio",
        "Views",
    ] {
        assert!(html.contains(title), "the page has {title}");
    }
    assert!(html.matches("<svg").count() >= 5 && html.contains("data:image/png;base64,"), "plots and pictures");
    assert!(!html.contains("://") && !html.contains("src=\"/"), "the page loads no other file");
    assert_eq!(
        capture.left(),
        ["data", "out.gs4d", "out.report.html", "out.report.json", "scene.gs4d"],
        "no other files"
    );
}

#[test]
fn a_package_that_looks_different_over_white_is_noted() {
    let capture = capture(Vec3::ZERO, true);
    // The images cover only bright pixels: the rest of the scene is fog, which is invisible over black.
    for split in ["train", "test"] {
        for name in folders::names(&capture.data.join(split)) {
            let path = capture.data.join(split).join(name);
            let mut image = image::open(&path).expect("a picture").into_rgba8();
            image
                .pixels_mut()
                .filter(|pixel| pixel.0[..3].iter().all(|&value| value < 100))
                .for_each(|pixel| pixel.0 = [0; 4]);
            image.save(&path).expect("the folder can be written to");
        }
    }
    let out = capture.out();
    let arguments = arguments!["bake", &capture.scene, "--data", &capture.data, "--ratio", "0.2", "-o", &out, "--json"];
    let run = gs4d(&[arguments.to_vec(), arguments!["--no-fine-tune", "--engine", "cpu"].to_vec()].concat());
    let note =
        run.err.lines().find(|line| line.contains("note: the PSNR of the package is")).unwrap_or_default().to_owned();
    assert!(
        note.contains("dB over black and") && note.contains("dB over white"),
        "the note has both values: {}",
        run.err
    );
    let report = run.json();
    for side in ["before", "after"] {
        let evaluation = &report["evaluation"][side];
        let psnr = |figures: &Value| figures["psnr_pooled"].as_f64().expect("a number");
        let (black, white) = (psnr(&evaluation["mean"]), psnr(&evaluation["contrast"]));
        assert!(black > white + 3.0, "fog is visible over white: {black} and {white} dB of {side}");
    }
    let html = read(&capture.path("out.report.html"));
    assert!(html.contains("PSNR over white, dB") && html.contains("it is black"), "the page has both values");
}

/// Changes one image of a capture.
fn change_image(capture: &Capture, name: &str) {
    let path = capture.data.join("train").join(name);
    let mut image = image::open(&path).expect("a picture").into_rgba8();
    let pixel = image.get_pixel_mut(3, 4);
    pixel.0[0] = pixel.0[0].wrapping_add(90);
    image.save(&path).expect("the folder can be written to");
}

#[test]
fn a_changed_image_reruns_the_stages_that_depend_on_it() {
    let capture = capture(Vec3::ZERO, true);
    let (out, on_gpu) = (capture.out(), has_gpu());
    let engine = if on_gpu { "gpu" } else { "cpu" };
    let bake = || {
        let fixed = arguments!["bake", &capture.scene, "--data", &capture.data, "-o", &out, "--keep-work"];
        let more = arguments!["--ratio", "0.5", "--engine", engine];
        let trained = if on_gpu { arguments!["--steps", "4", "--rounds", "2"].to_vec() } else { Vec::new() };
        let run = gs4d(&[fixed.to_vec(), more.to_vec(), trained].concat());
        assert_eq!(run.code, Some(0), "the command succeeds: {}", run.err);
        let reran = |stage: &&str| {
            let line = run.err.lines().find(|line| line.starts_with(&format!("{stage}: ")));
            line.is_some_and(|line| !line.contains("skipped"))
        };
        ["score", "prune", "rounds", "fine-tune", "mask", "compress"].into_iter().filter(reran).collect::<Vec<_>>()
    };
    let trained = ["rounds", "fine-tune", "mask", "compress"];
    let with = |stages: &[&'static str]| if on_gpu { [stages, &trained].concat() } else { stages.to_vec() };
    let first = bake();
    assert!(first.starts_with(&["score", "prune"]), "every stage runs at first: {first:?}");
    assert_eq!(bake(), [""; 0], "no stage runs again without a change");
    // Camera 2 of 4 is held out.
    change_image(&capture, "c00_01.png");
    assert_eq!(bake(), with(&[]), "an image to train on changes the stages of training");
    change_image(&capture, "c02_01.png");
    let reran = bake();
    assert_eq!(reran.first(), Some(&"prune"), "an image to validate on changes the choice: {reran:?}");
    assert!(!reran.contains(&"score"), "scores come from cameras and times alone: {reran:?}");
    assert_eq!(bake(), [""; 0], "no stage runs again without a further change");
    let cameras = capture.data.join("transforms_train.json");
    let text = read(&cameras);
    let moved = text.replacen("\"time\":0.0", "\"time\":0.01", 1);
    assert_ne!(text, moved, "a time is changed");
    fs::write(&cameras, moved).expect("the folder can be written to");
    assert_eq!(bake().first(), Some(&"score"), "a changed time reruns the scores");
}

#[test]
fn finished_stages_are_skipped() {
    let capture = capture(Vec3::ZERO, true);
    let out = capture.out();
    let bake = |more: &[&str]| {
        let fixed = arguments!["bake", &capture.scene, "--data", &capture.data, "-o", &out, "--keep-work"];
        let run = gs4d(&[fixed.to_vec(), more.iter().map(Into::into).collect()].concat());
        assert_eq!(run.code, Some(0), "the command succeeds: {}", run.err);
        run.err
    };
    let skipped = |log: &str, stage: &str| log.contains(&format!("{stage}: skipped"));
    let first = bake(&["--ratio", "0.5"]);
    assert!(!first.contains("skipped"), "the first run skips no stage: {first}");
    let package = fs::read(&out).expect("the package exists");
    let again = bake(&["--ratio", "0.5"]);
    for stage in ["score", "prune", "mask", "compress"] {
        assert!(skipped(&again, stage), "{stage}: {again}");
    }
    assert_eq!(fs::read(&out).expect("the package still exists"), package, "the same package");
    let other = bake(&["--ratio", "0.3"]);
    assert!(skipped(&other, "score") && !skipped(&other, "prune") && !skipped(&other, "compress"), "{other}");
    fs::remove_file(&out).expect("the package exists");
    let lost = bake(&["--ratio", "0.3"]);
    assert!(skipped(&lost, "prune") && skipped(&lost, "compress"), "a lost package is written from its stage: {lost}");
    assert!(out.is_file(), "the package is written again");
}

#[test]
fn a_bake_whose_chunk_files_cannot_be_written_resumes() {
    let scene = synthesize(&SynthSettings { count: 600, duration_seconds: 4.0, ..SynthSettings::default() });
    let capture = capture_of(scene, Vec3::ZERO, true);
    let out = capture.out();
    let fixed = arguments!["bake", &capture.scene, "--data", &capture.data, "-o", &out, "--engine", "cpu", "--stream"];
    let bake = || gs4d(&[fixed.to_vec(), arguments!["--ratio", "0.5"].to_vec()].concat());
    bake().text();
    let (stream, work) = (capture.path("out.stream"), capture.path("out.gs4d.bake"));
    assert!(!work.exists(), "a bake that has written everything removes its results");
    let chunk = stream.join(folders::names(&stream).into_iter().find(|name| name.starts_with("chunk-")).expect("one"));
    let bytes = fs::read(&chunk).expect("the chunk file exists");
    fs::remove_file(&chunk).expect("the chunk file exists");
    fs::create_dir(&chunk).expect("the folder can be written to");
    bake().must_fail("chunk-00001-of-");
    assert!(work.is_dir(), "the results of the stages stay");
    fs::remove_dir(&chunk).expect("the folder is empty");
    let again = bake();
    assert_eq!(again.code, Some(0), "the command succeeds: {}", again.err);
    for stage in ["score", "prune", "mask", "compress"] {
        assert!(again.err.contains(&format!("{stage}: skipped")), "{stage}: {}", again.err);
    }
    assert_eq!(fs::read(&chunk).ok(), Some(bytes), "the same chunk file");
    assert!(stream.join("index.gs4d").is_file() && !work.exists(), "all is written, and the results are removed");
}

#[test]
fn the_allowed_loss_determines_the_number_of_gaussians() {
    let capture = capture(Vec3::ZERO, true);
    let bake = |loss: &str| {
        let fixed = arguments![
            "bake",
            &capture.scene,
            "--data",
            &capture.data,
            "-o",
            capture.out(),
            "--max-loss",
            loss,
            "--json"
        ];
        gs4d(&fixed).json()["gaussians"]["after"].as_u64().expect("a count")
    };
    let (careful, careless) = (bake("0.5"), bake("20"));
    assert!(careless < careful && careful <= 2000, "more loss, fewer Gaussians: {careless} and {careful}");
}

#[test]
fn data_of_another_capture_and_bad_outputs_are_refused() {
    let elsewhere = capture(Vec3::splat(1000.0), true);
    let out = elsewhere.out();
    let bake = arguments!["bake", &elsewhere.scene, "--data", &elsewhere.data, "--ratio", "0.5", "-o", &out];
    gs4d(&bake).must_fail("do not show this capture");
    gs4d(&[&bake[..], &["--trust-images".into()]].concat()).must_fail("no Gaussian contributes");
    assert!(!out.exists(), "no output is written");

    let capture = capture(Vec3::ZERO, false);
    let inside_a_file = capture.scene.join("out.gs4d");
    gs4d(&arguments!["bake", &capture.scene, "--data", &capture.data, "--ratio", "0.5", "-o", &inside_a_file])
        .must_fail("out.gs4d");
    gs4d(&arguments!["bake", &capture.scene, "--data", &capture.data, "--ratio", "0.5", "-o", &capture.scene])
        .must_fail("scene.gs4d");
    gs4d(&arguments!["bake", &capture.scene, "--data", &capture.data, "--max-loss", "1", "-o", capture.out()])
        .must_fail("--ratio");
    let report = gs4d(&arguments![
        "bake",
        &capture.scene,
        "--data",
        &capture.data,
        "--ratio",
        "0.5",
        "-o",
        capture.out(),
        "--json",
    ])
    .json();
    assert!(
        report["evaluation"].is_null() && report["gaussians"]["after"] == 1000,
        "a bake without images has no evaluation: {report}"
    );
}

#[test]
fn the_target_size_determines_the_number_of_gaussians() {
    let capture = capture(Vec3::ZERO, true);
    let out = capture.out();
    let fixed = arguments!["bake", &capture.scene, "--data", &capture.data, "-o", &out, "--variant", "energy"];
    let bake = |size: &str| gs4d(&[fixed.to_vec(), arguments!["--target-size", size, "--json"].to_vec()].concat());
    let json = bake("0.05").json();
    let (bytes, kept) = (json["bytes"]["after"].as_u64(), json["gaussians"]["after"].as_u64());
    assert!(bytes.is_some_and(|bytes| (40_000..=50_000).contains(&bytes)), "between 40 and 50 kB: {bytes:?}");
    assert!(kept.is_some_and(|kept| (100..1990).contains(&kept)), "fewer Gaussians: {kept:?}");
    let all = bake("5").json();
    assert_eq!(all["gaussians"]["after"], 2000, "every Gaussian fits into 5 MB");
    let before = fs::read(&out).expect("the package exists");
    bake("0.0001").must_fail("does not fit");
    assert_eq!(fs::read(&out).expect("the package still exists"), before, "the package is not replaced");
}

#[test]
fn a_package_that_stays_too_large_is_kept_in_the_work_folder() {
    let capture = capture(Vec3::ZERO, true);
    let out = capture.out();
    let one = capture.bytes_of_one();
    fs::write(&out, b"the old package").expect("the folder can be written to");
    // The count is found with the support filter; the name of the key-frame filter is longer, so that not even one
    // Gaussian fits.
    let run = capture.bake_to_size(one as f64 + 0.5, &["--filter", "key-frame"]);
    run.must_fail("does not fit");
    run.must_fail("not even with a single Gaussian");
    run.must_fail("choose a lower quality or a larger size");
    assert_eq!(read(&out), "the old package", "the old package is unchanged");
    let kept = capture.path("out.gs4d.bake/too-large.gs4d");
    run.must_fail(&kept.display().to_string());
    let bytes = fs::metadata(&kept).expect("the package is kept").len();
    assert!(bytes > one, "{bytes} bytes are more than {one}");
    assert_eq!(number_after(&run.err, "package that was made has "), bytes, "its size is named: {}", run.err);
    let info = gs4d(&arguments!["info", &kept, "--json"]).json();
    assert_eq!((&info["gaussians"], &info["package"]["intact"]), (&1.into(), &true.into()), "an intact package");
    assert_eq!(capture.left(), ["data", "out.gs4d", "out.gs4d.bake", "scene.gs4d"], "no report is written");
    capture.bake_to_size(5e6, &[]).text();
    assert_eq!(
        capture.left(),
        ["data", "out.gs4d", "out.gs4d.bake", "out.report.html", "out.report.json", "scene.gs4d"],
        "a later bake does not remove the kept package"
    );
}

/// Returns a capture with an environment map that does not compress well.
fn surrounded() -> Capture {
    let mut trained = synthesize(&SynthSettings { count: 2000, degree: 0, ..SynthSettings::default() });
    let (width, height) = (128, 64);
    let texel = |at: u32| (at.wrapping_mul(0x9E37_79B9) >> 8) as f32 / (1u32 << 24) as f32;
    let texels = (0..3 * width * height).map(texel).collect();
    trained.environment = Some(Environment { width, height, texels });
    capture_of(trained, Vec3::ZERO, true)
}

#[test]
fn a_size_below_that_of_an_empty_package_is_refused_before_scoring() {
    let capture = surrounded();
    let none = capture.bytes_of_none();
    assert!(none > 20_000, "the size includes the environment map: {none}");
    let refused = capture.bake_to_size(none as f64 - 0.5, &[]);
    refused.must_fail(&format!("does not fit into {} bytes: a package without Gaussians has {none};", none - 1));
    assert!(!refused.err.contains("score:"), "no view is scored: {}", refused.err);
    assert_eq!(capture.left(), ["data", "scene.gs4d"], "no file is left");
    let one = capture.bytes_of_one();
    assert!((none..none + 5000).contains(&one), "a Gaussian needs little more: {one} after {none}");
}

#[test]
fn parts_shared_by_all_gaussians_count_once_for_the_target_size() {
    let capture = surrounded();
    let one = capture.bytes_of_one();
    assert!(one > 20_000, "most bytes belong to the environment map: {one}");
    let limit = one + 10_000;
    let run = capture.bake_to_size(limit as f64 + 0.5, &["--json"]);
    assert!(!run.err.contains("again with"), "the count is found in one attempt: {}", run.err);
    let json = run.json();
    let (bytes, kept) = (json["bytes"]["after"].as_u64(), json["gaussians"]["after"].as_u64());
    assert!(bytes.is_some_and(|bytes| (one..=limit).contains(&bytes)), "within the target size: {bytes:?} of {limit}");
    assert!(kept.is_some_and(|kept| (100..1500).contains(&kept)), "between 100 and 1500 Gaussians fit: {kept:?}");
}

#[test]
fn inputs_that_a_later_stage_would_refuse_are_refused_before_training() {
    if !has_gpu() {
        return;
    }
    let scene = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
    // Too few cameras and times to hold some out unasked.
    let few = Capture::new(scene.clone(), Vec3::ZERO, 3, 2, UVec2::splat(32), true);
    let many = Capture::new(scene, Vec3::ZERO, 4, 4, UVec2::splat(32), true);
    let bake = |capture: &Capture, more: &[&str]| {
        let fixed = arguments!["bake", &capture.data, "-o", capture.out(), "--engine", "gpu"];
        gs4d(&[fixed.to_vec(), more.iter().map(Into::into).collect()].concat())
    };
    let start = Instant::now();
    bake(&few, &[]).must_fail("the loss allowed needs validation views");
    bake(&few, &[]).must_fail("give --validation cameras or times");
    bake(&few, &["--ratio", "0.5", "--variant", "auto"]).must_fail("the best score needs validation views");
    let plan = few.path("plan.json").display().to_string();
    bake(&few, &["--plan", &plan]).must_fail("the loss allowed needs validation views");
    bake(&many, &["--validation", "none"]).must_fail("the loss allowed needs validation views");
    bake(&many, &["--target-size", "0.0001"]).must_fail("a package without Gaussians has");
    // Camera 2 of 4 is held out.
    let image = many.data.join("train/c02_01.png");
    fs::remove_file(&image).expect("the image exists");
    bake(&many, &[]).must_fail("c02_01.png");
    assert!(start.elapsed() < Duration::from_secs(60), "nothing was trained: {:?}", start.elapsed());
    for capture in [&few, &many] {
        assert_eq!(capture.left(), ["data", "scene.gs4d"], "no file of a training is left");
    }
}

#[test]
fn invalid_sizes_and_rounds_are_refused() {
    let bake = |option: String| gs4d(&arguments!["bake", "scene.gs4d", "--data", "data", "-o", "out.gs4d", option]);
    for size in ["0", "-1", "nan", "inf", "1e-60", "small"] {
        bake(format!("--target-size={size}")).must_fail("--target-size");
    }
    bake("--rounds=0".to_owned()).must_fail("--rounds");
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn with_training_scores_are_compared_after_training_and_pruning_may_take_rounds() {
    if !has_gpu() {
        return;
    }
    let capture = capture(Vec3::ZERO, true);
    let out = capture.out();
    let bake = |goal: [&str; 2], rounds: &str| {
        let fixed = arguments!["bake", &capture.scene, "--data", &capture.data, "-o", &out, "--engine", "gpu"];
        let more = arguments!["--variant", "auto", "--steps", "30", "--rounds", rounds, goal[0], goal[1], "--json"];
        gs4d(&[fixed.to_vec(), more.to_vec()].concat()).json()
    };
    let trained = |report: &Value| {
        let trials = report["trials"].as_array().expect("a list").clone();
        trials.into_iter().filter(|trial| trial["variant"].as_str().is_some_and(|v| v.ends_with(", 6 steps"))).collect()
    };
    let gradual = bake(["--ratio", "0.75"], "2");
    let tried: Vec<Value> = trained(&gradual);
    assert!(tried.len() >= 2 && tried.iter().all(|trial| trial["kept"] == 500), "every score is tried: {tried:?}");
    let best = |a: &&Value, b: &&Value| a["psnr"].as_f64().partial_cmp(&b["psnr"].as_f64()).expect("numbers");
    let winner = tried.iter().max_by(best).expect("at least one trial")["variant"].clone();
    let score = gradual["choices"].as_array().and_then(|all| all.iter().find(|pair| pair[0] == "score")).expect("one");
    assert_eq!(
        winner,
        format!("{}, 6 steps", score[1].as_str().expect("a name")),
        "the score with the highest PSNR after training is chosen"
    );
    let stages = gradual["stages"].as_array().expect("a list");
    assert!(stages.iter().any(|stage| stage["name"] == "rounds"), "pruning in two rounds: {stages:?}");
    let loss = bake(["--max-loss", "8"], "1");
    assert!(trained(&loss).len() > 4, "counts are tried after training: {}", loss["trials"]);
    assert!(
        loss["stages"].as_array().expect("a list").iter().all(|stage| stage["name"] != "rounds"),
        "no rounds by default"
    );
}
