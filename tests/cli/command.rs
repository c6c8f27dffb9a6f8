//! The `gs4d` command, run as a user runs it: inspecting captures, converting them, all errors of a command line,
//! closed pipes.
//!
//! In: command lines, intact and damaged files. Out: proof that exit codes, reports and written files are right, and
//! that no command panics.

use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::package_parts::Parts;
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn conversion_changes_only_what_its_options_name() {
    let folder = folder();
    let trained = scene(&folder, "700");
    let info = gs4d(&arguments!["info", &trained, "--json"]).json();
    assert_eq!(info["gaussians"], 700, "the requested count");
    assert_eq!(
        (&info["form"], &info["degree"], &info["degree_t"]),
        (&"trained".into(), &3.into(), &2.into()),
        "trained"
    );

    let copy = folder.path().join("copy.gs4d");
    gs4d(&arguments!["convert", &trained, &copy]).text();
    let bytes = |path: &Path| fs::read(path).expect("the package exists");
    assert_eq!(bytes(&trained), bytes(&copy), "a conversion without options copies the package");

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
    assert_eq!(converted["bytes_out"], bytes(&small).len(), "the printed size");
    let info = gs4d(&arguments!["info", &small, "--json"]).json();
    assert_eq!(
        (&info["form"], &info["degree"], &info["coefficients"]),
        (&"runtime".into(), &0.into(), &1.into()),
        "the converted package"
    );
    assert_eq!(info["switches"]["playback"]["up"], "neg_y", "the axis is stored");
    assert_eq!(info["switches"]["trained_with"]["background"][1], 0.5, "the background is stored");
    assert_eq!(info["package"]["intact"], true, "checksums are right");

    let back = folder.path().join("back.gs4d");
    gs4d(&arguments!["convert", &small, &back, "--form", "trained"]).must_fail("small.gs4d");
    assert!(!back.exists(), "no output is written");
}

#[test]
fn coded_colors_are_described_and_lowered() {
    let folder = folder();
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/toybox.gs4d");
    let info = gs4d(&arguments!["info", &demo, "--json"]).json();
    let figures = |info: &Value| [&info["degree"], &info["degree_t"], &info["coefficients"]].map(Value::clone);
    assert_eq!(figures(&info), [3, 2, 48].map(Value::from), "the degrees of the bundled capture");
    assert_eq!(info["codebooks"], Value::from(vec![1024; 4]), "the codebooks of the bundled capture");
    let text = gs4d(&arguments!["info", &demo]).text();
    assert!(
        text.contains("degree 3, time degree 2, 48 coefficients, coded by 4 codebooks"),
        "the text has the degrees: {text}"
    );

    let [coded, plain] = ["coded.gs4d", "plain.gs4d"].map(|name| folder.path().join(name));
    gs4d(&arguments!["compress", scene(&folder, "300"), &coded, "--codebooks", "16,16", "--verify", "0"]).text();
    gs4d(&arguments!["convert", &coded, &plain, "--sh-degree", "0"]).text();
    let info = gs4d(&arguments!["info", &plain, "--json"]).json();
    assert_eq!(figures(&info), [0, 0, 1].map(Value::from), "the requested degree");
    assert_eq!(info["form"], "packed", "the form is unchanged");
    let bytes = |path: &Path| fs::metadata(path).expect("the package exists").len();
    assert!(bytes(&plain) < bytes(&coded), "without codebooks it is smaller");
}

#[test]
fn a_duration_of_zero_is_stored() {
    let folder = folder();
    let (moving, still) = (scene(&folder, "50"), folder.path().join("still.gs4d"));
    gs4d(&arguments!["convert", &moving, &still, "--duration", "0"]).text();
    let info = gs4d(&arguments!["info", &still, "--json"]).json();
    assert_eq!(info["switches"]["playback"]["duration_seconds"], 0.0, "the duration is stored and read again");
    gs4d(&arguments!["convert", &moving, &still, "--duration=-1"]).must_fail("--duration");
}

