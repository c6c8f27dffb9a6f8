//! `gs4d collide`, run as a user runs it.
//!
//! In: packages of a slab at rest and a cube that moves above it in a straight line. Out: proof that closed meshes of
//! both are stored, reported, listed, written as OBJ files, replaced and removed, and that settings that cannot be used
//! and boxes without anything solid are refused by one sentence and write nothing.

use crate::support::command::{arguments, folder, gs4d};
use crate::support::folders::names;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::offline::work::save;
use bevy_gs4d::scene::{ColliderMesh, GaussianScene, RuntimeScene};
use glam::{UVec3, Vec3};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Debug;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use tempfile::TempDir;

/// Distance between neighboring Gaussians, capture units.
const SPACING: f32 = 0.08;
/// Velocity of the cube, capture units per unit of time.
const VELOCITY: Vec3 = Vec3::X;
/// A box around slab and cube at all times.
const BOUNDS: &str = "-1.5,-1.5,-0.5,1.5,1.5,1.5";
/// Settings with which a run takes no time.
const QUICK: [&str; 6] = ["--bounds", BOUNDS, "--cells", "48", "--rate", "4"];

/// Adds a block of dense Gaussians, so many along each axis, whose center is at `center` at time 0.5.
fn block(gaussians: &mut Vec<Gaussian>, counts: UVec3, center: Vec3, velocity: Vec3) {
    let corner = center - (counts - UVec3::ONE).as_vec3() * SPACING / 2.0;
    for index in 0..counts.element_product() {
        let cell = UVec3::new(index % counts.x, index / counts.x % counts.y, index / (counts.x * counts.y));
        gaussians.push(Gaussian {
            mean: (corner + cell.as_vec3() * SPACING).to_array(),
            mean_t: 0.5,
            velocity: velocity.to_array(),
            sigma_t: 100.0,
            covariance: [0.0025, 0.0, 0.0, 0.0025, 0.0, 0.0025],
            opacity: 0.99,
            padding: 0.0,
        });
    }
}

/// Writes a slab of 2 x 2 units under z = 0 at rest, and above it a cube that moves from x = -0.5 to x = 0.5. Returns
/// the path.
fn stage(folder: &TempDir) -> PathBuf {
    let mut gaussians = Vec::new();
    block(&mut gaussians, UVec3::new(26, 26, 3), Vec3::new(0.0, 0.0, -0.08), Vec3::ZERO);
    block(&mut gaussians, UVec3::splat(6), Vec3::new(0.0, 0.0, 0.8), VELOCITY);
    let harmonics = Harmonics { coefficients: 1, values: vec![0.0; 3 * gaussians.len()], ..Harmonics::default() };
    let path = folder.path().join("scene.gs4d");
    let scene = GaussianScene::from(RuntimeScene::sliced(gaussians, harmonics));
    save(&path, &scene, &WriteSettings::default()).expect("the folder can be written to");
    path
}

fn read(path: &Path) -> GaussianScene {
    codec::load(path, &ReadOptions::default()).expect("the package can be read")
}

/// Returns a command line with the quick settings.
fn collide(scene: &Path, out: &Path, more: &[OsString]) -> Vec<OsString> {
    [&arguments!["collide", scene, "-o", out][..], &QUICK.map(OsString::from), more].concat()
}

/// Reads an OBJ file of triangles.
fn parse(path: &Path) -> ColliderMesh {
    let text = fs::read_to_string(path).expect("the mesh is written");
    let mut mesh = ColliderMesh::default();
    for line in text.lines() {
        match line.split_once(' ') {
            Some(("#", _)) => {}
            Some(("v", point)) => mesh.points.push(three(point)),
            Some(("f", triangle)) => mesh.triangles.push(three::<u32>(triangle).map(|point| point - 1)),
            _ => panic!("{}: {line:?} is neither a point nor a triangle", path.display()),
        }
    }
    mesh
}

fn three<T: FromStr<Err: Debug>>(text: &str) -> [T; 3] {
    let values: Vec<T> = text.split(' ').map(|value| value.parse().expect("a number")).collect();
    <[T; 3]>::try_from(values).unwrap_or_else(|_| panic!("{text:?} is not three numbers"))
}

/// Checks that each edge has a triangle on both sides, and that the triangles are counter-clockwise seen from outside.
fn check_closed(mesh: &ColliderMesh, name: &str) {
    let mut edges = BTreeMap::<(u32, u32), i32>::new();
    let mut volume = 0.0;
    for &[a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
        }
        let [a, b, c] = [a, b, c].map(|index| Vec3::from(mesh.points[index as usize]));
        volume += a.dot(b.cross(c)) / 6.0;
    }
    assert!(!mesh.triangles.is_empty(), "{name}: something is solid");
    assert_eq!(edges.values().filter(|sum| **sum != 0).count(), 0, "{name}: edges with a triangle on one side only");
    assert!(volume > 0.0, "{name}: its triangles are seen from outside: {volume}");
}

