//! `gs4d socket`, run as a user runs it.
//!
//! In: packages of a body that moves in a straight line, whose Gaussians succeed each other. Out: proof that a socket
//! follows the body and is stored, replaced, listed and removed, that the time at which it is lost is told, that points
//! are compared with their known tracks, and that points and names that cannot be used are refused.

use crate::support::command::{arguments, folder, gs4d};
use crate::support::folders::contents;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::offline::work::save;
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use glam::Vec3;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The velocity of the body, units per unit of time.
const VELOCITY: Vec3 = Vec3::new(1.0, -0.5, 0.25);

/// Writes a body of size 1 about the origin at time 0, of Gaussians whose own times are below `end`. Returns its path.
fn body(folder: &TempDir, name: &str, end: f32) -> PathBuf {
    let mut gaussians = Vec::new();
    for index in 0..400 {
        let part = |of: f32| 0.5 * (index as f32 * of).sin();
        let (place, phase) = (Vec3::new(part(1.3), part(2.7), part(4.9)), part(7.3) + 0.5);
        for generation in 0..14 {
            let mean_t = 0.1 * (generation as f32 + phase) - 0.2;
            let gaussian = Gaussian {
                mean: (place + VELOCITY * mean_t).to_array(),
                mean_t,
                velocity: VELOCITY.to_array(),
                sigma_t: 0.08,
                covariance: [1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3],
                opacity: 0.8,
                padding: 0.0,
            };
            gaussians.extend((mean_t < end).then_some(gaussian));
        }
    }
    let harmonics = Harmonics { coefficients: 1, values: vec![0.0; 3 * gaussians.len()], ..Harmonics::default() };
    let path = folder.path().join(name);
    let scene = GaussianScene::from(RuntimeScene::sliced(gaussians, harmonics));
    save(&path, &scene, &WriteSettings::default()).expect("the folder can be written to");
    path
}

fn read(path: &Path) -> GaussianScene {
    codec::load(path, &ReadOptions::default()).expect("the package can be read")
}

#[test]
fn a_socket_follows_its_part_and_is_stored() {
    let folder = folder();
    let (scene, out) = (body(&folder, "scene.gs4d", f32::INFINITY), folder.path().join("hand.gs4d"));
    let start = Vec3::new(0.1, 0.2, 0.0) + VELOCITY * 0.4;
    let at = format!("{},{},{}", start.x, start.y, start.z);
    let place = arguments!["socket", &scene, "--name", "hand", "--at", &at, "--time", "0.4", "-o", &out, "--json"];
    let report = gs4d(&place).json();
    let followed = &report["followed"];
    assert_eq!((&followed["lost_before"], &followed["lost_after"]), (&().into(), &().into()), "never lost: {report}");
    assert_eq!(report["out"], out.display().to_string(), "the package: {report}");
    let size = followed["size"].as_f64().expect("a size");
    for key in ["return_of_before", "return_of_after"] {
        let back = followed[key].as_f64().expect("a way back");
        assert!(back < 0.01 * size, "{key}: {back} of {size}");
    }
    let (before, after) = (read(&scene), read(&out));
    assert_eq!(before.form, after.form, "the Gaussians are unchanged");
    let [socket] = after.sockets.as_slice() else { panic!("one socket, not {:?}", after.sockets) };
    assert_eq!((socket.name.as_str(), socket.reach()), ("hand", Some([0.0, 1.0])), "over the whole time");
    for sample in &socket.samples {
        let off = Vec3::from(sample.position).distance(start + VELOCITY * (sample.time - 0.4));
        assert!(f64::from(off) < 0.01 * size, "{off} off at {}", sample.time);
    }

    let text = gs4d(&arguments!["socket", &out, "--list"]).text();
    assert!(text.contains("hand") && !text.contains("wrote"), "the list: {text}");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!(info["sockets"][0]["name"], "hand", "gs4d info lists it: {info}");
    assert!(gs4d(&arguments!["info", &out]).text().contains("hand (0 to 1)"), "for people, too");

    let (again, none) = (folder.path().join("again.gs4d"), folder.path().join("none.gs4d"));
    let place =
        arguments!["socket", &out, "--name", "hand", "--at", "0,0,0", "--time", "0", "--rate", "10", "-o", &again];
    let text = gs4d(&place).text();
    assert!(text.contains("track") && text.contains("wrote"), "the report: {text}");
    let replaced = read(&again).sockets;
    assert_eq!((replaced.len(), replaced[0].samples.len()), (1, 11), "a socket of the same name is replaced");
    gs4d(&arguments!["socket", &again, "--name", "hand", "--remove", "-o", &none]).text();
    assert!(read(&none).sockets.is_empty(), "the socket is removed");
    assert_eq!(gs4d(&arguments!["socket", &none, "--list"]).text(), "no sockets\n", "none is left");
}

