//! The outputs of verbs, run as a user runs them.
//!
//! In: a small synthetic scene, a dataset drawn from it, outputs of every kind. Out: proof that no verb writes over an
//! input, that bad outputs are refused before any input is read, that replaced files keep their links and permissions,
//! and that two runs to the same output do not mix.

use crate::support::capture::Capture;
use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::folders::contents;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::Path;

fn capture() -> Capture {
    let trained = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
    Capture::new(trained, Vec3::ZERO, 4, 2, UVec2::splat(48), true)
}

#[test]
fn no_verb_writes_over_an_input() {
    let capture = capture();
    let (scene, data) = (&capture.scene, &capture.data);
    let [scores, settings] = ["scores.f32", "cfg_args"].map(|name| capture.path(name));
    fs::write(&scores, [0; 4 * 200]).expect("the folder can be written to");
    fs::write(&settings, "Namespace()").expect("the folder can be written to");
    let [cameras, trained_on, image] =
        ["transforms_test.json", "transforms_train.json", "train/c01_00.png"].map(|name| data.join(name));
    let before = contents(capture.folder.path());
    let commands = [
        arguments!["convert", scene, scene].to_vec(),
        arguments!["convert", scene, data.join("../scene.gs4d")].to_vec(),
        arguments!["convert", scene, &settings].to_vec(),
        arguments!["export", scene, scene, "--format", "ply", "--time", "0"].to_vec(),
        arguments!["export", scene, &settings, "--format", "splat", "--time", "0"].to_vec(),
        arguments!["compress", scene, scene].to_vec(),
        arguments!["compress", scene, "--weights", &scores, "-o", &scores].to_vec(),
        arguments!["compress", scene, "--cameras", &cameras, "-o", &cameras].to_vec(),
        arguments!["synth", scene, "--grow", "2", scene].to_vec(),
        arguments!["prune", scene, "--data", data, "--ratio", "0.5", "-o", scene].to_vec(),
        arguments!["prune", scene, "--scores", &scores, "--keep", "9", "-o", &scores].to_vec(),
        arguments!["mask", scene, "-o", scene].to_vec(),
        arguments!["socket", scene, "--name", "a", "--at", "0,0,0", "--time", "0", "-o", scene].to_vec(),
        arguments!["collide", scene, "-o", scene].to_vec(),
        arguments!["sound", scene, &settings, "-o", scene].to_vec(),
        arguments!["sound", scene, "--extract", scene].to_vec(),
        arguments!["mask", scene, "--filter", "interval", "--data", data, "-o", &image].to_vec(),
        arguments!["score", scene, "--data", data, "--out", scene].to_vec(),
        arguments!["score", scene, "--data", data, "--out", &trained_on].to_vec(),
        arguments!["ablate", scene, "--data", data, "--csv", scene].to_vec(),
        arguments!["ablate", scene, "--data", data, "--csv", &image].to_vec(),
        arguments!["eval", scene, "--data", data, "--out", data.join("test")].to_vec(),
        arguments!["render", scene, "--cameras", &cameras, "--out", data.join("test")].to_vec(),
        arguments!["render", scene, "--cameras", &cameras, "--out", data.join("train")].to_vec(),
        arguments!["finetune", scene, "--data", data, "-o", scene].to_vec(),
        arguments!["bake", scene, "--data", data, "-o", scene].to_vec(),
        arguments!["train", "--data", data, "-o", &image].to_vec(),
    ];
    for command in commands {
        gs4d(&command).must_fail("the input itself");
    }
    assert!(contents(capture.folder.path()) == before, "every file is unchanged");
}

#[cfg(unix)]
#[test]
fn links_to_inputs_and_to_other_outputs_are_refused() {
    use std::os::unix::fs::symlink;
    let capture = capture();
    let [hard, soft, report, out] =
        ["hard.gs4d", "soft.gs4d", "out.report.json", "out.gs4d"].map(|name| capture.path(name));
    fs::hard_link(&capture.scene, &hard).expect("the folder can be written to");
    symlink("scene.gs4d", &soft).expect("the folder can be written to");
    for link in [&hard, &soft] {
        gs4d(&arguments!["convert", &capture.scene, link]).must_fail("the input itself");
        gs4d(&arguments!["mask", link, "-o", &capture.scene]).must_fail("the input itself");
    }
    symlink("out.gs4d", &report).expect("the folder can be written to");
    gs4d(&arguments!["bake", &capture.scene, "--data", &capture.data, "-o", &out]).must_fail("written twice");
    assert!(!out.exists(), "no output is written");
}

