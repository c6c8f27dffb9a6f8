//! Datasets.
//!
//! In: small camera files and images written to temporary folders; with `GS4D_DATA` set, trained captures. Out: proof
//! that cameras in every form and their sizes are read as in the original. The modules test images ([`images`]),
//! invalid files ([`wrong`]), trained captures ([`captures`]), other formats ([`formats`]), folders, names and models
//! of COLMAP ([`colmap`]), datasets written by other programs ([`independent`]), variants of camera files
//! ([`variants`]) and datasets far from 0 ([`origins`]);
//! and the formats of Nerfies ([`nerfies`]), Technicolor ([`technicolor`]), LLFF ([`llff`]) and Google Immersive
//! ([`immersive`]), with cameras that look at the origin ([`looking`]); of `PanopticSports` ([`panoptic`]), `EasyVolcap`
//! ([`easyvolcap`]) and `ZJU-MoCap` ([`zju`]); of Pose2Sim and Qualisys ([`pose2sim`]), of scans of telephones
//! ([`telephones`]), and matrices of lenses ([`matrices`]).

mod captures;
mod colmap;
mod easyvolcap;
mod formats;
mod images;
mod immersive;
mod independent;
mod llff;
mod looking;
mod matrices;
mod nerfies;
mod origins;
mod panoptic;
mod pose2sim;
mod technicolor;
mod telephones;
mod variants;
mod wrong;
mod zju;

use std::fs;
use std::path::{Path, PathBuf};

use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions, Dataset, DatasetError, Split, TrainingView};
use bevy_gs4d::view::Lens;
use glam::{Mat4, UVec2, Vec3, Vec4};
use image::RgbImage;
use serde_json::{Value, json};

/// Returns bytes of a linear congruential generator.
fn noise(count: usize, mut state: u32) -> Vec<u8> {
    let next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    std::iter::repeat_with(next).take(count).collect()
}

/// A dataset folder that is deleted when this is dropped.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: impl AsRef<Path>, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().expect("inside the folder")).expect("a subfolder");
        fs::write(&path, text).expect("a small file");
        path
    }

    fn write_json(&self, name: &str, json: &Value) -> PathBuf {
        self.write(name, json.to_string())
    }

    fn write_rgb(&self, name: &str, width: u32, height: u32) {
        let bytes = noise((width * height * 3) as usize, 7);
        let image = RgbImage::from_raw(width, height, bytes).expect("enough bytes");
        image.save(self.path().join(name)).expect("an image");
    }
}

fn identity() -> Value {
    json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
}

fn frame(file: &str) -> Value {
    json!({"file_path": file, "transform_matrix": identity()})
}

/// Returns a Blender file of one frame, 800x400, whose entries can be changed.
fn transforms() -> Value {
    json!({"camera_angle_x": 0.8, "w": 800, "h": 400, "frames": [frame("./a")]})
}

/// Returns a golden file of one view, 640x400.
fn golden() -> Value {
    json!({"background": [0, 0, 0], "views": [{
        "file": "./images/c04_f20.jpg", "time": 0.5, "width": 640, "height": 400, "fl_x": 320.0, "fl_y": 400.0,
        "cx": 320.0, "cy": 200.0, "world_to_camera_opencv": [[1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]],
    }]})
}

/// Returns the JSON with the value at a pointer replaced, or added to an object.
fn with(mut json: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').expect("a JSON pointer");
    match json.pointer_mut(parent).expect("the parent exists") {
        Value::Array(items) => items[key.parse::<usize>().expect("an index")] = value,
        object => object[key] = value,
    }
    json
}

fn load(json: &Value, options: &CameraOptions) -> Result<Vec<TrainingView>, DatasetError> {
    let folder = Folder::new();
    CameraFile::load(&folder.write_json("transforms_test.json", json), options)
}

fn load_one(json: &Value, options: &CameraOptions) -> TrainingView {
    load(json, options).expect("a valid camera file").remove(0)
}

/// Returns whether a view has a FoV camera, and its tangents, or the focal lengths and the principal point of an
/// intrinsics camera.
fn lens_values(view: &TrainingView) -> (bool, Vec<f32>) {
    match view.camera.lens {
        Lens::Fov { tan } => (true, tan.to_array().to_vec()),
        Lens::Intrinsics { focal, center } => (false, vec![focal.x, focal.y, center.x, center.y]),
    }
}

#[track_caller]
fn assert_lens(view: &TrainingView, fov: bool, expected: &[f32]) {
    let (is_fov, values) = lens_values(view);
    let close =
        values.len() == expected.len() && values.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1e-5 * b.abs());
    assert!(is_fov == fov && close, "{:?} instead of {expected:?}", view.camera.lens);
}