#[test]
fn sections_of_one_name_are_listed_once() {
    let folder = folder();
    let path = scene(&folder, "50");
    let mut parts = Parts::of(&fs::read(&path).expect("the package exists"));
    // Two repeated names, and many unique names; sections of unknown names may have any length.
    let names = (0..20_000).flat_map(|i| ["even".to_owned(), "odd".to_owned(), format!("x{i}")]);
    let rest = "encoding: \"y\", first: 0, count: 0, length: 0, raw_length: 18446744073709551615, crc32: 0";
    let entries: String = names.map(|name| format!("(name: \"{name}\", {rest}),\n")).collect();
    parts.bodies.splice(0..0, vec![Vec::new(); 60_000]);
    let parts = parts.swap("sections: [\n", &format!("sections: [\n{entries}"));
    fs::write(&path, parts.seal()).expect("the folder can be written to");
    let start = Instant::now();
    let text = gs4d(&arguments!["info", &path]).text();
    // Comparing every pair of names would take minutes.
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
    let rows = |start: &str| text.lines().filter(|line| line.starts_with(start)).count();
    assert_eq!((rows("even "), rows("odd "), rows("x")), (1, 1, 20_000), "one row for each name");
    let even = text.lines().find(|line| line.starts_with("even ")).expect("a row");
    assert!(
        even.split_whitespace().eq(["even", "20000", "0", "18446744073709551615", "hold"]),
        "the row sums all sections of the name: {even}"
    );
    assert!(text.contains("sh_rest"), "known sections are listed: {text}");
}

#[test]
fn control_characters_of_a_file_are_escaped() {
    let folder = folder();
    let path = scene(&folder, "50");
    let parts = Parts::of(&fs::read(&path).expect("the package exists"));
    let name = r#""\u{1b}[2J\u{9b}1m\nerror: fake""#;
    let section = format!("(name: {name}, encoding: \"y\", first: 0, count: 0, length: 0, raw_length: 0, crc32: 0)");
    let mut unknown = parts.clone().swap("sections: [\n", &format!("sections: [\n{section},\n"));
    unknown.bodies.insert(0, Vec::new());
    let required = parts.swap("requires: []", &format!("requires: [{name}]"));
    let is_plain = |text: &str| text.chars().all(|c| c == '\n' || !c.is_control());
    for (parts, code) in [(unknown, 0), (required, 2)] {
        fs::write(&path, parts.seal()).expect("the folder can be written to");
        for options in [&[][..], &["--json"]] {
            let arguments = [arguments!["info", &path].to_vec(), options.iter().map(Into::into).collect()].concat();
            let run = gs4d(&arguments);
            assert_eq!(run.code, Some(code), "{options:?}: {}", run.err);
            assert!(is_plain(&run.out) && is_plain(&run.err), "{options:?}: {:?} {:?}", run.out, run.err);
            let is_fake = |line: &str| line.starts_with("error: fake");
            assert!(
                !run.out.lines().chain(run.err.lines()).any(is_fake),
                "{options:?}: the name does not make a separate line"
            );
            assert!((run.out + &run.err).contains("[2J"), "{options:?}: the name is shown");
        }
    }
}

#[test]
fn training_options_are_refused_for_a_package() {
    let folder = folder();
    let path = scene(&folder, "50");
    gs4d(&arguments!["info", &path, "--time-interval", "0,10"]).must_fail("--time-interval");
    gs4d(&arguments!["info", &path, "--time-interval", "0,1"]).text();
}

#[test]
fn options_without_a_measured_benefit_are_listed_as_experimental() {
    let help = gs4d(&["finetune", "--help"]).text();
    let (_, part) = help.split_once("\nExperimental:\n").expect("the heading");
    let lines = part.lines().take_while(|line| line.is_empty() || line.starts_with(' '));
    let options = lines.filter_map(|line| line.trim_start().strip_prefix("--"));
    let found: Vec<&str> = options.filter_map(|option| option.split_whitespace().next()).collect();
    let expected = ["opacity-weight", "mask-weight", "motion-weight", "rigid-weight", "round-geometry"];
    assert_eq!(found, expected, "the experimental options of finetune");
    assert!(!gs4d(&["bake", "--help"]).text().contains("\nExperimental:\n"), "bake has none");
}

#[test]
fn reports_are_text_without_json() {
    const VERBS: [&str; 20] = [
        "info", "convert", "export", "render", "compare", "synth", "bench", "score", "prune", "mask", "eval", "ablate",
        "bake", "detail", "join", "split", "edit", "socket", "collide", "sound",
    ];
    let folder = folder();
    let path = scene(&folder, "50");
    let text = gs4d(&arguments!["info", &path]).text();
    for expected in ["Gaussians", "time interval", "bounds", "sh_rest", "hold"] {
        assert!(text.contains(expected), "{expected} in {text}");
    }
    for verb in VERBS {
        assert!(gs4d(&[verb, "--help"]).text().contains("Examples:"), "{verb} --help has examples");
    }
}