#[test]
fn a_lost_point_is_reported_with_the_time_and_nothing_is_written_without_a_path() {
    let folder = folder();
    let scene = body(&folder, "scene.gs4d", 0.45);
    let place = arguments!["socket", &scene, "--name", "hand", "--at", "0,0,0", "--time", "0"];
    let report = gs4d(&[&place[..], &arguments!["--json"]].concat()).json();
    let lost = report["followed"]["lost_after"].as_f64().expect("a time");
    assert!((0.4..0.75).contains(&lost), "the body is gone soon after 0.45: {report}");
    assert_eq!(report["followed"]["socket"]["to"], report["followed"]["lost_after"], "the track ends there: {report}");
    let text = gs4d(&place).text();
    assert!(text.contains("after 0.") && text.contains("nothing: --out"), "for people: {text}");
    assert!(read(&scene).sockets.is_empty(), "the input is unchanged");
}

#[test]
fn points_are_compared_with_their_known_tracks() {
    let folder = folder();
    let (scene, file) = (body(&folder, "scene.gs4d", f32::INFINITY), folder.path().join("points.json"));
    let times: Vec<f32> = (0..=20).map(|index| index as f32 / 20.0).collect();
    let track =
        |start: Vec3| -> Vec<[f32; 3]> { times.iter().map(|time| (start + VELOCITY * *time).to_array()).collect() };
    let points = json!({ "hand": track(Vec3::new(0.1, 0.2, 0.0)), "moon": track(Vec3::splat(9.0)) });
    let text = json!({ "seconds": [0, 1], "times": times, "points": points }).to_string();
    fs::write(&file, text).expect("the folder can be written to");
    let before = contents(folder.path());
    let compare = arguments!["socket", &scene, "--points", &file];
    let report = gs4d(&[&compare[..], &arguments!["--json"]].concat()).json();
    let compared = report["compared"].as_array().expect("a list");
    let [hand, moon] = compared.as_slice() else { panic!("two points: {report}") };
    assert_eq!((&hand["name"], &moon["name"]), (&"hand".into(), &"moon".into()), "the names");
    assert_eq!(
        (&hand["time"], &hand["places"]),
        (&0.5_f64.into(), &21.into()),
        "from the middle, at all times: {report}"
    );
    assert_eq!(
        (&hand["lost_percent"], &moon["lost_percent"]),
        (&0.0_f64.into(), &100.0_f64.into()),
        "only one is there"
    );
    for key in ["largest_percent", "mean_percent", "way_back_percent"] {
        let off = hand[key].as_f64().expect("a number");
        assert!(off < 1.0, "{key}: {off}");
        assert_eq!(moon[key], Value::Null, "{key} of what is not there");
    }
    let text = gs4d(&compare).text();
    for expected in ["way back", "hand", "100.00 %", "size"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    assert!(contents(folder.path()) == before, "nothing is written");

    for (text, expected) in [
        ("[", "points.json: is no file of known points"),
        ("{\"times\": [0, 1], \"points\": {\"hand\": [null]}}", "points.json: the point hand has 1 places for 2 times"),
        ("{\"times\": [7], \"points\": {\"hand\": [[0, 0, 0]]}}", "scene.gs4d: the point hand has no known place"),
    ] {
        fs::write(&file, text).expect("the folder can be written to");
        gs4d(&compare).must_fail(expected);
    }
    fs::remove_file(&file).expect("the file exists");
    gs4d(&compare).must_fail("points.json: ");
}

#[test]
fn points_and_names_that_cannot_be_used_are_refused() {
    let folder = folder();
    let (scene, out) = (body(&folder, "scene.gs4d", f32::INFINITY), folder.path().join("out.gs4d"));
    for (name, at, time, rate, expected) in [
        ("hand", "9,9,9", "0.5", "60", "nothing that can be followed is visible"),
        ("hand", "0,0,0", "1.5", "60", "outside the time interval"),
        (" ", "0,0,0", "0.5", "60", "the name of a socket"),
        ("hand", "0,0", "0.5", "60", "expected three numbers"),
        ("hand", "0,0,0", "0.5", "1000000", "--rate 1000000"),
    ] {
        let place = ["--name", name, "--at", at, "--time", time, "--rate", rate].map(OsString::from);
        gs4d(&[&arguments!["socket", &scene, "-o", &out][..], &place].concat()).must_fail(expected);
    }
    gs4d(&arguments!["socket", &scene, "--name", "foot", "--remove", "-o", &out]).must_fail("has no socket foot");
    gs4d(&arguments!["socket", &scene, "--name", "foot"]).must_fail("required");
    assert!(!out.exists(), "nothing is written");
}
