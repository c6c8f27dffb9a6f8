//! How signals end the command: at random moments of work on the GPU, while a pipe without a reader is written, while a
//! bake writes its outputs.
//!
//! In: a small synthetic scene, its own pictures as a dataset, verbs that get INT, TERM or HUP. Out: proof that a run
//! ends with 130, 143, 129 or its own code, without a crash, that no temporary or half-written file is left, and that
//! `--json` says what exists. Work on the GPU is skipped where there is none.
//!
//! `GS4D_SIGNALS` is the number of runs at random moments, over all verbs: 10 unless `.ci/full` sets more. `GS4D_SEED`
//! is the seed of the moments: several processes can share the runs.

use crate::support::capture::Capture;
use crate::support::command::{GS4D, Run, arguments, folder, gs4d, has_gpu, scene};
use crate::support::folders::{contents, names};
use crate::support::random::Random;
use crate::support::small_capture::small_capture;
use bevy_gs4d::codec::package;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Cursor, Read};
use std::os::unix::fs::symlink;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Runs at random moments if `GS4D_SIGNALS` is not set.
const SIGNALS: usize = 10;
/// Longest time that a run may take to end after a signal. It is long because the machine may be busy.
const SOON: Duration = Duration::from_secs(60);
/// Longest time for a command to open a pipe or fill it.
const BLOCKED: Duration = Duration::from_millis(1500);

/// Name and exit code of each signal.
const KINDS: [(&str, i32); 2] = [("INT", 130), ("TERM", 143)];

/// Sends a signal. The process may have ended.
fn send(child: &Child, name: &str) {
    let sent = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).stderr(Stdio::null()).status();
    sent.expect("kill can be started");
}

/// Waits until a process ends, for a limited time.
fn end_of(child: &mut Child, context: &str) -> ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("the child can be waited for") {
            return status;
        }
        if start.elapsed() > SOON {
            child.kill().expect("the child can be killed");
            child.wait().expect("the child can be waited for");
            panic!("{context}: the command ends after a signal, not only after {SOON:?}");
        }
        thread::sleep(Duration::from_millis(1));
    }
}

/// Returns the exit code as a shell says it.
fn code_of(status: ExitStatus) -> Option<i32> {
    status.code().or(status.signal().map(|signal| 128 + signal))
}

fn read(pipe: &mut Option<impl Read>) -> String {
    let mut text = String::new();
    pipe.as_mut().expect("the output is a pipe").read_to_string(&mut text).expect("the output is text");
    text
}

fn started(command: &[OsString]) -> Child {
    let mut child = Command::new(GS4D);
    child.args(command).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    child.spawn().expect("the command starts")
}

fn capture() -> Capture {
    small_capture(300, 3)
}

/// Makes a pipe that has a name.
fn fifo(path: &Path) {
    let made = Command::new("mkfifo").arg(path).status().expect("mkfifo can be started");
    assert!(made.success(), "{} can be made", path.display());
}

/// Returns verbs that work on the GPU and write to `out`.
fn verbs(capture: &Capture, out: &Path) -> Vec<Vec<OsString>> {
    let (scene, data, package) = (&capture.scene, &capture.data, out.join("out.gs4d"));
    let training = arguments!["--steps", "30"].to_vec();
    let bake = arguments!["bake", scene, "--data", data, "-o", &package, "--ratio", "0.5", "--variant", "energy"];
    let tune =
        arguments!["finetune", scene, "--data", data, "-o", &package, "--evaluate-every", "5", "--save-every", "5"];
    let detail = arguments![
        "detail",
        scene,
        "--data",
        data,
        "-o",
        &package,
        "--levels",
        "1",
        "--directions",
        "2",
        "--times",
        "1"
    ];
    vec![
        arguments!["render", scene, "--orbit", "12", "--size", "160x120", "--raw", "--out", out].to_vec(),
        arguments!["bench", scene, "--orbit", "4", "--size", "160x120", "--frames", "20"].to_vec(),
        arguments!["score", scene, "--data", data, "--engine", "gpu", "--variant", "all", "--out", out].to_vec(),
        [bake.to_vec(), arguments!["--engine", "gpu", "--rounds", "2"].to_vec(), training.clone()].concat(),
        [tune.to_vec(), training].concat(),
        [detail.to_vec(), arguments!["--steps", "5"].to_vec()].concat(),
    ]
}