#[test]
fn damaged_files_are_named() {
    let folder = folder();
    let good = fs::read(scene(&folder, "300")).expect("the package exists");
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
        assert!(!out.exists(), "{name}: no output is written");
        let json = gs4d(&arguments!["info", &path, "--json"]);
        let document: Value = serde_json::from_str(&json.out).expect("one JSON document for a failure");
        assert!(document["error"].as_str().is_some_and(|error| error.contains(name)), "{name} in {document}");
    }
}

#[test]
fn bad_paths_are_named() {
    let folder = folder();
    let path = scene(&folder, "50");
    let before = fs::read(&path).expect("the package exists");
    let nowhere = folder.path().join("nowhere.pth");
    gs4d(&arguments!["info", &nowhere]).must_fail("nowhere.pth");
    gs4d(&arguments!["convert", &path, &path]).must_fail("scene.gs4d");
    let roundabout = folder.path().join(".").join("scene.gs4d");
    gs4d(&arguments!["convert", &path, &roundabout]).must_fail("scene.gs4d");
    assert_eq!(fs::read(&path).expect("the file still exists"), before, "the input is unchanged");

    let inside_a_file = path.join("out.gs4d");
    gs4d(&arguments!["convert", &path, &inside_a_file]).must_fail("out.gs4d");
    gs4d(&arguments!["synth", &inside_a_file]).must_fail("out.gs4d");
    gs4d(&arguments!["render", &path, "--cameras", "gone.json", "--out", "frames"]).must_fail("gone.json");
    gs4d(&arguments!["convert", &path, &nowhere]).must_fail("nowhere.pth");
    gs4d(&arguments!["compare", &path, folder.path()]).must_fail("scene.gs4d");
    let left = fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(left, 1, "no other file is left");
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
    assert_eq!(made["gaussians"], 60, "three parts for each Gaussian");
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
fn errors_of_usage_are_json_with_the_option() {
    for (arguments, name) in [
        (&["info", "--json"][..], "FILE"),
        (&["frobnicate", "--json"], "frobnicate"),
        (&["--json", "synth", "x.gs4d", "--count", "0"], "--count"),
        (&["compress", "x.gs4d", "y.gs4d", "--data", "z", "--json"], "--data"),
    ] {
        let run = gs4d(arguments);
        run.must_fail(name);
        let document: Value = serde_json::from_str(&run.out).expect("one JSON document for an error of usage");
        let error = document["error"].as_str().expect("an error");
        assert!(
            error.contains(name) && !error.contains("Usage") && !error.contains('\n'),
            "{name} without the usage: {error}"
        );
    }
    let text = gs4d(&["info"]);
    text.must_fail("FILE");
    assert!(text.out.is_empty() && text.err.contains("Usage: gs4d info"), "the text has the usage: {}", text.err);
    let help = gs4d(&["info", "--help", "--json"]).text();
    assert!(help.contains("Examples:"), "help is printed");
}

#[test]
fn errors_of_the_system_are_described_with_a_remedy() {
    let folder = folder();
    let run = gs4d(&arguments!["info", folder.path().join("nowhere.gs4d"), "--json"]);
    run.must_fail("nowhere.gs4d: there is no such file or folder");
    let document: Value = serde_json::from_str(&run.out).expect("one JSON document");
    let error = document["error"].as_str().expect("an error");
    assert!(error.contains("check the path") && !error.contains("os error"), "the same in JSON: {error}");
}

/// Runs the command with its standard output closed at the other end. Returns exit code and standard error.
fn unread(arguments: &[OsString]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gs4d"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("the command ends");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn closed_pipes_are_not_an_error_of_reports() {
    let folder = folder();
    let path = scene(&folder, "300");
    let quiet = |code: i32| (Some(code), String::new());
    assert_eq!(unread(&arguments!["info", &path]), quiet(0), "text");
    assert_eq!(unread(&arguments!["info", &path, "--json"]), quiet(0), "JSON");
    assert_eq!(unread(&arguments!["info", "--help"]), quiet(0), "help");
    if cfg!(target_os = "linux") {
        assert_eq!(
            unread(&arguments!["convert", &path, "/dev/stdout"]),
            quiet(2),
            "a package written to a closed pipe"
        );
    }
}
