//! `gs4d finetune`, run as a user runs it, on pictures of the scene itself.
//!
//! In: a small synthetic scene, a dataset drawn from it, the scene pruned. Out: proof that training raises quality,
//! that the result can be compressed in the same run, that the report of a compressed or interrupted run has no value
//! that was not measured, and that wrong inputs are refused and leave no files. Skipped where there is no GPU.

use crate::support::capture::Capture;
use crate::support::command::{GS4D, Run, arguments, gs4d, has_gpu};
use crate::support::dataset;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;

struct Lesson {
    capture: Capture,
    /// The path of the pruned scene.
    pruned: PathBuf,
}

/// Returns a scene, the pruned scene and the pictures of the scene; `None` if there is no GPU.
fn lesson() -> Option<Lesson> {
    if !has_gpu() {
        return None;
    }
    let trained = synthesize(&SynthSettings { count: 1000, ..SynthSettings::default() });
    let capture = Capture::new(trained, Vec3::ZERO, 4, 4, UVec2::splat(48), true);
    let (scene, data, pruned) = (&capture.scene, &capture.data, capture.path("pruned.gs4d"));
    gs4d(&arguments!["prune", scene, "--data", data, "--ratio", "0.5", "--variant", "energy", "-o", &pruned]).text();
    Some(Lesson { capture, pruned })
}

#[test]
fn training_raises_the_quality_of_a_pruned_scene() {
    let Some(lesson) = lesson() else { return };
    let out = lesson.capture.path("tuned.gs4d");
    let steps = ["--steps", "120", "--evaluate-every", "60", "--json"];
    let command = arguments!["finetune", &lesson.pruned, "--data", &lesson.capture.data, "-o", &out];
    let json = gs4d(&[command.to_vec(), steps.map(Into::into).to_vec()].concat()).json();
    assert_eq!(
        (json["gaussians"].as_u64(), json["views"].as_u64()),
        (Some(500), Some(12)),
        "one of four cameras is held out"
    );
    let (before, best) = (json["psnr_before"].as_f64(), json["best"]["psnr"].as_f64());
    assert!(best > before.map(|before| before + 2.0), "{best:?} dB after {before:?}");
    assert_eq!(json["curve"].as_array().map(Vec::len), Some(3), "three points: before, halfway, at the end");
    assert_eq!(lesson.capture.left(), ["data", "pruned.gs4d", "scene.gs4d", "tuned.gs4d"], "no state file is left");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!((info["gaussians"].as_u64(), info["form"].as_str()), (Some(500), Some("trained")), "{info}");
    let small = lesson.capture.path("small.gs4d");
    let command = arguments!["finetune", &out, "--data", &lesson.capture.data, "-o", &small];
    let coded = ["--steps", "4", "--compress", "balanced", "--compress-steps", "10", "--json"];
    let terms = ["--motion-weight", "--rigid-weight", "--opacity-weight"];
    let terms = terms.into_iter().flat_map(|term| [term, "1e-6"]).map(Into::into).collect();
    gs4d(&[command.to_vec(), coded.map(Into::into).to_vec(), terms].concat()).json();
    let info = gs4d(&arguments!["info", &small, "--json"]).json();
    assert_eq!((info["gaussians"].as_u64(), info["form"].as_str()), (Some(500), Some("packed")), "{info}");
    let psnr = |scene: &PathBuf| {
        let found =
            gs4d(&arguments!["eval", scene, "--data", &lesson.capture.data, "--metrics", "psnr", "--json"]).json();
        found["mean"]["psnr"].as_f64().expect("a number")
    };
    assert!(psnr(&small) > psnr(&lesson.pruned) + 1.0, "the compressed result is better than the pruned scene");
}

#[test]
fn the_report_of_a_compressed_run_has_no_loss_of_the_compressed_scene() {
    let Some(lesson) = lesson() else { return };
    let out = lesson.capture.path("out.gs4d");
    for (quality, form) in [("visually-lossless", "packed"), ("lossless", "runtime")] {
        let command =
            arguments!["finetune", &lesson.pruned, "--data", &lesson.capture.data, "-o", &out, "--steps", "3"];
        let command = [command.to_vec(), arguments!["--compress", quality].to_vec()].concat();
        let json = gs4d(&[&command[..], &["--json".into()]].concat()).json();
        let [first, trained, coded] = &json["curve"].as_array().expect("a curve")[..] else {
            panic!("{quality}: the curve has points before training, after it and after compression: {json}");
        };
        for name in ["loss", "training_psnr"] {
            for point in [first, coded] {
                assert_eq!(point[name], Value::Null, "{quality}: {name} is null where no step was made: {json}");
            }
            assert!(trained[name].is_f64(), "{quality}: {name} of the three steps is measured: {json}");
        }
        assert_eq!((&json["psnr"], &json["compressed"]), (&coded["psnr"], &true.into()), "{quality}: the package");
        let info = gs4d(&arguments!["info", &out, "--json"]).json();
        assert_eq!(info["form"], form, "{quality}: the form of the package");
        let run = gs4d(&command);
        assert!(!run.err.contains("inf") && !run.out.contains("inf"), "{quality}: no infinite PSNR: {}", run.err);
        let of_package: Vec<&str> = run.err.lines().filter(|line| line.starts_with("compressed: ")).collect();
        assert!(
            of_package.len() == 1 && of_package[0].contains("validation") && !of_package[0].contains("loss"),
            "{quality}: the line of the package has the validation PSNR and no loss: {}",
            run.err
        );
        let text = run.text();
        let row = text.lines().last().expect("the last row of the curve").split_whitespace().collect::<Vec<_>>();
        assert_eq!(row[..3], ["compressed", "-", "-"], "{quality}: the row of the package has only the PSNR: {text}");
        let psnr = format!("PSNR        {} dB compressed, ", row[3]);
        assert!(text.contains(&psnr), "{quality}: the PSNR of the package is reported: {text}");
    }
}