#[test]
fn a_bad_output_is_refused_before_any_input_is_read() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let (nothing, no_data) = (path("nothing.pth"), path("nothing"));
    fs::write(path("file"), "contents").expect("the folder can be written to");
    for extension in ["gs4d", "f32", "csv"] {
        fs::create_dir(path(&format!("folder.{extension}"))).expect("the folder can be written to");
        let kept = path(&format!("kept.{extension}"));
        fs::write(&kept, "contents").expect("the folder can be written to");
        let mut permissions = kept.metadata().expect("the file exists").permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&kept, permissions).expect("permissions can be set");
    }
    let refused = |command: Vec<OsString>, reason: &str| {
        let run = gs4d(&command);
        run.must_fail(reason);
        assert!(!run.err.contains("nothing"), "{command:?}: the error is about the output: {}", run.err);
    };
    let of = |extension: &str| {
        [
            (path(&format!("missing/out.{extension}")), "there is no folder"),
            (path(&format!("file/out.{extension}")), "not a folder"),
            (path(&format!("folder.{extension}")), "is a folder"),
            (path(&format!("kept.{extension}")), "write-protected"),
            (path("out.png"), "choose another name"),
        ]
    };
    for (out, reason) in of("gs4d") {
        refused(arguments!["convert", &nothing, &out].to_vec(), reason);
        refused(arguments!["compress", &nothing, &out].to_vec(), reason);
        refused(arguments!["synth", &out, "--grow", "2", &nothing].to_vec(), reason);
        refused(arguments!["prune", &nothing, "--data", &no_data, "--keep", "9", "-o", &out].to_vec(), reason);
        refused(arguments!["mask", &nothing, "-o", &out].to_vec(), reason);
        refused(arguments!["collide", &nothing, "-o", &out].to_vec(), reason);
        refused(arguments!["finetune", &nothing, "--data", &no_data, "-o", &out].to_vec(), reason);
        refused(arguments!["bake", &nothing, "--data", &no_data, "-o", &out].to_vec(), reason);
        refused(arguments!["train", "--data", &no_data, "-o", &out].to_vec(), reason);
    }
    for (out, reason) in of("f32") {
        refused(arguments!["score", &nothing, "--data", &no_data, "--out", &out].to_vec(), reason);
    }
    for (out, reason) in of("csv") {
        refused(arguments!["ablate", &nothing, "--data", &no_data, "--csv", &out].to_vec(), reason);
    }
    for out in [path("file"), path("file/frames")] {
        let reason = "not a folder";
        refused(arguments!["render", &nothing, "--orbit", "1", "--out", &out].to_vec(), reason);
        refused(arguments!["collide", &nothing, "-o", path("out.gs4d"), "--obj", &out].to_vec(), reason);
        refused(arguments!["eval", &nothing, "--data", &no_data, "--out", &out].to_vec(), reason);
        refused(arguments!["score", &nothing, "--data", &no_data, "--variant", "all", "--out", &out].to_vec(), reason);
    }
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_refused_where_a_file_is_needed() {
    let folder = folder();
    let (nothing, data) = (folder.path().join("nothing.pth"), folder.path().join("nothing"));
    for device in ["/dev/null", "/dev/stdout"] {
        for command in [
            arguments!["bake", &nothing, "--data", &data, "-o", device].to_vec(),
            arguments!["finetune", &nothing, "--data", &data, "-o", device].to_vec(),
            arguments!["compress", &nothing, device].to_vec(),
            arguments!["collide", &nothing, "-o", device].to_vec(),
        ] {
            let run = gs4d(&command);
            run.must_fail(&format!("{device}: is a device or a pipe"));
            assert!(!run.err.contains("nothing"), "{command:?}: before any input is read: {}", run.err);
        }
    }
    assert!(!Path::new("/dev/null.tune").exists(), "no folder beside a device");
}

