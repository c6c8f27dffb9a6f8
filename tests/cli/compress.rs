//! `gs4d compress`, run as a user runs it on extreme scenes and settings.
//!
//! In: synthetic scenes with extreme values, extreme options. Out: proof that the package at OUT is unchanged if
//! compression fails, and is replaced by a readable package otherwise.

use crate::support::command::{arguments, folder, gs4d, scene};
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{SceneForm, Trained};
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Writes a scene in the trained form, changed by `change`. Returns its path.
fn changed(folder: &TempDir, name: &str, change: impl FnOnce(&mut Trained)) -> PathBuf {
    let path = folder.path().join(name);
    let mut scene = synthesize(&SynthSettings { count: 300, degree: 1, ..SynthSettings::default() });
    let SceneForm::Trained(trained) = &mut scene.form else { panic!("synthetic scenes are trained") };
    change(trained);
    offline::work::save(&path, &scene, &WriteSettings::default()).expect("the folder can be written to");
    path
}

#[test]
fn a_scene_that_cannot_be_packed_does_not_change_the_existing_package() {
    let folder = folder();
    let (good, out) = (scene(&folder, "300"), folder.path().join("out.gs4d"));
    gs4d(&arguments!["compress", &good, &out, "--verify", "0"]).text();
    let before = fs::read(&out).expect("the package exists");
    let far = changed(&folder, "far.gs4d", |trained| {
        (trained.parameters.mean[7], trained.parameters.mean[8]) = ([3e38; 3], [-3e38; 3]);
    });
    let bright = changed(&folder, "bright.gs4d", |trained| {
        trained.harmonics.values[..2].copy_from_slice(&[3e38, -3e38]);
    });
    for (path, name) in [(&far, "far.gs4d"), (&bright, "bright.gs4d")] {
        let run = gs4d(&arguments!["compress", path, &out, "--verify", "0"]);
        run.must_fail("does not fit the packed form");
        assert!(run.err.contains(name), "{name} is named: {}", run.err);
        assert!(fs::read(&out).expect("the package still exists") == before, "{name}: the package is unchanged");
        gs4d(&arguments!["compress", path, &out, "--verify", "0", "--quality", "lossless"]).text();
        gs4d(&arguments!["info", &out]).text();
        fs::write(&out, &before).expect("the folder can be written to");
    }
}

#[test]
fn progressive_packages_have_layers_that_can_be_drawn_early() {
    let folder = folder();
    let (input, out) = (scene(&folder, "3000"), folder.path().join("out.gs4d"));
    let compress = arguments!["compress", &input, &out, "--verify", "0", "--codebooks", "64"].to_vec();
    for (option, layers) in [(None, 1), (Some("--progressive".into()), 3)] {
        gs4d(&compress.iter().cloned().chain(option).collect::<Vec<_>>()).text();
        let info = gs4d(&arguments!["info", &out, "--json"]).json();
        let ends: Vec<u64> = serde_json::from_value(info["package"]["layers"].clone()).expect("numbers of bytes");
        assert_eq!(ends.len(), layers, "the layers: {info}");
        let text = gs4d(&arguments!["info", &out]).text();
        let share = format!("after {:.0} %", 100.0 * ends[0] as f64 / info["bytes"].as_f64().expect("the size"));
        assert!(text.contains("drawn coarsely") && text.contains(&share), "{share} is told: {text}");
        let rate = info["megabits_per_second"].as_f64().expect("the capture plays");
        let [bytes, seconds] =
            [&info["bytes"], &info["switches"]["playback"]["duration_seconds"]].map(|value| value.as_f64());
        let expected = bytes.expect("the size") * 8e-6 / seconds.expect("the duration");
        assert!((rate / expected - 1.0).abs() < 1e-6, "{rate}, not {expected} Mbit/s");
        assert!(text.contains(&format!("{rate:.1} Mbit/s")), "the bit rate is told: {text}");
    }
}

