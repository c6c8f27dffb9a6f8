//! Commands that take a capture, on files of other makes.
//!
//! In: exports of a small synthetic scene, and pictures of one of them. Out: proof that `info`, `convert`, `compress`,
//! `mask`, `bench` and `bake` take these files as they take packages, that a file whose Gaussians have windows of time
//! is masked by these alone, that cameras with intrinsics see an import as it is, and that places on a map keep their
//! digits.

use crate::support::command::{arguments, folder, gs4d, has_gpu, scene};
use crate::support::dataset;
use bevy_gs4d::codec::{ReadOptions, load};
use bevy_gs4d::reference;
use bevy_gs4d::scene::{RuntimeScene, SceneForm};
use bevy_gs4d::view::{Camera, Lens, RasterFov};
use glam::{Mat4, UVec2, Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::f32::consts::TAU;
use std::ffi::OsString;
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
    if !has_gpu() {
        return;
    }
    let folder = folder();
    for path in exports(&folder, &["a.spz", "a.sogst"]) {
        let views = ["--frames", "2", "--orbit", "1", "--size", "32x24", "--json"].map(Into::into);
        let report = gs4d(&[&arguments!["bench", &path][..], &views[..]].concat()).json();
        let visible = report["rows"][0]["timings"]["counts"]["visible"].as_f64();
        assert!(visible.is_some_and(|visible| visible > 0.0), "splats are drawn: {report}");
    }
}

/// Writes a dataset of nerfstudio: pictures of a still scene by ten cameras with focal lengths and a principal point.
fn pictures(data: &Path, scene: &RuntimeScene) {
    let (size, center) = (UVec2::new(96, 64), Vec2::new(48.0, 32.0));
    let lens = Lens::Intrinsics { focal: Vec2::splat(90.0), center };
    fs::create_dir_all(data.join("images")).expect("the folder can be made");
    let mut frames = Vec::new();
    for index in 0..10_u8 {
        let angle = f32::from(index) * TAU / 10.0;
        let eye = Vec3::new(3.5 * angle.cos(), 3.5 * angle.sin(), 1.8);
        let camera = Camera { lens, ..Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 1.0, size) };
        let name = format!("images/{index:02}.png");
        let view = camera.view(0.0, RasterFov::Corrected);
        let picture = reference::render(scene, &view, scene.trained_background()).picture;
        picture.to_rgb8().save(data.join(&name)).expect("the folder can be written to");
        let to_world = camera.world_to_camera.inverse() * Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
        let rows: Vec<[f32; 4]> = (0..4).map(|row| to_world.row(row).to_array()).collect();
        frames.push(json!({ "file_path": name, "transform_matrix": rows }));
    }
    let json = json!({
        "camera_model": "PINHOLE", "w": size.x, "h": size.y, "fl_x": 90.0, "fl_y": 90.0, "cx": center.x, "cy": center.y,
        "frames": frames,
    });
    fs::write(data.join("transforms.json"), json.to_string()).expect("the folder can be written to");
}

#[test]
fn cameras_with_intrinsics_see_an_import_as_it_is() {
    let folder = folder();
    let path = exports(&folder, &["a.ply"]).remove(0);
    let data = folder.path().join("data");
    let scene = load(&path, &ReadOptions::default()).expect("a PLY").into_runtime().expect("it can be drawn");
    pictures(&data, &scene);
    let psnr = |more: &[&str]| {
        let more: Vec<OsString> = more.iter().map(Into::into).collect();
        let arguments = arguments!["eval", &path, "--data", &data, "--metrics", "psnr", "--engine", "cpu", "--json"];
        let report = gs4d(&[arguments.to_vec(), more].concat()).json();
        report["mean"]["psnr"].as_f64().unwrap_or_else(|| panic!("a number in {report}"))
    };
    let found = psnr(&[]);
    assert!(found > 58.5, "only the rounding to 8 bits differs: {found} dB");
    let placeholder = psnr(&["--raster-fov", "reference"]);
    assert!(placeholder < 40.0, "the placeholder of the original trainer is an option: {placeholder} dB");
}

/// Returns the means of a still capture.
fn means(path: &Path) -> Vec<[f32; 3]> {
    match load(path, &ReadOptions::default()).expect("a capture").form {
        SceneForm::Trained(trained) => trained.parameters.mean,
        SceneForm::Ready(_) => panic!("a still has the trained form"),
    }
}

#[test]
fn places_on_a_map_keep_their_digits() {
    let folder = folder();
    let [path, package, again, other] =
        ["map.ply", "map.gs4d", "again.ply", "other.splat"].map(|name| folder.path().join(name));
    let places = [[500_001.05, 5_400_000.5, 310.4], [499_999.25, 5_400_000.7, 309.4], [500_000.45, 5_400_001.1, 309.8]];
    let names = "f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let rows: String =
        places.iter().map(|[x, y, z]: &[f64; 3]| format!("{x} {y} {z} 1 0 0 4 -2.5 -2.5 -2.5 1 0 0 0\n")).collect();
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n";
    fs::write(&path, format!("{header}{properties}end_header\n{rows}")).expect("the folder can be written to");

    let shown = gs4d(&arguments!["info", &path]);
    assert!(shown.err.contains("single precision has steps of 0.5 units"), "the reason is stated: {}", shown.err);
    assert!(shown.text().contains("(500000, 5400001, 310)"), "the origin is shown");
    gs4d(&arguments!["convert", &path, &package]).text();
    let origin = info(&package)["switches"]["trained_with"]["origin"]["place"].clone();
    assert_eq!(origin, json!([500_000.0, 5_400_001.0, 310.0]), "a package keeps it");
    let text = gs4d(&arguments!["export", &package, &again]).text();
    assert!(!text.contains("left out"), "nothing is lost: {text}");
    assert_eq!(means(&again), means(&path), "an export has the places of the file");
    let written = fs::read(&again).expect("the file is there");
    let place = written.windows(11).position(|window| window == b"end_header\n").expect("a header") + 11;
    let x = written[place..].first_chunk().map(|bytes| f64::from_le_bytes(*bytes)).expect("a number");
    assert!((x - 500_001.05).abs() < 1e-6, "in double precision: {x}");
    let text = gs4d(&arguments!["export", &package, &other]).text();
    assert!(text.contains("(500000, 5400001, 310)") && text.contains("left out"), "no origin in .splat: {text}");
}