/// Returns whether an output is complete.
fn is_whole(path: &Path, bytes: &[u8]) -> bool {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("gs4d") => package::read(Cursor::new(bytes)).is_ok(),
        Some("png") => image::load_from_memory(bytes).is_ok(),
        Some("json") => serde_json::from_slice::<Value>(bytes).is_ok(),
        Some("html") => bytes.ends_with(b"</html>\n"),
        Some("f32") if path.to_string_lossy().contains("orbit") => bytes.len() == 160 * 120 * 12,
        Some("f32") => bytes.len() == 300 * 4,
        _ => false,
    }
}

/// Returns whether a file is in a folder of intermediate results.
fn is_stored(path: &Path) -> bool {
    path.ancestors().skip(1).any(|folder| folder.extension().is_some_and(|end| end == "bake" || end == "tune"))
}

/// Checks the files that a run has left, and the document that it has printed if a signal ended it.
fn check(out: &Path, document: Option<&Value>, context: &str) {
    let files: BTreeMap<PathBuf, Vec<u8>> = contents(out);
    let mut outputs = BTreeSet::new();
    for (path, bytes) in &files {
        let shown = path.display();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        assert!(!name.ends_with(".part") && name != "lock", "{context}: {shown} is left");
        if !is_stored(path) {
            assert!(is_whole(path, bytes), "{context}: {shown} is complete, {} bytes", bytes.len());
            outputs.insert(path.clone());
        }
    }
    let Some(document) = document else { return };
    assert_eq!(document["interrupted"], true, "{context}: the document says so: {document}");
    if document["error"].is_null() {
        // Fine-tuning has ended with the best result so far.
        let written = document["out"].as_str().map(Path::new);
        assert!(written.is_some_and(|path| outputs.contains(path)), "{context}: the result exists: {document}");
        return;
    }
    let written = document["written"].as_array().into_iter().flatten();
    let written: BTreeSet<PathBuf> = written.map(|path| PathBuf::from(path.as_str().unwrap_or_default())).collect();
    assert_eq!(written, outputs, "{context}: the document lists what exists");
    let stored = files.keys().any(|path| is_stored(path));
    assert_eq!(document["resumes"], stored, "{context}: the document says whether there are intermediate results");
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn random_signals_end_work_on_the_gpu_without_a_crash() {
    if !has_gpu() {
        return;
    }
    let wanted = std::env::var("GS4D_SIGNALS").ok();
    let runs = wanted.map_or(SIGNALS, |wanted| wanted.parse().expect("GS4D_SIGNALS is a number"));
    let seed = std::env::var("GS4D_SEED").map_or(5, |seed| seed.parse().expect("GS4D_SEED is a number"));
    let (capture, mut random) = (capture(), Random::new(seed));
    let outs: Vec<TempDir> = verbs(&capture, Path::new("out")).iter().map(|_| folder()).collect();
    let longest: Vec<Duration> = outs
        .iter()
        .enumerate()
        .map(|(index, out)| {
            let start = Instant::now();
            gs4d(&verbs(&capture, out.path())[index]).text();
            start.elapsed()
        })
        .collect();
    let mut ends: BTreeMap<String, usize> = BTreeMap::new();
    for run in 0..runs {
        let index = run % outs.len();
        let out = folder();
        let command = [verbs(&capture, out.path())[index].clone(), arguments!["--json"].to_vec()].concat();
        let (name, code) = KINDS[random.below(2)];
        let moment = longest[index].mul_f64(random.below(1000) as f64 / 1000.0);
        let second = (random.below(4) == 0).then(|| Duration::from_millis(random.below(100) as u64));
        let verb = command[0].to_string_lossy().into_owned();
        let context = format!("{verb}, run {run}, {name} after {moment:?}, then {second:?}");
        let mut child = started(&command);
        thread::sleep(moment);
        send(&child, name);
        if let Some(second) = second {
            thread::sleep(second);
            send(&child, name);
        }
        let status = end_of(&mut child, &context);
        let (printed, err) = (read(&mut child.stdout), read(&mut child.stderr));
        let found = code_of(status);
        assert!(found == Some(0) || found == Some(code), "{context}: ends with 0 or {code}, not {status}: {err}");
        // A signal before the handler is set ends the process with its default action.
        let early = if status.code().is_some() { "" } else { ", before the handler is set" };
        *ends.entry(format!("{verb} {}{early}", found.unwrap_or_default())).or_default() += 1;
        let document = status.code().map(|_| {
            let document = serde_json::from_str::<Value>(&printed);
            document.unwrap_or_else(|error| panic!("{context}: exactly one JSON document: {error}: {printed}"))
        });
        check(out.path(), document.as_ref().filter(|_| status.code() != Some(0)), &context);
    }
    println!("{runs} runs: {ends:?}");
    let ended: usize = ends.iter().filter(|(end, _)| !end.ends_with(" 0")).map(|(_, count)| count).sum();
    assert!(runs == 0 || ended > 0, "signals end some of the runs: {ends:?}");
}

#[test]
fn a_pipe_without_a_reader_does_not_delay_the_end() {
    let inputs = folder();
    let input = scene(&inputs, "5000");
    for (name, code) in KINDS {
        for is_open in [false, true] {
            let context = format!("{name}, the pipe is {}", if is_open { "full" } else { "not open" });
            let out = folder();
            let pipe = out.path().join("out.gs4d");
            fifo(&pipe);
            // It is open for reading, but nothing is read: more than it holds cannot be written.
            let _open = is_open.then(|| File::options().read(true).write(true).open(&pipe).expect("the pipe exists"));
            let mut child = started(&arguments!["convert", &input, &pipe, "--level", "1", "--json"]);
            thread::sleep(BLOCKED);
            assert!(child.try_wait().expect("it can be waited for").is_none(), "{context}: the command waits");
            send(&child, name);
            let start = Instant::now();
            let status = end_of(&mut child, &context);
            println!("{context}: ended after {:?}", start.elapsed());
            assert_eq!(status.code(), Some(code), "{context}: {}", read(&mut child.stderr));
            let document: Value = serde_json::from_str(&read(&mut child.stdout)).expect("exactly one JSON document");
            assert_eq!(document["interrupted"], true, "{context}: the document says so: {document}");
            assert_eq!(names(out.path()), ["out.gs4d"], "{context}: only the pipe is left");
        }
    }
}

/// Linux says which signals are ignored.
#[cfg(target_os = "linux")]
#[test]
fn the_loss_of_the_terminal_is_ignored_under_nohup() {
    let inputs = folder();
    let input = scene(&inputs, "5000");
    for (shell, ignores) in [("exec \"$0\" \"$@\"", false), ("trap '' HUP; exec \"$0\" \"$@\"", true)] {
        let out = folder();
        let pipe = out.path().join("out.gs4d");
        fifo(&pipe);
        let mut command = Command::new("sh");
        command.args(["-c", shell, GS4D]).args(arguments!["convert", &input, &pipe, "--level", "1"]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the shell starts");
        thread::sleep(BLOCKED);
        send(&child, "HUP");
        if ignores {
            thread::sleep(BLOCKED);
            assert!(child.try_wait().expect("it can be waited for").is_none(), "the command goes on");
            send(&child, "TERM");
        }
        let code = if ignores { 143 } else { 129 };
        assert_eq!(end_of(&mut child, shell).code(), Some(code), "the code after the signal that ends it: {shell}");
    }
}

#[test]
fn a_full_standard_output_does_not_delay_the_end() {
    let inputs = folder();
    let input = scene(&inputs, "50");
    let path = inputs.path().join("pipe");
    fifo(&path);
    let pipe = File::options().read(true).write(true).open(&path).expect("the pipe exists");
    let copy = || Stdio::from(pipe.try_clone().expect("the pipe is open"));
    let mut filling = Command::new("yes").stdout(copy()).spawn().expect("yes can be started");
    thread::sleep(BLOCKED);
    for (name, code) in KINDS {
        let command = arguments!["info", &input];
        let mut child = Command::new(GS4D).args(command).stdout(copy()).spawn().expect("the command starts");
        thread::sleep(BLOCKED);
        let waits = child.try_wait().expect("the child can be waited for").is_none();
        send(&child, name);
        let status = end_of(&mut child, name);
        if !waits || status.code() != Some(code) {
            filling.kill().expect("the child can be killed");
            panic!("{name}: the command waits for the pipe and ends with {code}: {status}");
        }
    }
    filling.kill().expect("the child can be killed");
    filling.wait().expect("the child can be waited for");
}

#[test]
fn pictures_into_a_pipe_without_a_reader_do_not_delay_the_end() {
    if !has_gpu() {
        return;
    }
    let (inputs, out) = (folder(), folder());
    let input = scene(&inputs, "50");
    let pipe = out.path().join("orbit_0000.f32");
    fifo(&pipe);
    let command =
        arguments!["render", input, "--orbit", "2", "--size", "32x32", "--raw", "--json", "--out", out.path()];
    let mut child = started(&command);
    let second = out.path().join("orbit_0001.f32");
    let start = Instant::now();
    while !second.exists() && start.elapsed() < SOON {
        thread::sleep(Duration::from_millis(10));
    }
    send(&child, "TERM");
    let status = end_of(&mut child, "render");
    assert_eq!(status.code(), Some(143), "it is terminated: {}", read(&mut child.stderr));
    let document: Value = serde_json::from_str(&read(&mut child.stdout)).expect("exactly one JSON document");
    let written = [&out.path().join("orbit_0000.png"), &out.path().join("orbit_0001.png"), &second];
    let written: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    let listed: BTreeSet<String> = document["written"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|path| Some(path.as_str()?.to_owned()))
        .collect();
    assert_eq!(listed, written.into_iter().collect(), "the pictures that are complete are listed: {document}");
}

#[test]
fn fine_tuning_ends_with_a_result_and_a_second_signal_ends_it_at_once() {
    if !has_gpu() {
        return;
    }
    let capture = capture();
    let out = capture.path("out.gs4d");
    let command = arguments![
        "finetune",
        &capture.scene,
        "--data",
        &capture.data,
        "-o",
        &out,
        "--steps",
        "1000000",
        "--evaluate-every",
        "5",
        "--json"
    ];
    for (name, code) in KINDS {
        let mut child = started(&command);
        // Evaluations are noted.
        let mut errors = BufReader::new(child.stderr.take().expect("the errors are a pipe"));
        let mut line = String::new();
        while !line.contains("step") {
            line.clear();
            assert!(errors.read_line(&mut line).expect("the errors are text") > 0, "{name}: training begins");
        }
        send(&child, name);
        let mut rest = String::new();
        let reading = thread::spawn(move || errors.read_to_string(&mut rest).map(|_| rest));
        let status = end_of(&mut child, name);
        let rest = reading.join().expect("no panic").expect("the errors are text");
        assert_eq!(status.code(), Some(code), "{name}: the exit code is that of the signal: {rest}");
        let document: Value = serde_json::from_str(&read(&mut child.stdout)).expect("exactly one JSON document");
        assert_eq!(document["interrupted"], true, "{name}: the document says so: {document}");
        assert!(is_whole(&out, &fs::read(&out).expect("the best result is written")), "{name}: the result is complete");
        fs::remove_file(&out).expect("the file exists");
    }
    let mut child = started(&command);
    thread::sleep(BLOCKED);
    send(&child, "INT");
    send(&child, "TERM");
    let status = end_of(&mut child, "two signals");
    assert!(matches!(status.code(), Some(130 | 143)), "two signals: {status} {}", read(&mut child.stderr));
    serde_json::from_str::<Value>(&read(&mut child.stdout)).expect("exactly one JSON document");
}

#[test]
fn a_bake_that_cannot_write_its_report_leaves_the_previous_package() {
    let capture = capture();
    let [out, page, kept] = ["out.gs4d", "out.report.html", "page.html"].map(|name| capture.path(name));
    let bake = |ratio: &str| {
        let own = arguments!["--variant", "energy", "--ratio", ratio, "--engine", "cpu", "-o", &out];
        [arguments!["bake", &capture.scene, "--data", &capture.data].to_vec(), own.to_vec()].concat()
    };
    gs4d(&bake("0.5")).text();
    fs::rename(&page, &kept).expect("the file exists");
    symlink("/dev/full", &page).expect("the folder can be written to");
    let previous = ["out.gs4d", "out.report.json"].map(|name| fs::read(capture.path(name)).expect("the file exists"));
    let run = Run::of(&Command::new(GS4D).args(bake("0.75")).output().expect("the command starts"));
    run.must_fail("out.report.html");
    let now = ["out.gs4d", "out.report.json"].map(|name| fs::read(capture.path(name)).expect("the file exists"));
    assert!(now == previous, "the previous package and its report are unchanged");
    fs::remove_file(&page).expect("the file exists");
    gs4d(&bake("0.75")).text();
    let package = fs::read(&out).expect("the file exists");
    let report = fs::read(capture.path("out.report.json")).expect("the file exists");
    let report: Value = serde_json::from_slice(&report).expect("the report is JSON");
    assert!(package != previous[0], "another ratio makes another package");
    assert_eq!(report["bytes"]["after"], package.len(), "the report is that of the package");
    assert!(page.is_file(), "the page is written");
}