/// Runs a command and interrupts it when its first evaluation is printed.
#[cfg(unix)]
fn interrupted(command: &[OsString]) -> Run {
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};

    let child = Command::new(GS4D).args(command).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.expect("the command starts");
    let mut lines = BufReader::new(child.stderr.take().expect("standard error is piped"));
    let mut err = String::new();
    while lines.read_line(&mut err).expect("standard error can be read") > 0 {
        if err.lines().any(|line| line.starts_with("step 0:")) {
            let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
            assert!(killed.expect("kill runs").success(), "the command can be interrupted");
            break;
        }
    }
    lines.read_to_string(&mut err).expect("standard error can be read");
    let mut run = Run::of(&child.wait_with_output().expect("the command ends"));
    run.err = err;
    run
}

#[cfg(unix)]
#[test]
fn the_report_of_an_interrupted_run_says_that_the_package_is_not_compressed() {
    let Some(lesson) = lesson() else { return };
    let out = lesson.capture.path("out.gs4d");
    let command =
        arguments!["finetune", &lesson.pruned, "--data", &lesson.capture.data, "-o", &out, "--steps", "1000000"];
    let command =
        [command.to_vec(), arguments!["--evaluate-every", "1000000", "--compress", "small"].to_vec()].concat();
    let run = interrupted(&command);
    assert_eq!(run.code, Some(130), "an interrupted run has exit code 130: {}", run.err);
    let said = run.out.lines().find(|line| line.starts_with("interrupted"));
    assert!(
        said.is_some_and(|line| line.contains("not compressed") && line.contains("resumes")),
        "the text has the form of the package and the remedy: {}",
        run.out
    );
    assert!(!run.out.contains(", compressed"), "the text does not have a compressed result: {}", run.out);
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!(info["form"], "trained", "the package is not compressed: {info}");
    let run = interrupted(&[&command[..], &["--json".into()]].concat());
    assert_eq!(run.code, Some(130), "an interrupted run has exit code 130: {}", run.err);
    let json: Value = serde_json::from_str(&run.out).expect("one JSON document");
    assert_eq!(
        (&json["interrupted"], &json["compressed"]),
        (&true.into(), &false.into()),
        "the document has both states: {json}"
    );
    assert_eq!(json["psnr"], json["best"]["psnr"], "the PSNR is that of the written parameters: {json}");
}

#[test]
fn invalid_inputs_of_training_are_refused_and_leave_no_files() {
    let Some(lesson) = lesson() else { return };
    let out = lesson.capture.path("out.gs4d");
    let before = lesson.capture.left();
    let packed = lesson.capture.path("packed.gs4d");
    gs4d(&arguments!["compress", &lesson.pruned, &packed, "--verify", "0"]).text();
    let run = |scene: &PathBuf, data: &PathBuf| {
        gs4d(&arguments!["finetune", scene, "--data", data, "-o", &out, "--steps", "2"])
    };
    run(&packed, &lesson.capture.data).must_fail("trained form");
    fs::remove_file(&packed).expect("the file exists");
    run(&lesson.pruned, &lesson.capture.path("nowhere")).must_fail("nowhere");
    gs4d(&arguments!["finetune", &lesson.pruned, "--data", &lesson.capture.data, "-o", &lesson.pruned])
        .must_fail("itself");
    let weighted =
        arguments!["finetune", &lesson.pruned, "--data", &lesson.capture.data, "-o", &out, "--rigid-weight=-1"];
    gs4d(&weighted).must_fail("--rigid-weight");
    // The images of another scene.
    let other = synthesize(&SynthSettings { count: 1000, seed: 9, ..SynthSettings::default() });
    let mut other = other.into_runtime().expect("the scene can be drawn");
    other.trained_with.background = [0.9, 0.8, 0.1];
    let elsewhere = lesson.capture.path("elsewhere");
    dataset::write(&elsewhere, &other, Vec3::new(0.0, 0.0, 40.0), 4, 4, UVec2::splat(48), true);
    run(&lesson.pruned, &elsewhere).must_fail("do not show this capture");
    fs::remove_dir_all(&elsewhere).expect("the file exists");
    let image = lesson.capture.data.join("train/c01_02.png");
    fs::remove_file(&image).expect("the file exists");
    run(&lesson.pruned, &lesson.capture.data).must_fail("c01_02.png");
    assert_eq!(lesson.capture.left(), before, "no file is left");
    assert!(lesson.capture.scene.is_file(), "the scene exists");
}

#[test]
fn options_for_gaps_need_images_with_gaps() {
    let Some(lesson) = lesson() else { return };
    let run = |out: &str| {
        let command =
            arguments!["finetune", &lesson.pruned, "--data", &lesson.capture.data, "-o", &lesson.capture.path(out)];
        let more = ["--steps", "2", "--trust-images", "--mask-weight", "0.1", "--behind", "fixed"];
        gs4d(&[command.to_vec(), more.map(Into::into).to_vec()].concat())
    };
    run("out.gs4d")
        .must_fail("--mask-weight has no effect on images without transparent pixels and masks; leave it out");
    let path = lesson.capture.data.join("train/c01_02.png");
    let mut image = image::open(&path).expect("a picture").into_rgba8();
    image.get_pixel_mut(3, 4).0[3] = 200;
    image.save(&path).expect("the folder can be written to");
    run("out.gs4d").text();
}
