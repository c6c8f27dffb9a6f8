//! `gs4d edit`, run as a user runs it.
//!
//! In: synthetic scenes in every form, lists of edits. Out: proof that an edit removes exactly what its rule names,
//! that everything else keeps its bits, that an edit without its line is undone, and that wrong lists are refused with
//! file, line and remedy, before anything is written.

use crate::support::capture::Capture;
use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::folders::contents;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene, SceneForm, Trained};
use glam::{UVec2, Vec3};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A box in the middle of a synthetic scene, and a sphere for a part of its time.
const BOX: &str = "remove_box(min: (-0.4, -0.5, -1), max: (0.5, 0.6, 2)),";
const SPHERE: &str = "remove_sphere(center: (0, 0, 0), radius: 1, times: (0.25, 0.5)),";

/// Writes a list with these edits. Returns its path.
fn list(folder: &TempDir, edits: &[&str]) -> PathBuf {
    let path = folder.path().join("edits.ron");
    fs::write(&path, format!("[\n    {}\n]\n", edits.join("\n    "))).expect("the folder can be written to");
    path
}

fn read(path: &Path) -> GaussianScene {
    codec::load(path, &ReadOptions::default()).expect("the package can be read")
}

fn gaussians(path: &Path) -> Vec<Gaussian> {
    read(path).into_runtime().expect("every Gaussian can be drawn").iter().collect()
}

/// Returns where a Gaussian is within a stretch of time when it is most opaque.
fn place(gaussian: &Gaussian, [from, to]: [f32; 2]) -> Vec3 {
    gaussian.mean_at(gaussian.mean_t.clamp(from, to))
}

/// Returns whether a Gaussian is drawn within a stretch of time.
fn lives(gaussian: &Gaussian, [from, to]: [f32; 2]) -> bool {
    gaussian.marginal(gaussian.mean_t.clamp(from, to)) > 0.05
}

/// Returns the indices that are not in the box, and those that are not in the sphere either.
fn expected(path: &Path) -> [Vec<usize>; 2] {
    let all = gaussians(path);
    let (min, max) = (Vec3::new(-0.4, -0.5, -1.0), Vec3::new(0.5, 0.6, 2.0));
    let is_in_box = |place: Vec3| place.cmpge(min).all() && place.cmple(max).all();
    let outside = (0..all.len()).filter(|&index| !is_in_box(place(&all[index], [0.0, 1.0])));
    let outside: Vec<usize> = outside.collect();
    let times = [0.25, 0.5];
    let is_in_sphere = |index: &usize| lives(&all[*index], times) && place(&all[*index], times).length() <= 1.0;
    [outside.clone(), outside.into_iter().filter(|index| !is_in_sphere(index)).collect()]
}

#[test]
fn edits_remove_exactly_what_is_inside_and_are_undone_by_removing_their_lines() {
    let folder = folder();
    let original = scene(&folder, "600");
    let before = fs::read(&original).expect("the package exists");
    let [after_box, after_both] = expected(&original);
    assert!(600 > after_box.len() && after_box.len() > after_both.len(), "both edits have an effect");
    let out = folder.path().join("edited.gs4d");
    let edit = |edits: &[&str]| gs4d(&arguments!["edit", &original, list(&folder, edits), "-o", &out, "--json"]).json();

    let report = edit(&[BOX, SPHERE]);
    let kept = after_both.len();
    assert_eq!((&report["gaussians_in"], &report["gaussians"]), (&600.into(), &kept.into()), "the numbers: {report}");
    let removed = [600 - after_box.len(), after_box.len() - kept];
    for (index, removed) in removed.into_iter().enumerate() {
        assert_eq!(report["edits"][index]["removed"], removed, "removed by edit {index}: {report}");
    }
    assert_eq!(report["edits"][1]["edit"]["remove_sphere"]["radius"], 1.0, "the edit itself");
    let rows = |keep: &[usize]| -> Vec<Gaussian> {
        let all = gaussians(&original);
        keep.iter().map(|&index| all[index]).collect()
    };
    assert_eq!(gaussians(&out), rows(&after_both), "the others have their bits");
    let [SceneForm::Trained(Trained { harmonics: all, .. }), SceneForm::Trained(Trained { harmonics: some, .. })] =
        [&original, &out].map(|path| read(path).form)
    else {
        panic!("the form stays")
    };
    let each = all.coefficients * 3;
    for (place, index) in after_both.iter().enumerate() {
        let colors = [&all.values[index * each..][..each], &some.values[place * each..][..each]];
        assert_eq!(colors[0], colors[1], "the color of Gaussian {index}");
    }

    edit(&[BOX]);
    assert_eq!(gaussians(&out), rows(&after_box), "without the line of the sphere, its Gaussians are there again");
    let report = edit(&[]);
    assert_eq!(report["gaussians"], 600, "no edit is left");
    assert!(fs::read(&out).expect("the package exists") == before, "the original, byte for byte");
    assert!(fs::read(&original).expect("the package exists") == before, "the original is not changed");
}

