//! The `gs4d` command, run as a user runs it: inspecting captures, converting them, all errors of a command line, readers that end early.
//!
//! In: command lines, whole and damaged files. Out: proof that exit codes, what is printed and what is written are right, and that
//! nothing panics.

use crate::support::command::{arguments, folder, gs4d, scene};
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

#[test]
fn conversion_keeps_what_it_should() {
    let folder = folder();
    let trained = scene(&folder, "700");
    let info = gs4d(&arguments!["info", &trained, "--json"]).json();
    assert_eq!(info["gaussians"], 700, "the count asked for");
    assert_eq!(
        (&info["form"], &info["degree"], &info["degree_t"]),
        (&"trained".into(), &3.into(), &2.into()),
        "trained"
    );

    let copy = folder.path().join("copy.gs4d");
    gs4d(&arguments!["convert", &trained, &copy]).text();
    let bytes = |path: &Path| fs::read(path).expect("the package is there");
    assert_eq!(bytes(&trained), bytes(&copy), "a plain conversion changes nothing");

    let small = folder.path().join("small.gs4d");
    let converted = gs4d(&arguments![
        "convert",
        &trained,
        "--form",
        "runtime",
        "--sh-degree",
        "0",
        "--up",
        "-y",
        "--background",
        "1,0.5,0",
        "--json",
        "-o",
        &small,
    ])
    .json();
    assert_eq!(converted["bytes_out"], bytes(&small).len(), "the size that is printed");
    let info = gs4d(&arguments!["info", &small, "--json"]).json();
    assert_eq!(
        (&info["form"], &info["degree"], &info["coefficients"]),
        (&"runtime".into(), &0.into(), &1.into()),
        "small"
    );
    assert_eq!(info["switches"]["playback"]["up"], "neg_y", "the axis is stored");
    assert_eq!(info["switches"]["trained_with"]["background"][1], 0.5, "the background is stored");
    assert_eq!(info["package"]["intact"], true, "checksums hold");

    let back = folder.path().join("back.gs4d");
    gs4d(&arguments!["convert", &small, &back, "--form", "trained"]).must_fail("small.gs4d");
    assert!(!back.exists(), "nothing is written");
}

#[test]
fn a_package_knows_how_it_was_trained() {
    let folder = folder();
    let path = scene(&folder, "50");
    gs4d(&arguments!["info", &path, "--time-interval", "0,10"]).must_fail("--time-interval");
    gs4d(&arguments!["info", &path, "--time-interval", "0,1"]).text();
}

#[test]
fn people_get_text() {
    const VERBS: [&str; 12] =
        ["info", "convert", "render", "compare", "synth", "bench", "score", "prune", "mask", "eval", "ablate", "bake"];
    let folder = folder();
    let path = scene(&folder, "50");
    let text = gs4d(&arguments!["info", &path]).text();
    for expected in ["Gaussians", "time interval", "bounds", "sh_rest", "hold"] {
        assert!(text.contains(expected), "{expected} in {text}");
    }
    for verb in VERBS {
        assert!(gs4d(&[verb, "--help"]).text().contains("Examples:"), "{verb} explains itself");
    }
}

#[test]
fn damaged_files_are_named() {
    let folder = folder();
    let good = fs::read(scene(&folder, "300")).expect("the package is there");
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    let bad = [
        ("empty.gs4d", Vec::new()),
        ("garbage.gs4d", vec![0xa5; 5000]),
        ("garbage.pth", b"PK\x03\x04 and nothing after it".repeat(20)),
        ("short.gs4d", good[..good.len() - 10].to_vec()),
        ("header.gs4d", flipped(40)),
        ("body.gs4d", flipped(good.len() / 2)),
        ("last.gs4d", flipped(good.len() - 1)),
        ("long.gs4d", [good.as_slice(), b"more"].concat()),
    ];
    for (name, bytes) in bad {
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("the folder can be written to");
        let out = folder.path().join("out.gs4d");
        gs4d(&arguments!["info", &path]).must_fail(name);
        gs4d(&arguments!["convert", &path, &out]).must_fail(name);
        gs4d(&arguments!["bench", &path, "--frames", "1"]).must_fail(name);
        assert!(!out.exists(), "{name}: nothing is written");
        let json = gs4d(&arguments!["info", &path, "--json"]);
        let document: Value = serde_json::from_str(&json.out).expect("one JSON document for a failure, too");
        assert!(document["error"].as_str().is_some_and(|error| error.contains(name)), "{name} in {document}");
    }
}

