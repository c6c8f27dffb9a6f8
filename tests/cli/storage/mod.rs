//! URLs in place of files, run as a user runs them.
//!
//! In: an S3 server on loopback with small captures, and faults of the network. Out: proof that verbs read and write URLs as they do files, that
//! what has not changed is not fetched again, that single faults are survived and lasting ones reported in a sentence, a server that is lost at any
//! request or hangs as well, and that no output is lost.

mod server;

use crate::support::capture::Capture;
use crate::support::command::{GS4D, Run, arguments, folder, gs4d, scene};
use crate::support::folders::contents;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use serde_json::Value;
use server::{Fault, Server};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// Runs the command with a cache of its own and the store of a server.
fn run(server: &Server, cache: &TempDir, arguments: &[OsString]) -> Run {
    Run::of(&command(server, cache, arguments).output().expect("the command starts"))
}

fn command(server: &Server, cache: &TempDir, arguments: &[OsString]) -> Command {
    let mut command = Command::new(GS4D);
    command.args(arguments).env("GS4D_CACHE", cache.path()).env("AWS_ENDPOINT", format!("http://{}", server.address));
    let variables =
        [("ACCESS_KEY_ID", "id"), ("SECRET_ACCESS_KEY", "key"), ("ALLOW_HTTP", "true"), ("REGION", "us-east-1")];
    command.envs(variables.map(|(name, value)| (format!("AWS_{name}"), value)));
    command
}

/// Checks that a run failed with one sentence about a URL.
fn check_sentence(run: &Run, url: &str) {
    run.must_fail(&format!("{url}: "));
    let sentences: Vec<&str> = run.err.lines().filter(|line| line.starts_with("error:")).collect();
    assert_eq!(sentences.len(), 1, "one line: {}", run.err);
}

/// Checks that a complete output is kept on this machine, and no part of a file.
fn check_kept(cache: &TempDir, expected: &[u8]) {
    let kept = contents(&cache.path().join("outputs"));
    assert!(kept.values().any(|bytes| bytes == expected), "the output is kept, complete: {:?}", kept.keys());
    let all = contents(cache.path());
    assert!(all.keys().all(|path| path.extension().is_none_or(|e| e != "part")), "no temporary file: {:?}", all.keys());
}