#[cfg(unix)]
#[test]
fn errors_of_links_and_devices_name_the_file_in_a_sentence() {
    use std::os::unix::fs::symlink;
    let folder = folder();
    let (input, circle) = (scene(&folder, "50"), folder.path().join("circle.gs4d"));
    symlink("circle.gs4d", &circle).expect("the folder can be written to");
    let data = folder.path().join("data");
    for command in [
        arguments!["info", &circle].to_vec(),
        arguments!["convert", &circle, folder.path().join("out.gs4d")].to_vec(),
        arguments!["convert", &input, &circle].to_vec(),
        arguments!["convert", &input, circle.join("out.gs4d")].to_vec(),
        arguments!["bake", &input, "--data", &data, "-o", &circle].to_vec(),
        arguments!["render", &input, "--orbit", "1", "--out", circle.join("frames")].to_vec(),
    ] {
        let run = gs4d(&command);
        run.must_fail("symbolic links lead in a circle");
        assert!(run.err.contains("circle.gs4d"), "{command:?}: the file is named: {}", run.err);
        assert!(!run.err.contains("os error"), "{command:?}: no number of the system: {}", run.err);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn standard_error_is_empty_where_there_is_no_session() {
    use crate::support::command::{GS4D, Run, has_gpu};
    use std::process::Command;
    if !has_gpu() {
        return;
    }
    let folder = folder();
    let scene = scene(&folder, "50");
    let command =
        arguments!["render", &scene, "--orbit", "1", "--size", "16x16", "--out", folder.path().join("frames")];
    let mut child = Command::new(GS4D);
    child.args(&command).env_remove("XDG_RUNTIME_DIR").env_remove("WAYLAND_DISPLAY");
    let run = Run::of(&child.output().expect("the command starts"));
    assert_eq!((run.code, run.err.as_str()), (Some(0), ""), "neither the driver nor libwayland prints a line");
    assert!(folder.path().join("frames/orbit_0000.png").is_file(), "a picture is drawn");
}

#[test]
fn absurd_weights_are_refused_in_a_few_words() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    for option in ["--mask-weight", "--motion-weight", "--rigid-weight", "--opacity-weight", "--mean-rate"] {
        let run = gs4d(&arguments!["finetune", path("a"), "--data", path("d"), "-o", path("o.gs4d"), option, "1e308"]);
        run.must_fail(option);
        assert!(run.err.contains("expected a number from 0 to 1000000"), "{option}: the range: {}", run.err);
        assert!(!run.err.contains("00000000"), "{option}: no long row of digits: {}", run.err);
    }
}

#[cfg(unix)]
#[test]
fn replaced_files_keep_their_links_and_permissions() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = folder();
    let input = scene(&folder, "50");
    let (out, link) = (folder.path().join("out.gs4d"), folder.path().join("link.gs4d"));
    fs::write(&out, "contents").expect("the folder can be written to");
    fs::set_permissions(&out, fs::Permissions::from_mode(0o640)).expect("permissions can be set");
    symlink("out.gs4d", &link).expect("the folder can be written to");
    gs4d(&arguments!["convert", &input, &link]).text();
    assert!(link.is_symlink(), "the link is not replaced by a file");
    assert_eq!(
        fs::read(&out).expect("the file exists"),
        fs::read(&input).expect("the file exists"),
        "the target of the link is replaced"
    );
    let mode = out.metadata().expect("the file exists").permissions().mode() & 0o777;
    assert_eq!(mode, 0o640, "the permissions are unchanged");
}

#[test]
fn temporary_files_of_killed_runs_are_removed() {
    let folder = folder();
    let input = scene(&folder, "50");
    let [killed, live] = [".gs4d-killed.part", ".gs4d-live.part"].map(|name| folder.path().join(name));
    fs::write(&killed, "some bytes").expect("the folder can be written to");
    let writing = File::create(&live).expect("the folder can be written to");
    writing.lock().expect("the file is not locked");
    gs4d(&arguments!["convert", &input, folder.path().join("out.gs4d")]).text();
    assert!(!killed.exists(), "the file of a killed run is removed");
    assert!(live.exists(), "a locked file is still being written");
}

#[test]
fn a_bake_removes_only_files_that_it_has_written() {
    let capture = capture();
    let (out, work) = (capture.path("out.gs4d"), capture.path("out.gs4d.bake"));
    let bake = |more: &[&str]| {
        let (scene, data) = (&capture.scene, &capture.data);
        let fixed = arguments!["bake", scene, "--data", data, "--ratio", "0.5", "--engine", "cpu", "-o", &out];
        gs4d(&[fixed.to_vec(), more.iter().map(Into::into).collect()].concat()).text()
    };
    bake(&["--keep-work"]);
    let notes = work.join("notes.txt");
    fs::write(&notes, "mine").expect("the folder can be written to");
    bake(&[]);
    let left = contents(&work);
    assert_eq!(left.keys().collect::<Vec<_>>(), [&notes], "only the foreign file is left");
    fs::remove_file(&notes).expect("the file exists");
    bake(&[]);
    assert!(!work.exists(), "the empty folder is removed");
}

#[test]
fn a_second_run_to_the_same_output_is_refused() {
    let capture = capture();
    let out = capture.path("out.gs4d");
    for (verb, name) in [("bake", "out.gs4d.bake"), ("finetune", "out.gs4d.tune")] {
        let lock = capture.path(name).join("lock");
        fs::create_dir(capture.path(name)).expect("the folder can be written to");
        let running = File::create(&lock).expect("the folder can be written to");
        running.lock().expect("the file is not locked");
        let run = gs4d(&arguments![verb, &capture.scene, "--data", &capture.data, "-o", &out]);
        run.must_fail(&format!("{name}: another run of gs4d works in this folder"));
        assert!(lock.exists() && !out.exists(), "{verb}: the lock is kept and no output is written");
    }
}