#[test]
fn bad_paths_are_named() {
    let folder = folder();
    let path = scene(&folder, "50");
    let before = fs::read(&path).expect("the package is there");
    let nowhere = folder.path().join("nowhere.pth");
    gs4d(&arguments!["info", &nowhere]).must_fail("nowhere.pth");
    gs4d(&arguments!["convert", &path, &path]).must_fail("scene.gs4d");
    let roundabout = folder.path().join(".").join("scene.gs4d");
    gs4d(&arguments!["convert", &path, &roundabout]).must_fail("scene.gs4d");
    assert_eq!(fs::read(&path).expect("still there"), before, "the input is as it was");

    let inside_a_file = path.join("out.gs4d");
    gs4d(&arguments!["convert", &path, &inside_a_file]).must_fail("out.gs4d");
    gs4d(&arguments!["synth", &inside_a_file]).must_fail("out.gs4d");
    gs4d(&arguments!["render", &path, "--cameras", "gone.json", "--out", "frames"]).must_fail("gone.json");
    gs4d(&arguments!["convert", &path, &nowhere]).must_fail("nowhere.pth");
    gs4d(&arguments!["compare", &path, folder.path()]).must_fail("scene.gs4d");
    let left = fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(left, 1, "no file stays behind");
}

#[cfg(target_os = "linux")]
#[test]
fn paths_need_not_be_unicode() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = folder();
    let path = folder.path().join(OsStr::from_bytes(b"sc\xff\xfene.gs4d"));
    gs4d(&arguments!["synth", &path, "--count", "20"]).text();
    let grown = folder.path().join("grown.gs4d");
    let made = gs4d(&arguments!["synth", &grown, "--grow", "3", &path, "--json"]).json();
    assert_eq!(made["gaussians"], 60, "three for each");
    gs4d(&arguments!["synth", &path, "--grow", "3", &path]).must_fail("the input itself");
    let info = gs4d(&arguments!["info", &path, "--json"]).json();
    assert_eq!(info["gaussians"], 20, "read back");
    let gone = folder.path().join(OsStr::from_bytes(b"g\xffne.pth"));
    gs4d(&arguments!["info", &gone]).must_fail("ne.pth");
}

#[test]
fn usage_errors_name_the_option() {
    for (arguments, name) in [
        (&["info"][..], "FILE"),
        (&["frobnicate"], "frobnicate"),
        (&["synth", "x.gs4d", "--count", "0"], "--count"),
        (&["synth", "x.gs4d", "--grow", "0", "y.gs4d"], "--grow 0"),
        (&["synth", "x.gs4d", "--grow", "2", "y.gs4d", "--count", "5"], "--count"),
        (&["info", "x.gs4d", "--background", "1,2"], "--background"),
        (&["info", "x.gs4d", "--time-interval", "1,0"], "--time-interval"),
        (&["info", "x.gs4d", "--up", "sideways"], "--up"),
        (&["render", "x.gs4d", "--out", "frames"], "--cameras"),
        (&["render", "x.gs4d", "--orbit", "3", "--size", "0x9", "--out", "frames"], "--size"),
        (&["synth"], "OUT"),
    ] {
        gs4d(arguments).must_fail(name);
    }
}

#[test]
fn errors_of_usage_are_json_if_asked_for() {
    for (arguments, name) in [
        (&["info", "--json"][..], "FILE"),
        (&["frobnicate", "--json"], "frobnicate"),
        (&["--json", "synth", "x.gs4d", "--count", "0"], "--count"),
        (&["compress", "x.gs4d", "y.gs4d", "--data", "z", "--json"], "--data"),
    ] {
        let run = gs4d(arguments);
        run.must_fail(name);
        let document: Value = serde_json::from_str(&run.out).expect("one JSON document for an error of usage, too");
        let error = document["error"].as_str().expect("an error");
        assert!(error.contains(name) && !error.contains("Usage") && !error.contains('\n'), "{name} in short: {error}");
    }
    let text = gs4d(&["info"]);
    text.must_fail("FILE");
    assert!(text.out.is_empty() && text.err.contains("Usage: gs4d info"), "people see how it is used: {}", text.err);
    let help = gs4d(&["info", "--help", "--json"]).text();
    assert!(help.contains("Examples:"), "help is no error");
}

#[test]
fn errors_of_the_system_are_put_in_words() {
    let folder = folder();
    let run = gs4d(&arguments!["info", folder.path().join("nowhere.gs4d"), "--json"]);
    run.must_fail("nowhere.gs4d: there is no such file or folder");
    let document: Value = serde_json::from_str(&run.out).expect("one JSON document");
    let error = document["error"].as_str().expect("an error");
    assert!(error.contains("check the path") && !error.contains("os error"), "the same in JSON: {error}");
}

/// Runs the command while nobody reads its standard output. Returns exit code and standard error.
fn unread(arguments: &[OsString]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gs4d"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("the command ends");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_reader_that_ends_early_is_not_told_of() {
    let folder = folder();
    let path = scene(&folder, "300");
    let quiet = |code: i32| (Some(code), String::new());
    assert_eq!(unread(&arguments!["info", &path]), quiet(0), "text");
    assert_eq!(unread(&arguments!["info", &path, "--json"]), quiet(0), "JSON");
    assert_eq!(unread(&arguments!["info", "--help"]), quiet(0), "help");
    if cfg!(target_os = "linux") {
        assert_eq!(unread(&arguments!["convert", &path, "/dev/stdout"]), quiet(2), "a package that nobody has read");
    }
}