/// Returns the corners of the box around a mesh.
fn corners(mesh: &ColliderMesh) -> [Vec3; 2] {
    mesh.bounds().expect("the mesh has points")
}

#[test]
fn meshes_of_what_stands_and_of_what_moves_are_stored_and_written() {
    let folder = folder();
    let scene = stage(&folder);
    let [out, meshes, back] = ["solid.gs4d", "meshes", "back.gs4d"].map(|name| folder.path().join(name));
    let report = gs4d(&collide(&scene, &out, &arguments!["--obj", &meshes, "--json"])).json();
    let (before, after) = (read(&scene), read(&out));
    assert_eq!(before.form, after.form, "the Gaussians are unchanged");
    let colliders = after.colliders.expect("the package has colliders");

    let [low, high] = corners(&colliders.standing);
    assert!((high - low).truncate().min_element() > 1.8, "the slab: {low} to {high}");
    assert!(low.z > -0.4 && high.z < 0.25, "without the cube: {low} to {high}");
    let ends: Vec<[f32; 2]> = colliders.stretches.iter().map(|stretch| [stretch.from, stretch.to]).collect();
    assert_eq!(ends, [[0.0, 0.25], [0.25, 0.5], [0.5, 0.75], [0.75, 1.0]], "four stretches of a second");
    let centers: Vec<Vec3> = colliders
        .stretches
        .iter()
        .map(|stretch| {
            let [low, high] = corners(&stretch.mesh);
            assert!(low.z > 0.35 && high.z < 1.25, "the cube alone: {low} to {high}");
            (low + high) / 2.0
        })
        .collect();
    for (center, expected) in centers.iter().zip([-0.375, -0.125, 0.125, 0.375]) {
        let expected = Vec3::new(expected, 0.0, 0.8);
        assert!(center.distance(expected) < 0.15, "the cube moves: {center}, not {expected}");
    }

    let files = ["000.obj", "001.obj", "002.obj", "003.obj", "standing.obj"];
    assert_eq!(names(&meshes), files, "a file for each mesh");
    let moving = colliders.stretches.iter().map(|stretch| &stretch.mesh);
    for (file, stored) in files.iter().zip(moving.chain([&colliders.standing])) {
        let mesh = parse(&meshes.join(file));
        check_closed(&mesh, file);
        assert_eq!(&mesh, stored, "{file}: the mesh of the package");
    }

    let length = |path: &Path| path.metadata().expect("the file exists").len();
    assert_eq!((&report["bytes_in"], &report["bytes_out"]), (&length(&scene).into(), &length(&out).into()), "sizes");
    let own = report["bytes_colliders"].as_u64().expect("a size");
    assert!(own > 0 && own < length(&out) - length(&scene), "{own} bytes of colliders: {report}");
    let found = &report["colliders"];
    let points: usize = colliders.meshes().map(|mesh| mesh.points.len()).sum();
    let triangles: usize = colliders.meshes().map(|mesh| mesh.triangles.len()).sum();
    assert_eq!((&found["points"], &found["triangles"]), (&points.into(), &triangles.into()), "counts: {report}");
    assert_eq!(found["stretches"].as_array().map(Vec::len), Some(4), "the stretches: {report}");
    assert_eq!((&found["cells"], &found["cell"]), (&48.into(), &0.0625.into()), "the cells: {report}");
    for key in ["solid_standing", "solid_moving"] {
        assert!(found[key].as_u64() > Some(100), "{key}: {report}");
    }

    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    let listed = serde_json::json!({ "stretches": 4, "points": points, "triangles": triangles });
    assert_eq!(info["colliders"], listed, "gs4d info lists them");
    let text = gs4d(&arguments!["info", &out]).text();
    assert!(text.contains(&format!("{triangles} triangles, 4 stretches of time")), "for people, too: {text}");
    let info = gs4d(&arguments!["info", &scene, "--json"]).json();
    assert!(info["colliders"].is_null(), "the input has none: {info}");

    let text = gs4d(&arguments!["collide", &out, "--remove", "-o", &back]).text();
    assert!(text.contains("removed") && text.contains("wrote"), "the report: {text}");
    let bytes = |path: &Path| fs::read(path).expect("the package exists");
    assert!(bytes(&back) == bytes(&scene), "without colliders it is the package before");
}

