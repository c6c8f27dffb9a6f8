//! `gs4d report`, run as a user runs it.
//!
//! In: small packages, with and without the reports of bakes, damaged, missing and unfinished ones. Out: proof that
//! every package is listed with what is known of it, that the one that differs is marked, and that failures give the
//! exit code and are named.

use crate::support::command::{arguments, folder, gs4d, scene};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Copies a package, and writes the report of a bake beside it.
fn baked(folder: &TempDir, from: &Path, name: &str, psnr: f64, seconds: f64) -> PathBuf {
    let path = folder.path().join(format!("{name}.gs4d"));
    fs::copy(from, &path).expect("the folder can be written to");
    let bytes = fs::metadata(&path).expect("the package exists").len();
    let mean = |psnr: f64| json!({ "mean": { "psnr": psnr, "ssim": 0.97 } });
    let report = json!({
        "checkpoint": format!("{name}.pth"),
        "gaussians": { "before": 200, "after": 50 },
        "bytes": { "before": 10 * bytes, "after": bytes },
        "choices": [["goal", "keep 50"]],
        "stages": [
            { "name": "score", "seconds": seconds, "skipped": false },
            { "name": "prune", "seconds": 0.5, "skipped": false },
        ],
        "evaluation": { "before": mean(32.5), "after": mean(psnr) },
    });
    fs::write(folder.path().join(format!("{name}.report.json")), report.to_string()).expect("written");
    fs::write(folder.path().join(format!("{name}.report.html")), "<!doctype html>").expect("written");
    path
}

/// Returns a folder with six bakes, of which `f` has lost much quality and took long.
fn bakes() -> TempDir {
    let (folder, source) = (folder(), folder());
    let package = scene(&source, "50");
    for (index, name) in ["a", "b", "c", "d", "e"].into_iter().enumerate() {
        baked(&folder, &package, name, 32.0 + 0.1 * index as f64, 60.0 + index as f64);
    }
    baked(&folder, &package, "f", 25.0, 900.0);
    folder
}

fn named<'a>(report: &'a Value, name: &str) -> &'a Value {
    let is_named = |bake: &&Value| bake["package"].as_str().is_some_and(|path| path.ends_with(name));
    report["bakes"].as_array().and_then(|bakes| bakes.iter().find(is_named)).expect("the package is listed")
}

#[test]
fn every_bake_is_listed_and_the_one_that_differs_is_marked() {
    let folder = bakes();
    let (page, csv) = (folder.path().join("all.html"), folder.path().join("all.csv"));
    let report = gs4d(&arguments!["report", folder.path(), "-o", &page, "--csv", &csv, "--json"]).json();
    assert_eq!(report["bakes"].as_array().map(Vec::len), Some(6), "all packages of the folder");
    let (a, f) = (named(&report, "a.gs4d"), named(&report, "f.gs4d"));
    assert_eq!((&a["measures"]["psnr"], &a["measures"]["loss"]), (&32.0.into(), &0.5.into()), "PSNR and its loss");
    assert_eq!((&a["measures"]["kept"], &a["measures"]["seconds"]), (&25.0.into(), &60.5.into()), "share and time");
    assert_eq!(a["outliers"], json!([]), "nothing is unusual about a");
    let unusual: Vec<_> = f["outliers"].as_array().into_iter().flatten().map(|outlier| &outlier["measure"]).collect();
    assert_eq!(unusual, ["psnr", "loss", "seconds"], "what is unusual about f");
    let text = gs4d(&arguments!["report", folder.path()]).text();
    assert!(text.contains("outliers") && text.contains("f.gs4d: PSNR, dB 25.00, usually"), "in words: {text}");

    let rows = fs::read_to_string(&csv).expect("the table is written");
    assert_eq!(rows.lines().count(), 7, "a head and six rows");
    assert!(rows.lines().any(|row| row.contains("f.gs4d,") && row.contains("psnr loss seconds")), "marked: {rows}");
    let html = fs::read_to_string(&page).expect("the page is written");
    assert!(html.contains("href=\"f.report.html\"") && html.contains("▼ 25.00"), "links and marks");
    assert!(!html.contains("://") && !html.contains("src="), "the page loads no other file");
}

#[test]
fn failures_are_named_and_give_the_exit_code() {
    let folder = bakes();
    let path = |name: &str| folder.path().join(name);
    let mut bytes = fs::read(path("a.gs4d")).expect("a package");
    if let Some(last) = bytes.last_mut() {
        *last ^= 1;
    }
    fs::write(path("a.gs4d"), bytes).expect("the folder can be written to");
    fs::write(path("b.gs4d"), "no package").expect("the folder can be written to");
    fs::write(path("c.report.json"), "{\"stages\": 7").expect("the folder can be written to");
    fs::create_dir(path("g.gs4d.bake")).expect("the folder can be written to");
    let page = path("all.html");
    let run = gs4d(&arguments!["report", folder.path(), path("missing.gs4d"), "-o", &page, "--json"]);
    run.must_fail("5 of 8 bakes have failed");
    let report: Value = serde_json::from_str(&run.out).expect("one JSON document, also with failures");
    assert_eq!(report["failures"], 5, "all are counted");
    for (name, words) in [
        ("a.gs4d", "sections are damaged"),
        ("b.gs4d", "not"),
        ("c.gs4d", "its report is damaged"),
        ("g.gs4d", "run the same command again"),
        ("missing.gs4d", "there is no such file"),
    ] {
        let failure = named(&report, name)["failure"].as_str().unwrap_or_default();
        assert!(failure.contains(words), "{name}: {words:?} in {failure:?}");
    }
    assert_eq!(named(&report, "c.gs4d")["measures"]["gaussians"], 50.0, "the header of an intact package is known");
    assert!(fs::read_to_string(page).is_ok_and(|html| html.contains("run the same command again")), "on the page, too");
}

#[test]
fn packages_without_their_report_are_listed_by_their_headers() {
    let folder = bakes();
    fs::remove_file(folder.path().join("a.report.json")).expect("the report exists");
    gs4d(&arguments!["synth", folder.path().join("b.gs4d"), "--count", "70"]).text();
    let report = gs4d(&arguments!["report", folder.path(), "--json"]).json();
    for (name, gaussians, words) in [("a.gs4d", 50.0, "no report"), ("b.gs4d", 70.0, "was replaced")] {
        let bake = named(&report, name);
        assert_eq!(
            (&bake["measures"]["gaussians"], &bake["measures"]["psnr"]),
            (&gaussians.into(), &Value::Null),
            "{name}"
        );
        assert!(bake["notes"][0].as_str().is_some_and(|note| note.contains(words)), "{name}: {}", bake["notes"]);
        assert_eq!(bake["failure"], Value::Null, "{name} is not a failure");
    }
}

#[test]
fn a_folder_without_packages_and_bad_outputs_are_refused() {
    let (empty, folder) = (folder(), bakes());
    gs4d(&arguments!["report", empty.path()]).must_fail("has no packages");
    let package = folder.path().join("a.gs4d");
    gs4d(&arguments!["report", &package, "-o", &package]).must_fail("is the input itself");
    gs4d(&arguments!["report", &package, "-o", folder.path().join("page.txt")]).must_fail("ends in .html");
}
