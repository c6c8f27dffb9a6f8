//! The `gs4d` command, run as a user runs it.
//!
//! In: command lines. Checked: exit codes, what is printed, what is written, that nothing panics; with `GS4D_DATA` set also that
//! renders match the original's.
#![cfg(feature = "cli")]

#[path = "common/data.rs"]
mod data;
#[path = "common/npz.rs"]
mod npz;
#[path = "common/skip.rs"]
mod skip;

use bevy_gs4d::offline::metrics;
use bevy_gs4d::renderer::GpuContext;
use bevy_gs4d::view::Picture;
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// What a run left behind.
struct Run {
    code: Option<i32>,
    out: String,
    err: String,
}

fn gs4d<S: AsRef<OsStr>>(arguments: &[S]) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_gs4d")).args(arguments).output().expect("the command starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Run { code: output.status.code(), out: text(&output.stdout), err: text(&output.stderr) }
}

impl Run {
    /// The text of a run that must have worked.
    fn text(self) -> String {
        assert_eq!(self.code, Some(0), "the command works: {}", self.err);
        self.out
    }

    /// The one JSON document of a run that must have worked.
    fn json(self) -> Value {
        serde_json::from_str(&self.text()).expect("exactly one JSON document")
    }

    /// That it failed cleanly and named this.
    fn must_fail(&self, name: &str) {
        assert_eq!(self.code, Some(2), "{name}: exit code 2; stdout {} stderr {}", self.out, self.err);
        assert!(self.err.contains("error:") && self.err.contains(name), "{name} is named: {}", self.err);
        assert!(!self.err.contains("panicked"), "{name}: no panic: {}", self.err);
    }
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn args<'a>(verb: &'a str, rest: &[&'a Path]) -> Vec<&'a OsStr> {
    std::iter::once(OsStr::new(verb)).chain(rest.iter().map(|path| path.as_os_str())).collect()
}

fn with<'a>(mut arguments: Vec<&'a OsStr>, more: &'a [&'a str]) -> Vec<&'a OsStr> {
    arguments.extend(more.iter().map(OsStr::new));
    arguments
}

/// A small scene in this folder.
fn scene(folder: &TempDir, count: &str) -> PathBuf {
    let path = folder.path().join("scene.gs4d");
    gs4d(&with(args("synth", &[&path]), &["--count", count])).text();
    path
}

fn no_gpu() -> bool {
    let none = GpuContext::adapters().is_empty();
    if none {
        skip::skip("no GPU adapter");
    }
    none
}

#[test]
fn conversion_keeps_what_it_should() {
    let folder = folder();
    let trained = scene(&folder, "700");
    let info = gs4d(&with(args("info", &[&trained]), &["--json"])).json();
    assert_eq!(info["gaussians"], 700, "the count asked for");
    assert_eq!(
        (&info["form"], &info["degree"], &info["degree_t"]),
        (&"trained".into(), &3.into(), &2.into()),
        "trained"
    );

    let copy = folder.path().join("copy.gs4d");
    gs4d(&args("convert", &[&trained, &copy])).text();
    let bytes = |path: &Path| fs::read(path).expect("the package is there");
    assert_eq!(bytes(&trained), bytes(&copy), "a plain conversion changes nothing");

    let small = folder.path().join("small.gs4d");
    let options = ["--form", "runtime", "--sh-degree", "0", "--up", "-y", "--background", "1,0.5,0", "--json", "-o"];
    let converted = gs4d(&[with(args("convert", &[&trained]), &options), vec![small.as_os_str()]].concat()).json();
    assert_eq!(converted["bytes_out"], bytes(&small).len(), "the size that is printed");
    let info = gs4d(&with(args("info", &[&small]), &["--json"])).json();
    assert_eq!(
        (&info["form"], &info["degree"], &info["coefficients"]),
        (&"runtime".into(), &0.into(), &1.into()),
        "small"
    );
    assert_eq!(info["switches"]["playback"]["up"], "neg_y", "the axis is stored");
    assert_eq!(info["switches"]["trained_with"]["background"][1], 0.5, "the background is stored");
    assert_eq!(info["package"]["intact"], true, "checksums hold");

    let back = folder.path().join("back.gs4d");
    gs4d(&with(args("convert", &[&small, &back]), &["--form", "trained"])).must_fail("small.gs4d");
    assert!(!back.exists(), "nothing is written");
}

#[test]
fn a_package_knows_how_it_was_trained() {
    let folder = folder();
    let path = scene(&folder, "50");
    gs4d(&with(args("info", &[&path]), &["--time-interval", "0,10"])).must_fail("--time-interval");
    gs4d(&with(args("info", &[&path]), &["--time-interval", "0,1"])).text();
}