fn read(path: &Path) -> Vec<u8> {
    fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns the names whose bytes were requested.
fn fetched(server: &Server) -> Vec<String> {
    let seen = server.seen().into_iter().filter(|seen| seen.method == "GET" && !seen.path.contains('?'));
    seen.map(|seen| seen.path).collect()
}

#[test]
fn verbs_read_and_write_urls_as_they_do_files() {
    let Some(server) = Server::start() else { return };
    let (folder, cache) = (folder(), folder());
    let input = scene(&folder, "60");
    server.put("in.gs4d", &read(&input));
    let convert =
        arguments!["convert", "s3://bucket/in.gs4d", "-o", "s3://bucket/out/a.gs4d", "--form", "runtime", "--json"];
    let report = run(&server, &cache, &convert).json();
    assert_eq!(
        (&report["in"], &report["out"]),
        (&"s3://bucket/in.gs4d".into(), &"s3://bucket/out/a.gs4d".into()),
        "names"
    );
    let local = folder.path().join("local.gs4d");
    gs4d(&arguments!["convert", &input, &local, "--form", "runtime"]).text();
    assert_eq!(server.get("out/a.gs4d"), Some(read(&local)), "the bytes that are written to a disk");

    run(&server, &cache, &convert).json();
    assert_eq!(fetched(&server), [""; 0], "an input that has not changed is not fetched again");
    let other = arguments!["synth", folder.path().join("other.gs4d"), "--count", "70"];
    gs4d(&other).text();
    server.put("in.gs4d", &read(&folder.path().join("other.gs4d")));
    assert_eq!(run(&server, &cache, &convert).json()["gaussians"], 70, "a changed input is");
    assert_eq!(fetched(&server), ["/bucket/in.gs4d"], "once");

    let over_http = format!("http://{}/bucket/in.gs4d", server.address);
    let info = run(&server, &cache, &arguments!["info", &over_http, "--json"]).json();
    assert_eq!((&info["file"], &info["gaussians"]), (&over_http.as_str().into(), &70.into()), "by HTTP");
    let by_path = format!("file://{}", input.display());
    assert_eq!(
        run(&server, &cache, &arguments!["info", &by_path, "--json"]).json()["gaussians"],
        60,
        "a file by its URL"
    );
}

#[test]
fn folders_are_read_and_written_whole() {
    let Some(server) = Server::start() else { return };
    let cache = folder();
    let trained = synthesize(&SynthSettings { count: 300, ..SynthSettings::default() });
    let capture = Capture::new(trained, Vec3::ZERO, 4, 4, UVec2::splat(32), true);
    for (path, bytes) in contents(&capture.data) {
        let name = path.strip_prefix(&capture.data).expect("a file of the folder").to_string_lossy().into_owned();
        server.put(&format!("data/{name}"), &bytes);
    }
    server.put("scene.gs4d", &read(&capture.scene));
    let bake = arguments!["bake", "s3://bucket/scene.gs4d", "--data=s3://bucket/data/", "-os3://bucket/baked/a.gs4d"];
    let more = arguments!["--ratio", "0.5", "--engine", "cpu", "--json"];
    let report = run(&server, &cache, &[bake.to_vec(), more.to_vec()].concat()).json();
    assert_eq!(report["gaussians"]["after"], 150, "the bake is done");
    let stored: Value =
        serde_json::from_slice(&server.get("baked/a.report.json").expect("the report is beside the package"))
            .expect("a JSON document");
    for (what, name) in [("checkpoint", "scene.gs4d"), ("data", "data"), ("package", "baked/a.gs4d")] {
        let url = stored[what].as_str().unwrap_or_default().trim_end_matches('/');
        assert_eq!(url, format!("s3://bucket/{name}"), "the report names the {what} by its URL");
    }
    assert!(server.get("baked/a.report.html").is_some(), "and the page, too");

    let fleet = arguments!["report", "s3://bucket/baked", "-o", "s3://bucket/all.html", "--json"];
    let fleet = run(&server, &cache, &fleet).json();
    assert_eq!(fleet["bakes"][0]["package"], "s3://bucket/baked/a.gs4d", "a folder of packages with their reports");
    assert!(fleet["bakes"][0]["measures"]["psnr"].is_number(), "the figures of the report: {}", fleet["bakes"]);
    let page = String::from_utf8(server.get("all.html").expect("the page is written")).expect("text");
    assert!(
        page.contains("href=\"baked/a.report.html\""),
        "links lead from the URL of the page to those of the reports"
    );

    let frames = arguments![
        "render",
        "s3://bucket/scene.gs4d",
        "--orbit",
        "2",
        "--size",
        "16x16",
        "--out",
        "s3://bucket/frames"
    ];
    run(&server, &cache, &frames).text();
    let outputs = fs::read_dir(cache.path().join("outputs")).expect("the folder of outputs").flatten();
    let left = outputs.filter(|entry| entry.path().is_dir()).count();
    assert_eq!(left, 0, "no copy of an uploaded output is left");
}

#[test]
fn single_faults_are_survived() {
    let Some(server) = Server::start() else { return };
    let (folder, cache) = (folder(), folder());
    let input = folder.path().join("large.gs4d");
    // More than three ranges, and more than is uploaded at once.
    gs4d(&arguments!["synth", &input, "--count", "70000", "--level", "1"]).text();
    let bytes = read(&input);
    assert!(bytes.len() > 33 << 20, "{} bytes are enough", bytes.len());
    server.put("large.gs4d", &bytes);
    server.inject("HEAD", "large.gs4d", Fault::Fails, 2);
    server.inject("GET", "large.gs4d", Fault::CutAfter(3 << 20), 2);
    server.inject("GET", "large.gs4d", Fault::Fails, 2);
    server.inject("GET", "large.gs4d", Fault::Dropped, 1);
    server.inject("PUT", "copy.gs4d", Fault::Fails, 2);
    server.inject("PUT", "copy.gs4d", Fault::Dropped, 1);
    let convert = arguments!["convert", "s3://bucket/large.gs4d", "s3://bucket/copy.gs4d", "--level", "1"];
    let run = run(&server, &cache, &convert);
    assert_eq!(run.code, Some(0), "the command succeeds: {}", run.err);
    let ranges = server.seen().into_iter().filter(|seen| seen.has_range).count();
    assert!(ranges > 5, "{ranges} ranges were requested");
    assert!(server.get("copy.gs4d") == Some(bytes), "the copy is complete");
}

#[test]
fn lasting_faults_are_reported_in_a_sentence_and_no_output_is_lost() {
    let Some(server) = Server::start() else { return };
    let (folder, cache) = (folder(), folder());
    let input = scene(&folder, "60");
    server.put("in.gs4d", &read(&input));
    server.put("out.gs4d", b"before");
    let convert = arguments!["convert", "s3://bucket/in.gs4d", "s3://bucket/out.gs4d"];
    let fails = |method, name: &str, fault, words: &[&str]| {
        server.inject(method, name, fault, 1000);
        let run = run(&server, &cache, &convert);
        check_sentence(&run, &format!("s3://bucket/{name}"));
        for words in words {
            assert!(run.err.contains(words), "{words:?} in {}", run.err);
        }
        server.clear();
    };
    fails("GET", "in.gs4d", Fault::CutAfter(700), &["run the command again"]);
    fails("PUT", "out.gs4d", Fault::Fails, &["check the network", "the output is complete in"]);
    assert_eq!(server.get("out.gs4d").as_deref(), Some(b"before".as_slice()), "the object is unchanged");
    check_kept(&cache, &read(&input));
}

#[test]
fn a_server_that_is_lost_at_any_request_is_named_and_nothing_is_lost() {
    let Some(server) = Server::start() else { return };
    let (folder, cache) = (folder(), folder());
    let (small, large) = (scene(&folder, "60"), folder.path().join("large.gs4d"));
    gs4d(&arguments!["synth", &large, "--count", "70000", "--level", "1"]).text();
    server.put("in.gs4d", &read(&small));
    server.put("out.gs4d", b"before");
    let convert = |input: &OsStr, more: &[&str]| {
        let fixed = arguments!["convert", input, "s3://bucket/out.gs4d"];
        fixed.into_iter().chain(more.iter().map(OsString::from)).collect::<Vec<_>>()
    };
    let by_url = convert("s3://bucket/in.gs4d".as_ref(), &[]);
    let by_path = convert(large.as_os_str(), &["--level", "1"]);
    // The properties of the input, its bytes, the output; an output in parts: its beginning, and its third part.
    let lost = [(&by_url, 0, "in.gs4d"), (&by_url, 1, "in.gs4d"), (&by_url, 2, "out.gs4d")];
    for (convert, requests, name) in lost.into_iter().chain([(&by_path, 0, "out.gs4d"), (&by_path, 3, "out.gs4d")]) {
        server.lose_after(requests);
        let run = run(&server, &cache, convert);
        server.clear();
        check_sentence(&run, &format!("s3://bucket/{name}"));
        assert_eq!(server.get("out.gs4d").as_deref(), Some(b"before".as_slice()), "lost after {requests} requests");
    }
    check_kept(&cache, &read(&large));
    for (convert, expected) in [(by_url, small), (by_path, large)] {
        run(&server, &cache, &convert).text();
        assert!(server.get("out.gs4d") == Some(read(&expected)), "the same command succeeds once the server is there");
    }
}

#[test]
fn a_server_that_does_not_answer_is_named_and_nothing_is_lost() {
    let Some(server) = Server::start() else { return };
    let (folder, cache) = (folder(), folder());
    let input = scene(&folder, "60");
    server.put("in.gs4d", &read(&input));
    server.put("out.gs4d", b"before");
    let convert = arguments!["convert", "s3://bucket/in.gs4d", "s3://bucket/out.gs4d"];
    for (method, name) in [("HEAD", "in.gs4d"), ("PUT", "out.gs4d")] {
        server.inject(method, name, Fault::Hangs, 1000);
        let mut command = command(&server, &cache, &convert);
        let run = Run::of(&command.env("AWS_TIMEOUT", "1s").output().expect("the command starts"));
        server.clear();
        check_sentence(&run, &format!("s3://bucket/{name}"));
        assert_eq!(server.get("out.gs4d").as_deref(), Some(b"before".as_slice()), "the object is unchanged");
    }
    check_kept(&cache, &read(&input));
}

#[test]
fn urls_without_a_file_are_refused() {
    let Some(server) = Server::start() else { return };
    let cache = folder();
    for (url, words) in [
        ("s3://bucket/missing.gs4d", "neither a file nor a folder of this name"),
        ("s3://nowhere/a.gs4d", "there is nothing of this name"),
        ("gs://bucket/a.gs4d", "not of a kind that is understood"),
        ("https://host/a.gs4d?key=1", "a ? or a #"),
    ] {
        let run = run(&server, &cache, &arguments!["info", url]);
        run.must_fail(&format!("{url}: "));
        assert!(run.err.contains(words), "{words:?} in {}", run.err);
    }
    let missing = format!("http://{}/bucket/missing.gs4d", server.address);
    run(&server, &cache, &arguments!["info", &missing]).must_fail("there is nothing of this name");
    let same = arguments!["convert", "s3://bucket/a.gs4d", "s3://bucket/a.gs4d"];
    run(&server, &cache, &same).must_fail("s3://bucket/a.gs4d: is an input and an output");
}