#[test]
fn colliders_are_replaced_and_the_same_settings_give_the_same_bytes() {
    let folder = folder();
    let scene = stage(&folder);
    let [first, again, coarse] = ["first.gs4d", "again.gs4d", "coarse.gs4d"].map(|name| folder.path().join(name));
    let text = gs4d(&collide(&scene, &first, &[])).text();
    for expected in ["searched", "cells", "solid", "standing", "stretches", "colliders", "wrote"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    gs4d(&collide(&first, &again, &[])).text();
    let bytes = |path: &Path| fs::read(path).expect("the package exists");
    assert!(bytes(&first) == bytes(&again), "the colliders that are there have no effect");
    gs4d(&arguments!["collide", &first, "-o", &coarse, "--bounds", BOUNDS, "--cells", "24"]).text();
    let [fine, coarse] = [&first, &coarse].map(|path| read(path).colliders.expect("the package has colliders"));
    let stretches = coarse.stretches.len();
    assert!((5..=10).contains(&stretches), "ten a second without --rate, fewer if neighbors are equal: {stretches}");
    assert_ne!(coarse.standing, fine.standing, "other cells give another mesh");
}

#[test]
fn an_edit_says_that_colliders_stay_as_they_were() {
    let folder = folder();
    let scene = stage(&folder);
    let [solid, left, edits] = ["solid.gs4d", "left.gs4d", "edits.ron"].map(|name| folder.path().join(name));
    gs4d(&collide(&scene, &solid, &[])).text();
    // The part of the stage on one side of the plane x = 0.
    let half = "[remove_box(min: (0, -9, -9), max: (9, 9, 9))]";
    fs::write(&edits, half).expect("the folder can be written to");
    let note = "colliders stay as they were";
    let run = gs4d(&arguments!["edit", &solid, &edits, "-o", &left]);
    assert!(run.err.contains(note), "{}", run.err);
    assert_eq!(read(&left).colliders, read(&solid).colliders, "they are as before");
    let run = gs4d(&arguments!["edit", &scene, &edits, "-o", &left]);
    assert!(!run.err.contains(note), "a capture without colliders: {}", run.err);
}

#[test]
fn pruning_says_that_colliders_stay_as_they_were() {
    let folder = folder();
    let scene = stage(&folder);
    let [solid, left, scores] = ["solid.gs4d", "left.gs4d", "scores.f32"].map(|name| folder.path().join(name));
    gs4d(&collide(&scene, &solid, &[])).text();
    let bytes: Vec<u8> = (0..read(&scene).len()).flat_map(|index| (index as f32).to_le_bytes()).collect();
    fs::write(&scores, bytes).expect("the folder can be written to");
    for (from, ratio, is_told) in [(&solid, "0.5", true), (&solid, "0", false), (&scene, "0.5", false)] {
        let run = gs4d(&arguments!["prune", from, "--scores", &scores, "--ratio", ratio, "-o", &left]);
        assert_eq!(run.code, Some(0), "{} without {ratio}: {}", from.display(), run.err);
        let said = run.err.contains("colliders stay as they were");
        assert_eq!(said, is_told, "{} without {ratio}: {}", from.display(), run.err);
        assert_eq!(read(&left).colliders, read(from).colliders, "they are as before");
    }
}

#[test]
fn what_cannot_be_used_is_refused_and_nothing_is_written() {
    let folder = folder();
    let scene = stage(&folder);
    let [out, meshes, full] = ["out.gs4d", "meshes", "full"].map(|name| folder.path().join(name));
    fs::create_dir(&full).expect("the folder can be written to");
    fs::write(full.join("standing.obj"), "").expect("the folder can be written to");
    for (option, value, expected) in [
        ("--level", "0", "expected a number above 0 and below 1"),
        ("--level", "1.5", "expected a number above 0 and below 1"),
        ("--level", "nan", "expected a number above 0 and below 1"),
        ("--cells", "4", "4 is not in 8..=512"),
        ("--cells", "5000", "5000 is not in 8..=512"),
        ("--rate", "0", "expected a number above zero"),
        ("--error", "nan", "expected a number from 0 to 4"),
        ("--error", "5", "expected a number from 0 to 4"),
        ("--smallest", "few", "--smallest"),
        ("--bounds", "1,1,1,0,0,0", "expected two corners, the lower one first"),
        ("--bounds", "0,0,0,1,1", "expected two corners, the lower one first"),
        ("--bounds", "5,5,5,6,6,6", "scene.gs4d: nothing is as opaque as the level"),
        ("--level", "0.99999", "scene.gs4d: nothing is as opaque as the level"),
        ("--rate", "100000", "scene.gs4d: the capture would have 100000 stretches of time"),
    ] {
        let run = gs4d(&arguments!["collide", &scene, "-o", &out, "--obj", &meshes, option, value]);
        run.must_fail(expected);
        let errors = run.err.lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!(errors, 1, "{option} {value}: one sentence: {}", run.err);
    }
    gs4d(&collide(&scene, &out, &arguments!["--obj", &full])).must_fail("full: is not empty");
    gs4d(&arguments!["collide", &scene, "--remove", "-o", &out]).must_fail("has no colliders to remove");
    assert!(!out.exists() && !meshes.exists(), "nothing is written");
    assert_eq!(names(&full), ["standing.obj"], "nor beside other files");
}
