//! Datasets of Nerfies, `HyperNeRF` and `DyCheck`.
//!
//! In: small folders made here, of cameras that look at the origin of the normalized scene. Out: proof that cameras and points are normalized, that
//! moments become times, and that `val_ids` are for the test.

use super::Folder;
use super::formats::{names, open, picture, refused, times};
use super::looking::Looking;
use super::with;
use bevy_gs4d::internal::offline::dataset::{PointCloud, Summary};
use bevy_gs4d::offline::dataset::{CameraOptions, Correction, Dataset, Split};
use bevy_gs4d::scene::Origin;
use glam::{UVec2, Vec3};
use serde_json::{Value, json};

const FOCAL: f64 = 100.0;
/// Height of a pixel by its width, so that the vertical focal length is 104.
const ASPECT: f64 = 1.04;
const CENTER: [f64; 2] = [38.0, 33.0];
const SCENE_CENTER: [f64; 3] = [5.0, -3.0, 2.0];
const SCALE: f64 = 0.25;
/// The pictures of a first camera, and of a second one that is for the test: name, number of the moment.
const PICTURES: [(&str, u32); 6] =
    [("0_00010", 10), ("0_00011", 11), ("0_00025", 25), ("1_00010", 10), ("1_00011", 11), ("1_00025", 25)];

/// Returns a camera file of a camera that is at this place of the normalized scene.
fn camera(looking: &Looking) -> Value {
    let position = [0, 1, 2].map(|axis| looking.position[axis] / SCALE + SCENE_CENTER[axis]);
    json!({
        "orientation": looking.rotation(), "position": position, "focal_length": FOCAL, "principal_point": CENTER, "skew": 0.0,
        "pixel_aspect_ratio": ASPECT, "radial_distortion": [0.0, 0.0, 0.0], "tangential": [0.0, 0.0], "image_size": [80, 60],
    })
}

/// Writes a folder with pictures of half the size.
fn dycheck() -> Folder {
    let folder = Folder::new();
    let ids = PICTURES.map(|(id, _)| id);
    folder.write_json(
        "dataset.json",
        &json!({ "count": 6, "num_exemplars": 3, "ids": ids, "train_ids": ids[..3], "val_ids": ids[3..] }),
    );
    folder.write_json("scene.json", &json!({ "center": SCENE_CENTER, "scale": SCALE, "near": 0.1, "far": 0.6 }));
    let metadata: serde_json::Map<String, Value> = PICTURES
        .iter()
        .map(|(id, moment)| (id.to_string(), json!({ "appearance_id": moment, "warp_id": moment, "camera_id": 0 })))
        .collect();
    folder.write_json("metadata.json", &Value::Object(metadata));
    folder.write_json("extra.json", &json!({ "factor": 2, "fps": 15.0 }));
    for (index, (id, _)) in PICTURES.iter().enumerate() {
        folder.write_json(&format!("camera/{id}.json"), &camera(&Looking::on_arc(index)));
        picture(&folder, &format!("rgb/2x/{id}.png"), [9, 9, 9]);
    }
    folder
}

/// Rewrites a file of JSON with another value at a pointer.
fn change(folder: &Folder, file: &str, pointer: &str, value: Value) {
    let text = std::fs::read_to_string(folder.path().join(file)).expect("the file is there");
    folder.write_json(file, &with(serde_json::from_str(&text).expect("JSON"), pointer, value));
}

#[test]
fn cameras_are_normalized_and_have_the_size_of_their_pictures() {
    let folder = dycheck();
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&train.views), ["0_00010", "0_00011", "0_00025"], "train_ids");
    assert_eq!(names(&test.views), ["1_00010", "1_00011", "1_00025"], "val_ids are for the test");
    for (views, first) in [(&train.views, 0), (&test.views, 3)] {
        for (view, index) in views.iter().zip(first..) {
            Looking::on_arc(index).check(view, [FOCAL / 2.0, FOCAL * ASPECT / 2.0], CENTER.map(|value| value / 2.0));
            assert_eq!(view.original, UVec2::new(40, 30), "{}: half of the size", view.name);
            assert_eq!(view.correction, Correction::default(), "{}: nothing is distorted", view.name);
        }
        assert_eq!(times(views), [0.0, 1.0 / 15.0, 1.0], "15 frames a second, from the first moment");
    }
    train.require_images().expect("the pictures of half the size are on disk");
    let notes = train.notes.join("; ");
    for part in ["3 val_ids are the test views", "rgb/2x"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
    assert!(!notes.contains("30 a second"), "the files have a rate: {notes}");
    let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
    assert!(summary.format.starts_with("Nerfies, HyperNeRF or DyCheck"), "the format: {}", summary.format);
}

#[test]
fn pictures_of_the_whole_size_come_first() {
    let folder = dycheck();
    for (id, _) in PICTURES {
        picture(&folder, &format!("rgb/1x/{id}.png"), [9, 9, 9]);
    }
    let view = &open(&folder, Split::Train).views[0];
    assert_eq!(view.original, UVec2::new(80, 60), "the size of the camera file");
    assert_eq!(view.image, folder.path().join("rgb/1x/0_00010.png"), "the picture of this size");
    Looking::on_arc(0).check(view, [FOCAL, FOCAL * ASPECT], CENTER);
}