#[test]
fn people_get_text() {
    const VERBS: [&str; 12] =
        ["info", "convert", "render", "compare", "synth", "bench", "score", "prune", "mask", "eval", "ablate", "bake"];
    let folder = folder();
    let path = scene(&folder, "50");
    let text = gs4d(&args("info", &[&path])).text();
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
        gs4d(&args("info", &[&path])).must_fail(name);
        gs4d(&args("convert", &[&path, &out])).must_fail(name);
        gs4d(&with(args("bench", &[&path]), &["--frames", "1"])).must_fail(name);
        assert!(!out.exists(), "{name}: nothing is written");
        let json = gs4d(&with(args("info", &[&path]), &["--json"]));
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
    gs4d(&args("info", &[&nowhere])).must_fail("nowhere.pth");
    gs4d(&args("convert", &[&path, &path])).must_fail("scene.gs4d");
    let roundabout = folder.path().join(".").join("scene.gs4d");
    gs4d(&args("convert", &[&path, &roundabout])).must_fail("scene.gs4d");
    assert_eq!(fs::read(&path).expect("still there"), before, "the input is as it was");

    let inside_a_file = path.join("out.gs4d");
    gs4d(&args("convert", &[&path, &inside_a_file])).must_fail("out.gs4d");
    gs4d(&args("synth", &[&inside_a_file])).must_fail("out.gs4d");
    gs4d(&with(args("render", &[&path]), &["--cameras", "gone.json", "--out", "frames"])).must_fail("gone.json");
    gs4d(&args("convert", &[&path, &nowhere])).must_fail("nowhere.pth");
    gs4d(&args("compare", &[&path, folder.path()])).must_fail("scene.gs4d");
    let left = fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(left, 1, "no file stays behind");
}

#[cfg(target_os = "linux")]
#[test]
fn paths_need_not_be_unicode() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder();
    let path = folder.path().join(OsStr::from_bytes(b"sc\xff\xfene.gs4d"));
    gs4d(&with(args("synth", &[&path]), &["--count", "20"])).text();
    let info = gs4d(&with(args("info", &[&path]), &["--json"])).json();
    assert_eq!(info["gaussians"], 20, "read back");
    let gone = folder.path().join(OsStr::from_bytes(b"g\xffne.pth"));
    gs4d(&args("info", &[&gone])).must_fail("ne.pth");
}