fn size_option(width: u32, height: u32) -> CameraOptions {
    CameraOptions { size: Some(UVec2::new(width, height)), ..Default::default() }
}

fn resolution_option(resolution: i32) -> CameraOptions {
    CameraOptions { resolution: Some(resolution), ..Default::default() }
}

#[test]
fn opengl_pose_becomes_opencv_world_to_camera() {
    let pose = json!([[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]);
    let view = load_one(&with(transforms(), "/frames/0/transform_matrix", pose), &CameraOptions::default());
    let expected = Mat4::from_cols(Vec4::X, -Vec4::Y, -Vec4::Z, Vec4::new(-1.0, 2.0, 3.0, 1.0));
    assert_eq!(view.camera.world_to_camera, expected, "y and z are negated");
    let ahead = view.camera.world_to_camera.transform_point3(Vec3::new(1.0, 2.0, 0.0));
    assert_eq!(ahead, Vec3::new(0.0, 0.0, 3.0), "three units ahead, along −z of OpenGL");
}

#[test]
fn frames_keep_order_names_times_and_paths() {
    let mut frames = ["./test/r_000", "images/c04.JPG", "cam00/frame.001", "other/r_000"].map(frame);
    for (index, frame) in frames.iter_mut().enumerate() {
        frame["time"] = json!(if index == 1 { 0.25 } else { 0.0 });
    }
    frames[1]["mask_path"] = json!("./masks/c04.png");
    let folder = Folder::new();
    let path = folder.write_json("transforms_test.json", &with(transforms(), "/frames", json!(frames)));
    let views = CameraFile::load(&path, &CameraOptions::default()).expect("a valid camera file");
    let names: Vec<_> = views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, ["r_000", "c04", "frame.001", "r_000-3"], "stems, with a repeated stem made unique");
    let times: Vec<_> = views.iter().map(|view| view.time).collect();
    assert_eq!(times, [0.0, 0.25, 0.0, 0.0], "the times of the frames");
    let images = ["./test/r_000.png", "images/c04.JPG", "cam00/frame.001.png", "other/r_000.png"];
    for (view, image) in views.iter().zip(images) {
        assert_eq!(view.image, folder.path().join(image), "next to the camera file");
    }
    assert_eq!(views[1].mask, Some(folder.path().join("./masks/c04.png")), "mask_path");
    assert_eq!(views[0].mask, None, "no mask_path");
}

#[test]
fn field_of_view_comes_from_the_original_size() {
    let tan = 0.4f32.tan();
    for resolution in [1, 2, 3, 8, -1, 100] {
        let view = load_one(&transforms(), &resolution_option(resolution));
        assert_lens(&view, true, &[tan, tan / 2.0]);
    }
    assert_eq!(load_one(&transforms(), &resolution_option(3)).camera.size, UVec2::new(267, 133), "rounded");
}

#[test]
fn intrinsics_follow_resolution_and_size() {
    let shared = with(transforms(), "/fl_x", json!(900.0));
    let shared = with(with(with(shared, "/fl_y", json!(880)), "/cx", json!(410)), "/cy", json!(190.0));
    assert_lens(&load_one(&shared, &CameraOptions::default()), false, &[900.0, 880.0, 410.0, 190.0]);
    assert_lens(&load_one(&shared, &resolution_option(2)), false, &[450.0, 440.0, 205.0, 95.0]);
    let stretched = load_one(&shared, &size_option(400, 100));
    assert_lens(&stretched, false, &[450.0, 220.0, 205.0, 47.5]);
    assert_eq!(stretched.camera.size, UVec2::new(400, 100), "the requested size");
    let per_frame = with(shared, "/frames/0/fl_x", json!(1000));
    assert_lens(&load_one(&per_frame, &CameraOptions::default()), false, &[1000.0, 880.0, 410.0, 190.0]);
    let incomplete = with(transforms(), "/fl_x", json!(900));
    assert_lens(&load_one(&incomplete, &CameraOptions::default()), true, &[0.4f32.tan(), 0.4f32.tan() / 2.0]);
}