#[test]
fn captures_stay_in_their_form_and_filtered_ones_keep_their_filter() {
    let folder = folder();
    let trained = scene(&folder, "700");
    let path = |name: &str| folder.path().join(name);
    let edits = list(&folder, &[BOX, SPHERE]);
    gs4d(&arguments!["convert", &trained, path("runtime.gs4d"), "--form", "runtime"]).text();
    gs4d(&arguments!["mask", &trained, "-o", path("filtered.gs4d")]).text();
    let packing =
        arguments!["compress", path("filtered.gs4d"), path("packed.gs4d"), "--codebooks", "4", "--verify", "0"];
    gs4d(&packing).text();
    for (name, form) in [("runtime.gs4d", "runtime"), ("filtered.gs4d", "trained"), ("packed.gs4d", "packed")] {
        let (from, out) = (path(name), path("out.gs4d"));
        let report = gs4d(&arguments!["edit", &from, &edits, "-o", &out, "--json"]).json();
        let [_, kept] = expected(&from);
        assert_eq!(report["gaussians"], kept.len(), "{name}: the kept ones");
        let info = gs4d(&arguments!["info", &out, "--json"]).json();
        assert_eq!(info["form"], form, "{name}: the form stays");
        let all = gaussians(&from);
        let is_visible = |gaussian: &Gaussian| gaussian.opacity > 0.0;
        let found: Vec<Gaussian> = gaussians(&out).into_iter().filter(is_visible).collect();
        let visible: Vec<usize> = kept.into_iter().filter(|&index| is_visible(&all[index])).collect();
        assert_eq!(found, visible.iter().map(|&index| all[index]).collect::<Vec<_>>(), "{name}: they have their bits");
        let [before, after] = [&from, &out].map(|path| read(path).filter);
        assert_eq!(before.is_some(), after.is_some(), "{name}: the filter stays");
        if let (Some(before), Some(after), "trained") = (before, after, form) {
            for (place, &index) in visible.iter().enumerate() {
                let active = |segment| [before.is_active(segment, index), after.is_active(segment, place)];
                let is_same = (0..before.segments).all(|segment| active(segment)[0] == active(segment)[1]);
                assert!(is_same, "{name}: Gaussian {index} is active in the same segments");
            }
        }
    }
}

#[test]
fn a_dry_run_counts_and_writes_nothing() {
    let folder = folder();
    let original = scene(&folder, "300");
    let edits = list(&folder, &[BOX, "remove_sphere(center: (90, 0, 0), radius: 1),"]);
    let before = contents(folder.path());
    let run = gs4d(&arguments!["edit", &original, &edits, "--dry-run"]);
    let note = "edit 2, remove_sphere, removes nothing";
    assert!(run.err.contains(note), "an edit without an effect is named: {}", run.err);
    let text = run.text();
    let [kept, _] = expected(&original);
    assert!(text.contains(&format!("{} of 300 Gaussians", kept.len())) && text.contains("a dry run"), "{text}");
    assert!(contents(folder.path()) == before, "nothing is written");
}

#[test]
fn wrong_lists_are_refused_with_file_line_and_remedy() {
    let folder = folder();
    let original = scene(&folder, "60");
    let out = folder.path().join("out.gs4d");
    for (edits, refusal) in [
        ("remove_box(min: (0, 0, 0), max: (1, 1, 1)", "edits.ron: line 3, column "),
        ("crop_box(min: (0, 0, 0), max: (1, 1, 1)),", "expected one of `keep_box`"),
        ("keep_box(min: (0, 0, 0), max: (1, 1, 1), color: 3),", "edits.ron: line 2, column "),
        ("keep_box(min: (1, 0, 0), max: (0, 1, 1)),", "each of min below that of max"),
        ("keep_box(min: (90, 90, 90), max: (91, 91, 91)),", "edits.ron: edit 1, keep_box, leaves no Gaussian"),
        ("remove_floaters(cameras_below: 3, distance_below: 1),", "give --data DIR"),
    ] {
        let edits = list(&folder, &[edits]);
        gs4d(&arguments!["edit", &original, &edits, "-o", &out]).must_fail(refusal);
        assert!(!out.exists(), "{refusal}: no output is written");
    }
    let edits = list(&folder, &[BOX]);
    let before = contents(folder.path());
    gs4d(&arguments!["edit", &original, &edits, "-o", &original]).must_fail("the input itself");
    gs4d(&arguments!["edit", &original, &edits, "-o", &edits]).must_fail("edits.ron");
    gs4d(&arguments!["edit", &original, folder.path().join("gone.ron"), "-o", &out]).must_fail("gone.ron");
    gs4d(&arguments!["edit", &original, &edits]).must_fail("--out");
    assert!(contents(folder.path()) == before, "inputs are not overwritten");
}

#[test]
fn floaters_are_found_by_the_cameras_of_the_dataset() {
    let gaussian = |mean: Vec3, deviation: f32| {
        let variance = deviation * deviation;
        Gaussian {
            mean: mean.to_array(),
            mean_t: 0.5,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [variance, 0.0, 0.0, variance, 0.0, variance],
            opacity: 0.5,
            padding: 0.0,
        }
    };
    // The first camera of the dataset is there, and looks at the origin.
    let eye = Vec3::new(3.5, 0.0, 1.8);
    let all = vec![gaussian(Vec3::ZERO, 0.3), gaussian(eye * 0.85, 0.02), gaussian(eye * 0.5, 0.02)];
    let harmonics = Harmonics { coefficients: 1, values: vec![0.5; 9], ..Harmonics::default() };
    let scene = GaussianScene::from(RuntimeScene::sliced(all.clone(), harmonics));
    let capture = Capture::new(scene, Vec3::ZERO, 4, 2, UVec2::splat(64), false);
    let edits = list(&capture.folder, &["remove_floaters(cameras_below: 2, distance_below: 1),"]);
    let out = capture.path("out.gs4d");
    gs4d(&arguments!["edit", &capture.scene, &edits, "--data", &capture.data, "-o", &out]).text();
    assert_eq!(gaussians(&out), [all[0], all[2]], "the one close before a camera is removed");
}
