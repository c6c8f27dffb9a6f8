//! `export`, and the commands that open what it writes.
//!
//! In: a small synthetic scene. Out: proof that files and folders have the names, the contents and the report that the
//! options ask for, and that options without an effect and files of other sequences are refused.

use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::folders::contents;
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;

#[test]
fn a_moment_is_exported_and_opened_again() {
    let folder = folder();
    let scene = scene(&folder, "300");
    let frame = folder.path().join("frame.ply");
    let report = gs4d(&arguments!["export", &scene, &frame, "--time", "0.5", "--json"]).json();
    assert_eq!((&report["format"], &report["files"][0]["time"]), (&"ply".into(), &0.5.into()), "format and time");
    let size = fs::metadata(&frame).expect("the file is there").len();
    assert_eq!((&report["bytes"], &report["files"][0]["bytes"]), (&size.into(), &size.into()), "its size");
    let info = gs4d(&arguments!["info", &frame, "--json"]).json();
    assert_eq!(info["gaussians"], report["files"][0]["gaussians"], "the Gaussians of the moment");
    assert_eq!((&info["format"], &info["form"]), (&"ply".into(), &"trained".into()), "a PLY of Gaussians at rest");

    let still = folder.path().join("still.splat");
    let text = gs4d(&arguments!["export", &frame, &still]).text();
    assert!(text.contains("degree 0"), "what a .splat file cannot hold is reported: {text}");
    gs4d(&arguments!["export", &scene, &still]).must_fail("--time");
    gs4d(&arguments!["export", &scene, folder.path().join("x.obj")]).must_fail("names no format");
    gs4d(&arguments!["export", &scene, folder.path().join("x.obj"), "--format", "ply", "--time", "0"])
        .must_fail(".ply");
}

#[test]
fn motion_is_exported_whole() {
    let folder = folder();
    let scene = scene(&folder, "300");
    let moving = folder.path().join("capture.ftgs.ply");
    let report = gs4d(&arguments!["export", &scene, &moving, "--json"]).json();
    assert_eq!(
        (&report["format"], &report["files"][0]["gaussians"]),
        (&"free-time".into(), &300.into()),
        "all Gaussians"
    );
    assert!(report["files"][0]["time"].is_null(), "all times");
    assert!(report["lost"].as_array().is_some_and(|lost| !lost.is_empty()), "color in time is lost: {report}");
    gs4d(&arguments!["export", &scene, &moving, "--time", "0"]).must_fail("--time has no effect");
    let info = gs4d(&arguments!["info", &moving, "--json"]).json();
    assert_eq!((&info["gaussians"], &info["form"]), (&300.into(), &"runtime".into()), "moving Gaussians");
}

#[test]
fn a_sequence_is_a_folder_that_opens_as_one_capture() {
    let folder = folder();
    let scene = scene(&folder, "300");
    let frames = folder.path().join("frames");
    let arguments = arguments!["export", &scene, &frames, "--sequence", "--fps", "4", "--json"];
    let report = gs4d(&arguments).json();
    let files = report["files"].as_array().expect("a list of files");
    assert_eq!(files.len(), 8, "eight frames in two seconds");
    let all: u64 = files.iter().filter_map(|file| file["gaussians"].as_u64()).sum();
    // What macOS leaves on drives of other systems.
    for hidden in ["._frame_00000.ply", ".DS_Store"] {
        fs::write(frames.join(hidden), b"\x00\x05\x16\x07").expect("the folder can be written to");
    }
    let info = gs4d(&arguments!["info", &frames, "--fps", "4", "--json"]).json();
    assert_eq!((&info["format"], &info["gaussians"]), (&"sequence".into(), &all.into()), "the Gaussians of all frames");
    assert_eq!(info["switches"]["playback"]["duration_seconds"], 2.0, "its length");
    gs4d(&arguments!["convert", &frames, folder.path().join("again.gs4d"), "--fps", "4"]).text();

    let before = contents(&frames);
    assert!(
        before == {
            gs4d(&arguments).text();
            contents(&frames)
        },
        "frames are replaced by the same frames"
    );
    let two = arguments!["export", &scene, &frames, "--sequence", "--fps", "2"];
    gs4d(&two).must_fail("another sequence");
    gs4d(&arguments!["export", &frames, &frames, "--sequence", "--fps", "4"]).must_fail("the input itself");
    assert!(before == contents(&frames), "every file is unchanged");
    let other = folder.path().join("other");
    fs::create_dir(&other).expect("the folder can be made");
    gs4d(&arguments!["info", &other]).must_fail("other");
    gs4d(&arguments!["convert", &other, folder.path().join("other.gs4d")]).must_fail("frame_0001.ply");
}

#[test]
fn the_up_axis_is_noted_and_comes_back() {
    let folder = folder();
    let scene = scene(&folder, "60");
    let [still, moving, frames] = ["still.ply", "moving.ftgs.ply", "frames"].map(|name| folder.path().join(name));
    let cases: [(&PathBuf, &[&str]); 3] =
        [(&still, &["--time", "0.5"]), (&moving, &[]), (&frames, &["--sequence", "--fps", "2"])];
    for (out, more) in cases {
        let more: Vec<OsString> = more.iter().map(Into::into).collect();
        let text = gs4d(&[arguments!["export", &scene, out].to_vec(), more].concat()).text();
        assert_eq!(text.matches("+z points up").count(), 1, "{}: the up axis is noted once: {text}", out.display());
        let info = gs4d(&arguments!["info", out, "--json"]).json();
        assert_eq!(info["switches"]["playback"]["up"], "pos_z", "{}: the axis of the capture", out.display());
    }
}
