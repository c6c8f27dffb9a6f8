//! Commands that take a capture, on files of other makes.
//!
//! In: exports of a small synthetic scene, and pictures of one of them. Out: proof that `info`, `convert`, `compress`, `mask`, `bench` and `bake`
//! take these files as they take packages, and that a file whose Gaussians have windows of time is masked by these alone.

use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::dataset;
use crate::support::no_gpu::no_gpu;
use bevy_gs4d::codec::{ReadOptions, load};
use bevy_gs4d::renderer::GpuContext;
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const COUNT: usize = 400;

/// Exports a scene of 400 Gaussians to these names.
fn exports(folder: &TempDir, names: &[&str]) -> Vec<PathBuf> {
    let scene = scene(folder, &COUNT.to_string());
    let export = |name: &&str| {
        let path = folder.path().join(name);
        let is_moving = name.ends_with("ftgs.ply") || name.ends_with("sogst") || name.ends_with("4dgs");
        let time: &[&str] = if is_moving { &[] } else { &["--time", "0.5"] };
        let more = time.iter().map(Into::into).collect();
        gs4d(&[arguments!["export", &scene, &path].to_vec(), more].concat()).text();
        path
    };
    names.iter().map(export).collect()
}

fn info(path: &Path) -> Value {
    gs4d(&arguments!["info", path, "--json"]).json()
}

fn has_filter(path: &Path) -> bool {
    load(path, &ReadOptions::default()).expect("a package").filter.is_some()
}

fn bytes(path: &Path) -> u64 {
    fs::metadata(path).expect("the file is there").len()
}

#[test]
fn imports_are_converted_masked_and_compressed() {
    let folder = folder();
    let names = ["a.ply", "a.ftgs.ply", "a.splat", "a.spz", "a.glb", "a.sog", "a.sogst", "a.4dgs"];
    for (path, name) in exports(&folder, &names).iter().zip(names) {
        let [whole, masked, small] =
            ["whole", "masked", "small"].map(|stem| folder.path().join(format!("{stem}.gs4d")));
        let count = info(path)["gaussians"].clone();
        gs4d(&arguments!["convert", path, &whole]).text();
        assert_eq!(info(&whole)["gaussians"], count, "{name}: all Gaussians are converted");
        gs4d(&arguments!["mask", path, "-o", &masked]).text();
        assert!(has_filter(&masked), "{name}: it has a filter");
        gs4d(&arguments!["compress", path, "-o", &small]).text();
        assert_eq!(info(&small)["gaussians"], count, "{name}: all Gaussians are compressed");
        assert!(bytes(&small) < bytes(&whole), "{name}: {} of {} bytes", bytes(&small), bytes(&whole));
        gs4d(&arguments!["compress", &masked, "-o", &small]).text();
        assert!(has_filter(&small), "{name}: the filter stays");
    }
}

#[test]
fn windows_of_a_sequence_stay_its_filter() {
    let folder = folder();
    let scene = scene(&folder, "300");
    let frames = folder.path().join("frames");
    gs4d(&arguments!["export", &scene, &frames, "--sequence", "--fps", "4"]).text();
    let small = folder.path().join("small.gs4d");
    gs4d(&arguments!["mask", &frames, "--fps", "4", "-o", &small]).must_fail("a window of time of its own");
    gs4d(&arguments!["compress", &frames, "--fps", "4", "-o", &small]).text();
    assert!(has_filter(&small), "the windows are compressed, too");
}

#[test]
fn an_import_is_baked_with_its_pictures() {
    let folder = folder();
    let path = exports(&folder, &["a.ply"]).remove(0);
    let [data, out] = ["data", "out.gs4d"].map(|name| folder.path().join(name));
    let import = load(&path, &ReadOptions::default()).expect("a PLY");
    let count = import.len();
    let drawn = import.into_runtime().expect("it can be drawn");
    dataset::write(&data, &drawn, Vec3::ZERO, 4, 2, UVec2::splat(48), true);
    let engine = ["--engine", "cpu", "--no-fine-tune", "--ratio", "0.25", "--json"].map(Into::into);
    let report = gs4d(&[&arguments!["bake", &path, "--data", &data, "-o", &out][..], &engine[..]].concat()).json();
    assert_eq!(report["gaussians"]["after"], count - count / 4, "three quarters stay");
    let psnr = report["evaluation"]["after"]["mean"]["psnr"].as_f64().expect("a number");
    assert!(psnr > 30.0, "{psnr} dB");
    assert_eq!(info(&out)["package"]["intact"], true, "an intact package");
}

#[test]
fn an_import_is_measured() {
    if GpuContext::headless(None).is_err() {
        return no_gpu();
    }
    let folder = folder();
    for path in exports(&folder, &["a.spz", "a.sogst"]) {
        let views = ["--frames", "2", "--orbit", "1", "--size", "32x24", "--json"].map(Into::into);
        let report = gs4d(&[&arguments!["bench", &path][..], &views[..]].concat()).json();
        let visible = report["rows"][0]["timings"]["counts"]["visible"].as_f64();
        assert!(visible.is_some_and(|visible| visible > 0.0), "splats are drawn: {report}");
    }
}