#[test]
fn packed_captures_are_stored_in_another_order() {
    let folder = folder();
    let (input, packed) = (scene(&folder, "6000"), folder.path().join("packed.gs4d"));
    let [out, chunks] = ["out.gs4d", "chunks"].map(|name| folder.path().join(name));
    gs4d(&arguments!["compress", &input, &packed, "--verify", "0", "--codebooks", "64"]).text();
    let reordered = |options: &[OsString]| {
        let fixed =
            arguments!["compress", &packed, &out, "--verify", "1", "--size", "64x48", "--engine", "cpu", "--json"];
        gs4d(&[fixed.as_slice(), options].concat())
    };
    for options in [&arguments!["--progressive"][..], &arguments!["--chunk", "0.25"]] {
        let report = reordered(options).json();
        let psnr = report["psnr_to_original"][0].as_f64().expect("one view");
        assert!(psnr > 60.0, "{options:?}: {psnr} dB to the packed capture");
        assert_eq!(report["settings"].as_object().map(|own| own.len()), Some(1), "only the order: {report}");
        let info = gs4d(&arguments!["info", &out, "--json"]).json();
        let layers = match options {
            [_] => info["package"]["layers"].as_array().map(|layers| layers.len() as u64),
            _ => info["runs"]["layers"].as_u64(),
        };
        assert_eq!(layers, Some(3), "{options:?}: the layers: {info}");
        let bytes = report["bytes_out"].as_f64().expect("the size") / report["bytes_in"].as_f64().expect("the size");
        assert!(bytes < 1.25, "{options:?}: {bytes} of the size");
    }
    gs4d(&arguments!["split", &out, "-o", &chunks]).text();
    let refused = "the scene is packed already";
    reordered(&arguments!["--progressive", "--quality", "small"]).must_fail(refused);
    reordered(&arguments!["--progressive", "--mean-bits", "9"]).must_fail(refused);
    reordered(&[]).must_fail("--progressive or --chunk alone changes its order");
}

#[test]
fn color_steps_are_normal_numbers_and_leave_colors_finite() {
    let folder = folder();
    let (input, out) = (scene(&folder, "300"), folder.path().join("out.gs4d"));
    let compress = |step: &str| {
        let fixed = arguments!["compress", &input, &out, "--verify", "0", "--quality", "visually-lossless"].to_vec();
        gs4d(&[fixed, arguments!["--color-step", step].to_vec()].concat())
    };
    for step in ["1e308", "inf", "nan", "1e-45", "1.1e-38", "1e-60"] {
        compress(step).must_fail("--color-step");
        assert!(!out.exists(), "{step}: no output is written");
    }
    for step in ["1.2e-38", "3e38", "0"] {
        compress(step).text();
        let info = gs4d(&arguments!["info", &out, "--json"]).json();
        assert_eq!(info["package"]["intact"], true, "{step}: a package that can be read");
    }
}

#[test]
fn strays_do_not_lower_the_quality_of_a_package() {
    let folder = folder();
    let out = folder.path().join("out.gs4d");
    let far = changed(&folder, "far.gs4d", |trained| {
        for index in (0..300).step_by(30) {
            trained.parameters.mean[index] = [1e3 + index as f32, -300.0, 20.0 * index as f32];
            trained.parameters.opacity_logit[index] = -3.0;
        }
    });
    let run = gs4d(&arguments!["compress", &far, &out, "--engine", "cpu", "--orbit", "2", "--size", "60x60", "--json"]);
    assert!(!run.err.contains("warning"), "the quality is kept: {}", run.err);
    let report = run.json();
    let psnr: Vec<f64> = serde_json::from_value(report["psnr_to_original"].clone()).expect("a number for each view");
    assert!(psnr.len() == 2 && psnr.iter().all(|&psnr| psnr > 45.0), "what `balanced` promises: {psnr:?} dB");
    assert_eq!(report["warnings"], serde_json::json!([]), "nothing to warn of");
    let fillers = report["report"]["fillers"].as_u64().expect("a number of fillers");
    assert!((1..256).contains(&fillers), "the last block before the strays is filled: {fillers}");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!(info["package"]["intact"], true, "a package that can be read");
}

#[test]
fn a_package_that_breaks_the_promise_of_its_quality_has_a_warning() {
    let folder = folder();
    let out = folder.path().join("out.gs4d");
    let scattered = changed(&folder, "scattered.gs4d", |trained| {
        for (index, mean) in trained.parameters.mean.iter_mut().enumerate() {
            *mean = [7919, 6101, 3571].map(|factor| (index * factor % 1009) as f32 * 100.0);
        }
    });
    let compress = |quality: &str| {
        gs4d(&arguments!["compress", &scattered, &out, "--verify", "0", "--quality", quality, "--json"])
    };
    for quality in ["small", "balanced", "visually-lossless"] {
        let run = compress(quality);
        let (code, err) = (run.code, run.err.clone());
        assert!(err.contains("warning: ") && err.contains("--quality lossless"), "{quality}, {code:?}: {err}");
        let warnings = run.json()["warnings"].clone();
        let warning = warnings[0].as_str().expect("a sentence");
        assert!(warning.contains("% of the Gaussians"), "{quality}: the figure is stated: {warning}");
    }
    let run = compress("lossless");
    assert!(!run.err.contains("warning"), "the way out works: {}", run.err);
    assert_eq!(run.json()["warnings"], serde_json::json!([]), "nothing to warn of");
}