#[test]
fn the_picture_size_comes_from_the_option_the_file_or_the_first_image() {
    let frames_only = json!({"camera_angle_x": 0.8, "frames": [frame("missing"), frame("b")]});
    let folder = Folder::new();
    let test = folder.write_json("transforms_test.json", &frames_only);
    let sizes = |options: &CameraOptions| {
        CameraFile::load(&test, options).map(|views| views.iter().map(|view| view.camera.size).collect::<Vec<_>>())
    };
    let error = sizes(&CameraOptions::default()).expect_err("no size anywhere").to_string();
    assert!(error.contains("add them") && error.contains("transforms_test.json"), "{error}");
    assert_eq!(sizes(&size_option(70, 50)).expect("a size"), [UVec2::new(70, 50); 2], "the option");

    // A sibling split with an image, after a sibling that is not JSON.
    folder.write("transforms_val.json", "{");
    folder.write_json("transforms_train.json", &json!({"frames": [frame("c")]}));
    folder.write_rgb("c.png", 40, 24);
    assert_eq!(
        sizes(&CameraOptions::default()).expect("a size"),
        [UVec2::new(40, 24); 2],
        "the image of another split"
    );

    folder.write_rgb("b.png", 20, 10);
    assert_eq!(sizes(&CameraOptions::default()).expect("a size"), [UVec2::new(20, 10); 2], "the first image found");
    assert_eq!(sizes(&resolution_option(2)).expect("a size"), [UVec2::new(10, 5); 2], "after the resolution");
    assert_eq!(sizes(&size_option(70, 50)).expect("a size"), [UVec2::new(70, 50); 2], "the option has precedence");

    let per_frame = with(with(frames_only, "/frames/0/w", json!(64.0)), "/frames/0/h", json!(32));
    folder.write_json("transforms_test.json", &per_frame);
    let expected = [UVec2::new(64, 32), UVec2::new(20, 10)];
    assert_eq!(
        sizes(&CameraOptions::default()).expect("a size"),
        expected,
        "the size of a frame overrides the size of the image"
    );
}

#[test]
fn an_unreadable_image_is_an_error_only_if_the_size_depends_on_it() {
    let folder = Folder::new();
    let path = folder.write_json("transforms_test.json", &json!({"camera_angle_x": 0.8, "frames": [frame("a")]}));
    folder.write("a.png", "not an image");
    let error = CameraFile::load(&path, &CameraOptions::default()).expect_err("no size").to_string();
    assert!(error.contains("a.png"), "{error}");
    assert!(CameraFile::load(&path, &size_option(8, 8)).is_ok(), "the size is given");
}

#[test]
fn frames_outside_the_interval_are_dropped() {
    let frames = [0.0, 0.5, 1.0, 1.5].map(|time| with(frame("a"), "/time", json!(time)));
    let json = with(transforms(), "/frames", json!(frames));
    let interval = |start, end| CameraOptions { time_interval: Some([start, end]), ..Default::default() };
    let times = |options| load(&json, &options).map(|views| views.iter().map(|view| view.time).collect::<Vec<_>>());
    assert_eq!(times(CameraOptions::default()).expect("views").len(), 4, "without an interval no frame is dropped");
    assert_eq!(times(interval(0.5, 1.0)).expect("views"), [0.5, 1.0], "ends included");
    let error = times(interval(2.0, 3.0)).expect_err("no frame is left").to_string();
    assert!(error.contains("2,3") && error.contains("0 to 1.5"), "{error}");
}

#[test]
fn golden_views_are_fov_cameras_of_their_own_size() {
    let golden = golden();
    for options in [CameraOptions::default(), resolution_option(2)] {
        let view = load_one(&golden, &options);
        assert_eq!((view.name.as_str(), view.time), ("c04_f20", 0.5), "name and time");
        assert_eq!(view.camera.size, UVec2::new(640, 400), "the size is not reduced");
        assert_eq!(
            view.camera.world_to_camera,
            Mat4::from_translation(Vec3::new(4.0, 5.0, 6.0)),
            "the axes are not changed"
        );
        assert_lens(&view, true, &[1.0, 0.5]);
    }
    let other = load_one(&golden, &size_option(64, 64));
    assert_eq!(other.camera.size, UVec2::new(64, 64), "the requested size");
    assert_lens(&other, true, &[1.0, 0.5]);
}

#[test]
fn the_test_split_of_lego_is_val() {
    let folder = Folder::new();
    for (split, name) in [("test", "t"), ("val", "v"), ("train", "n")] {
        for scene in ["lego", "hook"] {
            let json = with(transforms(), "/frames/0/file_path", json!(name));
            folder.write(format!("{scene}/transforms_{split}.json"), json.to_string());
        }
    }
    let first = |scene: &str, split| {
        let dataset = Dataset::open(&folder.path().join(scene), split, &CameraOptions::default()).expect("a dataset");
        dataset.views[0].name.clone()
    };
    assert_eq!(first("lego", Split::Test), "v", "val replaces test");
    assert_eq!(first("lego", Split::Train), "n", "train is not replaced");
    assert_eq!(first("hook", Split::Test), "t", "other scenes use their test split");
}
