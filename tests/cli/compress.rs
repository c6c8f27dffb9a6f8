//! `gs4d compress`, run as a user runs it on extreme scenes and settings.
//!
//! In: synthetic scenes with extreme values, extreme options. Out: proof that the package at OUT is unchanged if
//! compression fails, and is replaced by a readable package otherwise.

use crate::support::command::{arguments, folder, gs4d, scene};
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{SceneForm, Trained};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Writes a scene in the trained form, changed by `change`. Returns its path.
fn changed(folder: &TempDir, name: &str, change: impl FnOnce(&mut Trained)) -> PathBuf {
    let path = folder.path().join(name);
    let mut scene = synthesize(&SynthSettings { count: 300, degree: 1, ..SynthSettings::default() });
    let SceneForm::Trained(trained) = &mut scene.form else { panic!("synthetic scenes are trained") };
    change(trained);
    offline::save(&path, &scene, &WriteSettings::default()).expect("the folder can be written to");
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