#[test]
fn usage_errors_name_the_option() {
    for (arguments, name) in [
        (&["info"][..], "FILE"),
        (&["frobnicate"], "frobnicate"),
        (&["synth", "x.gs4d", "--count", "0"], "--count"),
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
fn comparison_tells_equal_from_different() {
    let (a, b) = (folder(), folder());
    let size = UVec2::new(24, 16);
    let save = |folder: &TempDir, name: &str, value: f32| {
        let picture = Picture::filled(size, Vec3::splat(value));
        picture.to_rgb8().save(folder.path().join(name)).expect("the folder can be written to");
    };
    save(&a, "same.png", 0.2);
    save(&b, "same.png", 0.2);
    save(&a, "other.png", 0.2);
    save(&b, "other.png", 0.4);
    save(&a, "alone.png", 0.1);
    let json = gs4d(&with(args("compare", &[a.path(), b.path()]), &["--json"])).json();
    let row = |name: &str| {
        let pictures = json["pictures"].as_array().expect("a list of pictures");
        pictures.iter().find(|row| row["name"] == name).expect("the picture is listed").clone()
    };
    assert!(row("same")["psnr"].is_null(), "infinite");
    assert!((row("same")["ssim"].as_f64().expect("a number") - 1.0).abs() < 1e-9, "identical");
    // 51 and 102 of 255: a difference of exactly one fifth.
    let psnr = row("other")["psnr"].as_f64().expect("a number");
    assert!((psnr - 13.979_4).abs() < 1e-3, "20 log10(5), not {psnr}");
    assert_eq!(json["only_in_a"][0], "alone", "what has no partner is listed");

    let one = a.path().join("same.png");
    let text = gs4d(&args("compare", &[&one, &b.path().join("other.png")])).text();
    assert!(text.contains("13.979"), "two files: {text}");
    save(&a, "same.jpg", 0.2);
    gs4d(&args("compare", &[a.path(), b.path()])).must_fail("same.");
    gs4d(&args("compare", &[b.path(), folder().path()])).must_fail("no two pictures");
    gs4d(&args("compare", &[&one, b.path()])).must_fail("not a folder");
}

#[test]
fn raw_pictures_need_their_size() {
    let folder = folder();
    let path = folder.path().join("a.f32");
    let picture = Picture::filled(UVec2::new(16, 12), Vec3::new(-0.5, 0.5, 1.5));
    fs::write(&path, picture.to_raw()).expect("the folder can be written to");
    gs4d(&args("compare", &[&path, &path])).must_fail("--size");
    gs4d(&with(args("compare", &[&path, &path]), &["--size", "16x13"])).must_fail("a.f32");
    let json = gs4d(&with(args("compare", &[&path, &path]), &["--size", "16x12", "--json"])).json();
    assert_eq!(json["pictures"][0]["psnr_pooled"], Value::Null, "identical: infinite");
    let png = folder.path().join("a.png");
    picture.clamped().to_rgb8().save(&png).expect("the folder can be written to");
    let json = gs4d(&with(args("compare", &[&path, &png]), &["--size", "16x12", "--json"])).json();
    let psnr = json["pictures"][0]["psnr_pooled"].as_f64().expect("0.5 is no 8-bit value");
    assert!(psnr > 50.0, "clamped against 8 bits: {psnr}");
}

#[test]
fn pictures_are_drawn_and_written() {
    if no_gpu() {
        return;
    }
    let folder = folder();
    let (path, frames) = (scene(&folder, "3000"), folder.path().join("deep/frames"));
    let options = ["--orbit", "3", "--size", "64x48", "--raw", "--checks", "--json", "--out"];
    let json = gs4d(&[with(args("render", &[&path]), &options), vec![frames.as_os_str()]].concat()).json();
    let list = json["frames"].as_array().expect("a list of frames");
    assert_eq!(list.len(), 3, "as many as asked for");
    assert_eq!((&list[0]["time"], &list[2]["time"]), (&0.0.into(), &1.0.into()), "time runs through the interval");
    for index in 0..3 {
        let raw = raw_picture(&frames.join(format!("orbit_{index:04}.f32")), UVec2::new(64, 48));
        let png = image::open(frames.join(format!("orbit_{index:04}.png"))).expect("a picture").into_rgb8();
        assert_eq!(png, raw.to_rgb8(), "both are the same picture");
        let lit = raw.pixels.iter().filter(|pixel| pixel.max_element() > 0.1).count();
        assert!(lit > 64 * 48 / 50, "the scene is in the picture: {lit} pixels");
    }
    let alike = gs4d(&with(args("compare", &[&frames, &frames]), &["--size", "64x48", "--json"])).json();
    assert_eq!(alike["pictures"].as_array().map(Vec::len), Some(3), "raw pictures go before others of their name");
    assert!(alike["mean"]["psnr"].is_null(), "equal to themselves");
}

#[test]
fn benchmarks_measure() {
    if no_gpu() {
        return;
    }
    let folder = folder();
    let path = scene(&folder, "1000");
    let options = ["--frames", "3", "--views", "2", "--times", "2", "--size", "64x64"];
    let json = gs4d(&[with(args("bench", &[&path]), &options), vec![OsStr::new("--json")]].concat()).json();
    assert_eq!((&json["views"], &json["timings"]["frames"]), (&4.into(), &3.into()), "two views at two times");
    assert!(json["timings"]["wall_milliseconds"].as_f64().is_some_and(|ms| ms > 0.0), "frames take time");
    assert!(gs4d(&with(args("bench", &[&path]), &options)).text().contains("frame, many in flight"), "a table");
    gs4d(&with(args("bench", &[&path]), &["--adapter", "no such card"])).must_fail("no such card");
}

fn raw_picture(path: &Path, size: UVec2) -> Picture {
    let bytes = fs::read(path).expect("the raw picture is there");
    assert_eq!(bytes.len(), size.x as usize * size.y as usize * 12, "height x width x 3 float32");
    let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Picture { size, pixels: values.chunks_exact(3).map(Vec3::from_slice).collect() }
}

#[test]
fn real_captures_match_the_original() {
    let Some(data) = data::data() else { return };
    if no_gpu() {
        return;
    }
    for (checkpoint, golden) in [
        ("toybox/toybox_chkpnt.pth", "toybox/golden_vanilla"),
        ("toybox/toybox_4dgs1k.pth", "toybox/golden_4dgs1k"),
        ("toybox/toybox_45k.pth", "toybox/golden_45k"),
        ("standup/standup_chkpnt.pth", "standup/standup_golden"),
    ] {
        let out = folder();
        let cameras = data.join(format!("{golden}.json"));
        let scene = data.join(checkpoint);
        let paths = [OsStr::new("--cameras"), cameras.as_os_str(), OsStr::new("--out"), out.path().as_os_str()];
        gs4d(&[with(args("render", &[&scene]), &["--raw"]), paths.to_vec()].concat()).text();
        let views: Value =
            serde_json::from_slice(&fs::read(&cameras).expect("the cameras are there")).expect("cameras are JSON");
        let truth = npz::pictures(&data.join(format!("{golden}.npz")), "images");
        let views = views["views"].as_array().expect("a list of views");
        assert_eq!(views.len(), truth.len(), "{golden}: a picture for each view");
        for (view, truth) in views.iter().zip(&truth) {
            let name = Path::new(view["file"].as_str().expect("a file")).file_stem().expect("a stem");
            let drawn = raw_picture(&out.path().join(name).with_extension("f32"), truth.size);
            let psnr = metrics::psnr_pooled(&drawn, truth).expect("one size");
            eprintln!("{checkpoint} {}: {psnr:.2} dB", name.display());
            assert!(psnr >= 75.0, "{checkpoint} {}: {psnr:.2} dB", name.display());
        }
    }
}