#[test]
fn points_are_normalized_as_the_cameras() {
    let folder = dycheck();
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend([9.0f32, -3.0, 0.0, 5.0, 1.0, 2.0].into_iter().flat_map(f32::to_le_bytes));
    let path = folder.write("points.npy", &bytes);
    assert_eq!(open(&folder, Split::Train).points, Some(path.clone()), "the file of points");
    let origin = Origin { place: [1.0, 0.0, 0.0], time: 0.0 };
    let PointCloud(points) = PointCloud::load(&path, &origin).expect("a file of points");
    let places: Vec<Vec3> = points.iter().map(|point| point.position).collect();
    assert_eq!(places, [Vec3::new(0.0, 0.0, -0.5), Vec3::new(-1.0, 1.0, 0.0)], "(place − center) · scale − origin");
    folder.write("points.npy", &bytes[..bytes.len() - 1]);
    let error = PointCloud::load(&path, &origin).expect_err("a file that is cut off").to_string();
    assert!(error.contains("points.npy"), "the file is named: {error}");
}

#[test]
fn a_list_of_all_pictures_is_divided_by_cameras() {
    let folder = dycheck();
    change(&folder, "dataset.json", "/val_ids", json!([]));
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!((train.views.len(), test.views.len()), (5, 1), "every eighth of the six pictures is for the test");
    change(&folder, "dataset.json", "/val_ids", json!(["1_00025", "0_00010"]));
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["1_00025", "0_00010"], "the test views");
    assert_eq!(names(&train.views), ["0_00011", "0_00025"], "a picture of both lists is not trained on");
    let notes = train.notes.join("; ");
    for part in ["listed twice are used once, for the test if val_ids has them: 1", "left out: 2"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
}

#[test]
fn missing_files_are_assumed_and_noted() {
    let folder = dycheck();
    for name in ["scene.json", "metadata.json", "extra.json"] {
        std::fs::remove_file(folder.path().join(name)).expect("the file is there");
    }
    let train = open(&folder, Split::Train);
    assert_eq!(times(&train.views), [0.0, 1.0 / 30.0, 0.5], "the numbers of the names, 30 a second");
    let place = train.views[0].camera.world_to_camera.inverse().w_axis.truncate();
    let expected = [0, 1, 2].map(|axis| (Looking::on_arc(0).position[axis] / SCALE + SCENE_CENTER[axis]) as f32);
    assert!(place.abs_diff_eq(Vec3::from(expected), 1e-3), "the place of the camera file, {expected:?}: {place}");
    let notes = train.notes.join("; ");
    for part in ["no scene.json", "no metadata.json", "30 a second: extra.json with {\"fps\": 15}"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
}

#[test]
fn distortion_has_either_name() {
    let folder = dycheck();
    let file = "camera/0_00010.json";
    change(&folder, file, "/radial_distortion", json!([0.1, -0.2, 0.01]));
    assert_ne!(open(&folder, Split::Train).views[0].correction, Correction::default(), "radial coefficients");
    change(&folder, file, "/radial_distortion", Value::Null);
    for name in ["tangential", "tangential_distortion"] {
        change(&folder, file, &format!("/{name}"), json!([0.01, -0.02]));
        assert_ne!(open(&folder, Split::Train).views[0].correction, Correction::default(), "{name}");
        change(&folder, file, &format!("/{name}"), Value::Null);
        assert_eq!(open(&folder, Split::Train).views[0].correction, Correction::default(), "none");
    }
}

#[test]
fn files_that_cannot_be_used_are_named() {
    let camera = "camera/0_00011.json";
    for (file, pointer, value, parts) in [
        (camera, "/skew", json!(5.0), ["0_00011.json: frame ", "skew is not 0 but 5"]),
        (camera, "/focal_length", json!(0.0), ["0_00011.json", "focal lengths must be above 0"]),
        (camera, "/focal_length", json!("far"), ["0_00011.json", "far"]),
        (camera, "/orientation/0", json!([1, 0, 0]), ["0_00011.json", "the camera matrix"]),
        (camera, "/orientation", json!([[1, 0, 0], [0, 1, 0]]), ["0_00011.json", "invalid length 2"]),
        (camera, "/image_size", json!([1e9, 60]), ["0_00011.json", "1000000000x60"]),
        ("scene.json", "/scale", json!(0), ["scene.json", "its scale is 0, and must be above 0"]),
        ("scene.json", "/center", json!([0, 0]), ["scene.json", "invalid length 2"]),
        ("metadata.json", "/0_00025", json!({}), ["metadata.json", "no number warp_id for 0_00025"]),
        ("extra.json", "/fps", json!(-3), ["extra.json", "its fps is -3"]),
        (
            "dataset.json",
            "/train_ids/0",
            json!("../0_00010"),
            ["dataset.json", "\"../0_00010\" is no name of a picture"],
        ),
        ("dataset.json", "/train_ids/0", json!("a\u{1b}"), ["dataset.json", "is no name of a picture"]),
        ("dataset.json", "/train_ids/0", json!("none"), ["metadata.json", "for none"]),
    ] {
        let folder = dycheck();
        change(&folder, file, pointer, value);
        for part in parts {
            refused(&folder, part);
        }
    }
    let folder = dycheck();
    std::fs::remove_file(folder.path().join(camera)).expect("the file is there");
    refused(&folder, "0_00011.json: no such file, and dataset.json names it");
}

#[test]
fn one_moment_is_a_scene_at_rest() {
    let folder = dycheck();
    for (id, _) in PICTURES {
        change(&folder, "metadata.json", &format!("/{id}/warp_id"), json!(7));
    }
    let options = CameraOptions::default();
    let train = Dataset::open(folder.path(), Split::Train, &options).expect("pictures of one moment");
    assert_eq!(times(&train.views), [0.0; 3], "the only moment is time 0");
}
