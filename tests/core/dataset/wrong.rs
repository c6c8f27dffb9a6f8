//! Invalid camera files and options.
//!
//! In: camera files with invalid entries, random values and random bytes. Out: proof that each gives an error that
//! names the file, and no panic.

use std::ffi::OsStr;
use std::path::Path;

use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions, Dataset, DatasetError, MAX_SIDE, Split, TrainingView};
use glam::UVec2;
use proptest::prelude::*;
use proptest::sample::subsequence;
use serde_json::{Value, json};

use super::{Folder, golden, identity, lens_values, load, resolution_option, transforms, with};
use crate::support::skip::skip;

#[test]
fn invalid_entries_are_errors_that_name_file_frame_and_reason() {
    let singular = json!([[1, 0, 0, 0], [2, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    let projective = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]);
    let two_rows = json!([[1, 0, 0, 0], [0, 1, 0, 0]]);
    let mirrored = json!([[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    let cases = [
        ("/frames/0/transform_matrix", singular, "cannot be inverted"),
        ("/frames/0/transform_matrix", projective, "0 0 0 1"),
        ("/frames/0/transform_matrix", two_rows, "four rows"),
        ("/frames/0/transform_matrix", mirrored, "mirrors"),
        ("/frames/0/transform_matrix", Value::Null, "four rows"),
        ("/frames/0/transform_matrix/0/0", Value::Null, "null"),
        ("/frames/0/transform_matrix/0/3", json!(1e300), "float32"),
        ("/frames/0/time", json!(1e300), "time"),
        ("/frames/0/time", json!("soon"), "soon"),
        ("/frames/0/file_path", json!(".."), "names no file"),
        ("/frames/0/file_path", json!(""), "names no file"),
        ("/frames/0/w", json!(0), "0x400"),
        ("/frames/0/w", json!(1e12), "16384"),
        ("/frames/0/h", json!(2.5), "whole number"),
        ("/camera_angle_x", json!(0), "camera_angle_x is 0"),
        ("/camera_angle_x", json!(3.2), "camera_angle_x is 3.2"),
        ("/camera_angle_x", json!(1e-60), "lens"),
        ("/camera_angle_x", Value::Null, "no lens"),
    ];
    for (pointer, value, reason) in cases {
        let error =
            load(&with(transforms(), pointer, value), &CameraOptions::default()).expect_err(pointer).to_string();
        for part in ["transforms_test.json", "frame 0", reason] {
            assert!(error.contains(part), "{pointer}: {part:?} is not in: {error}");
        }
    }
}

#[test]
fn cameras_that_project_to_infinity_are_named() {
    let shared = with(with(transforms(), "/fl_x", json!(900.0)), "/fl_y", json!(880.0));
    let shared = with(with(shared, "/cx", json!(410.0)), "/cy", json!(190.0));
    assert!(load(&shared, &CameraOptions::default()).is_ok(), "the unchanged camera is valid");
    for (pointer, value) in [("/cy", -3.4e38), ("/cx", 3.4e38), ("/fl_x", 3e38), ("/fl_y", 1e-38)] {
        let changed = with(shared.clone(), pointer, json!(value));
        let message = load(&changed, &CameraOptions::default()).expect_err(pointer).to_string();
        for part in ["transforms_test.json", "frame 0", "\"a\"", "not finite"] {
            assert!(message.contains(part), "{pointer}: {part:?} is not in: {message}");
        }
    }
}

#[test]
fn distorted_pictures_are_refused_by_the_name_of_the_entry() {
    let refused = |json: &Value, parts: &[&str], what: &str| {
        let message = load(json, &CameraOptions::default()).expect_err(what).to_string();
        for part in [&["transforms_test.json", "frame 0", "undistort"], parts].concat() {
            assert!(message.contains(part), "{what}: {part:?} is not in: {message}");
        }
    };
    let undone = ["k1", "k2", "k3", "k4", "p1", "p2"];
    let entries = ["k5", "k6", "rolling_shutter", "ftheta_p0", "ftheta_p4", "distortion_params", "is_fisheye"];
    for name in [&entries[..], &undone].concat() {
        for place in ["", "/frames/0"] {
            let pointer = format!("{place}/{name}");
            for value in [json!(0.01), json!(-1e-3), json!([0, 0, 0.1]), json!(true), json!("none"), json!({"a": 0})] {
                let what = format!("{pointer} is {value}");
                let changed = with(transforms(), &pointer, value.clone());
                if undone.contains(&name) && value.is_number() {
                    assert!(load(&changed, &CameraOptions::default()).is_ok(), "{what}: it is undone");
                    let pinhole = with(changed, "/camera_model", json!("PINHOLE"));
                    refused(&pinhole, &[&format!("{name} is not 0")], &format!("{what} of a pinhole camera"));
                } else {
                    refused(&changed, &[&format!("{name} is not 0")], &what);
                }
            }
            for value in [json!(0), json!(-0.0), json!([0, 0.0, 0]), json!([]), json!(false), Value::Null] {
                let what = format!("{pointer} is {value}");
                assert!(load(&with(transforms(), &pointer, value), &CameraOptions::default()).is_ok(), "{what}");
            }
        }
    }
    // An entry of a frame replaces the entry of the file.
    let own = with(with(transforms(), "/k5", json!(0.1)), "/frames/0/k5", json!(0));
    assert!(load(&own, &CameraOptions::default()).is_ok(), "the frame has no such distortion");
    let own = with(with(transforms(), "/k5", json!(0)), "/frames/0/k5", json!(0.1));
    refused(&own, &["k5 is not 0"], "the frame is distorted");
    refused(&with(transforms(), "/k1", json!(-50)), &["folds"], "a distortion that folds the picture");
}

#[test]
fn camera_models_that_cannot_be_undone_are_refused() {
    for place in ["", "/frames/0"] {
        let of = |model: Value| with(transforms(), &format!("{place}/camera_model"), model);
        for model in ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "pinhole", "SIMPLE_RADIAL", "RADIAL", "OPENCV_FISHEYE"] {
            assert!(load(&of(json!(model)), &CameraOptions::default()).is_ok(), "{model} without coefficients");
        }
        let tangential = with(of(json!("OPENCV_FISHEYE")), "/p2", json!(0.01));
        let message = load(&tangential, &CameraOptions::default()).expect_err("a coefficient").to_string();
        assert!(message.contains("p2 is not 0"), "a fisheye lens has no tangential coefficients: {message}");
        for model in [json!("ORTHOPHOTO"), json!("EQUIRECTANGULAR"), json!(""), json!("a\u{1b}[2J"), json!(3)] {
            let message = load(&of(model.clone()), &CameraOptions::default()).expect_err("no pinhole").to_string();
            let shown = model.as_str().unwrap_or("3").replace('\u{1b}', "\\u{1b}");
            for part in ["transforms_test.json", "camera_model", &shown, "undistort"] {
                assert!(message.contains(part), "{model}: {part:?} is not in: {message}");
            }
            assert!(!message.contains('\u{1b}'), "control characters are escaped: {message:?}");
        }
    }
}

#[test]
fn golden_views_are_refused_if_they_are_distorted_or_off_center() {
    let changed = |name: &str, value: Value| with(golden(), &format!("/views/0/{name}"), value);
    for (name, value, reason) in [
        ("cx", json!(310.0), "cx is 310, and golden views have their principal point at the center, 320"),
        ("cy", json!(201), "cy is 201"),
        ("cy", json!(-1e300), "cy is -1"),
        ("cx", json!("left"), "left"),
        ("k1", json!(0.1), "k1 is not 0"),
        ("camera_model", json!("OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
    ] {
        let message = load(&changed(name, value), &CameraOptions::default()).expect_err(name).to_string();
        for part in ["frame 0", reason] {
            assert!(message.contains(part), "{name}: {part:?} is not in: {message}");
        }
    }
    for (name, value) in [("cx", json!(320.0004)), ("cy", Value::Null), ("k1", json!(0))] {
        let what = format!("{name} is {value}");
        assert!(load(&changed(name, value), &CameraOptions::default()).is_ok(), "{what}");
    }
}

#[test]
fn paths_with_control_characters_are_refused_and_shown_escaped() {
    let path = "a\u{1b}[2J\nb";
    for pointer in ["/frames/0/file_path", "/frames/0/mask_path"] {
        let changed = with(transforms(), pointer, json!(path));
        let message = load(&changed, &CameraOptions::default()).expect_err(pointer).to_string();
        assert!(message.contains("control characters"), "{message}");
        assert!(!message.contains(['\u{1b}', '\n']), "no control characters: {message:?}");
    }
}

#[test]
fn invalid_files_are_errors_that_name_them() {
    let folder = Folder::new();
    let cases = [
        (r#"{"frames": []}"#, "empty"),
        (r#"{"views": []}"#, "empty"),
        (r#"{"frames": 3}"#, "neither"),
        (r#"{"cameras": [1, 2]}"#, "neither"),
        ("[]", "neither"),
        ("3", "neither"),
        ("", "EOF"),
        (r#"{"frames": [{"file_path": "a", "time": NaN}]}"#, "line 1"),
        (r#"{"frames": [1e999]}"#, "range"),
        (r#"{"frames": [{}], "w": "wide"}"#, "wide"),
        (r#"{"frames": [{}]}"#, "file_path"),
        (r#"{"frames": [7]}"#, "frame 0"),
        (r#"{"views": [{"file": "a"}]}"#, "width"),
    ];
    for (text, reason) in cases {
        let error =
            CameraFile::load(&folder.write("bad.json", text), &CameraOptions::default()).expect_err(text).to_string();
        assert!(error.contains("bad.json") && error.contains(reason), "{text}: {reason:?} is not in: {error}");
    }
    let deep = "[".repeat(100_000);
    assert!(CameraFile::load(&folder.write("deep.json", deep), &CameraOptions::default()).is_err(), "bounded depth");
    let error = CameraFile::load(&folder.path().join("none.json"), &CameraOptions::default()).expect_err("no file");
    assert!(error.to_string().contains("none.json"), "{error}");
    let error = Dataset::open(folder.path(), Split::Test, &CameraOptions::default()).expect_err("no dataset");
    assert!(error.to_string().contains("transforms_test.json"), "{error}");
}

#[test]
fn unusable_options_are_errors() {
    for size in [UVec2::ZERO, UVec2::new(0, 5), UVec2::splat(u32::MAX)] {
        let error =
            load(&transforms(), &CameraOptions { size: Some(size), ..Default::default() }).expect_err("a bad size");
        assert!(matches!(error, DatasetError::Size { .. }), "{error}");
    }
    for resolution in [0, -2, i32::MIN, i32::MAX] {
        let error = load(&transforms(), &resolution_option(resolution)).expect_err("a bad resolution");
        assert!(matches!(error, DatasetError::Resolution { .. }), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn folder_names_need_not_be_utf8() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new();
    let name = Path::new(OsStr::from_bytes(b"sc\xffne"));
    if std::fs::create_dir(folder.path().join(name)).is_err() {
        skip("this file system takes UTF-8 names only");
        return;
    }
    let path = folder.write(name.join("transforms_test.json"), transforms().to_string());
    let views = CameraFile::load(&path, &CameraOptions::default()).expect("a valid camera file");
    assert_eq!(views[0].image, path.with_file_name("./a.png"), "the bytes of the folder name are kept");
}

/// Generates any small JSON value.
fn any_json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        "[./a-z]{0,8}".prop_map(Value::from),
        Just(identity()),
    ];
    leaf.prop_recursive(2, 16, 4, |inner| proptest::collection::vec(inner, 0..5).prop_map(Value::from))
}

/// Checks that the outcome is a usable list of views, or an error that names the file.
fn check_outcome(outcome: Result<Vec<TrainingView>, DatasetError>) -> Result<(), TestCaseError> {
    match outcome {
        Ok(views) => {
            prop_assert!(!views.is_empty(), "no views and no error");
            for view in views {
                let size = view.camera.size;
                prop_assert!(size.min_element() >= 1 && size.max_element() <= MAX_SIDE, "size {}", size);
                prop_assert!(view.camera.world_to_camera.is_finite() && view.time.is_finite(), "{:?}", view);
                prop_assert!(lens_values(&view).1.iter().all(|value| value.is_finite()), "{:?}", view.camera.lens);
                let name = Path::new(&view.name).file_name();
                prop_assert_eq!(name, Some(OsStr::new(&view.name)), "the name of a view is a plain file name");
            }
        }
        Err(error) => prop_assert!(error.to_string().contains("transforms_test.json"), "{}", error),
    }
    Ok(())
}

proptest! {
    #[test]
    fn random_values_anywhere_never_panic(
        file in subsequence(vec!["camera_angle_x", "w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "camera_model"], 0..5),
        entry in subsequence(
            vec!["file_path", "transform_matrix", "time", "mask_path", "w", "fl_x", "cy", "distortion_params"], 0..3
        ),
        values in proptest::collection::vec(any_json(), 8),
    ) {
        let mut json = transforms();
        let mut values = values.into_iter();
        for (prefix, keys) in [("", file), ("/frames/0", entry)] {
            for key in keys {
                json = with(json, &format!("{prefix}/{key}"), values.next().unwrap_or_default());
            }
        }
        check_outcome(load(&json, &CameraOptions::default()))?;
    }

    #[test]
    fn random_bytes_anywhere_never_panic(
        edits in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 0..6),
        end in any::<proptest::sample::Index>(),
        cut in any::<bool>(),
    ) {
        let mut bytes = transforms().to_string().into_bytes();
        for (index, byte) in edits {
            let position = index.index(bytes.len());
            bytes[position] = byte;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        let folder = Folder::new();
        check_outcome(CameraFile::load(&folder.write("transforms_test.json", bytes), &CameraOptions::default()))?;
    }
}
