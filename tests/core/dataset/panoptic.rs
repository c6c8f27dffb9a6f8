//! `PanopticSports`: `train_meta.json` and `test_meta.json`, with images in `ims/` and points in `init_pt_cld.npz`.
//!
//! In: small folders made here, of cameras that look at the origin. Out: proof of poses, lenses, times, splits and
//! points, and that wrong files are refused by name.

use super::formats::{names, open, picture, refused, times};
use super::looking::Looking;
use super::{Folder, with};
use crate::support::pth;
use bevy_gs4d::internal::offline::dataset::{CloudPoint, PointCloud, Summary};
use bevy_gs4d::offline::dataset::{CameraOptions, Split};
use bevy_gs4d::scene::Origin;
use glam::Vec3;
use serde_json::{Value, json};

const CENTER: [f64; 2] = [19.0, 16.0];

/// Returns the focal lengths of a camera.
fn focal(camera: usize) -> [f64; 2] {
    [50.0 + camera as f64, 52.0]
}

/// Returns a file of these cameras at moments with these numbers.
fn meta(cameras: &[usize], numbers: &[usize]) -> Value {
    let k = |camera: &usize| {
        let [fx, fy] = focal(*camera);
        json!([[fx, 0.0, CENTER[0]], [0.0, fy, CENTER[1]], [0.0, 0.0, 1.0]])
    };
    let w2c = |camera: &usize| {
        let camera = Looking::on_arc(*camera);
        let (rotation, translation) = (camera.rotation(), camera.translation());
        let row = |axis: usize| json!([rotation[axis][0], rotation[axis][1], rotation[axis][2], translation[axis]]);
        json!([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]])
    };
    let each =
        |of_camera: &dyn Fn(&usize) -> Value| vec![cameras.iter().map(of_camera).collect::<Vec<_>>(); numbers.len()];
    let names = |number: &usize| cameras.iter().map(|camera| format!("{camera}/{number:06}.jpg")).collect::<Vec<_>>();
    json!({
        "w": 40, "h": 30, "k": each(&k), "w2c": each(&w2c), "fn": numbers.iter().map(names).collect::<Vec<_>>(),
        "cam_id": each(&|camera| json!(camera)),
    })
}

#[test]
fn cameras_of_both_files_stand_where_their_matrices_say() {
    let folder = Folder::new();
    folder.write_json("train_meta.json", &meta(&[1, 2], &[3, 5, 6]));
    folder.write_json("test_meta.json", &meta(&[0], &[3, 6]));
    for (camera, number) in [(1, 3), (1, 5), (1, 6), (2, 3), (2, 5), (2, 6)] {
        picture(&folder, &format!("ims/{camera}/{number:06}.jpg"), [9, 9, 9]);
    }
    picture(&folder, "seg/1/000003.png", [255, 255, 255]);
    picture(&folder, "masks/1/000005.png", [255, 255, 255]);
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    let expected = ["1_000003", "2_000003", "1_000005", "2_000005", "1_000006", "2_000006"];
    assert_eq!(names(&train.views), expected, "moment by moment");
    assert_eq!(names(&test.views), ["0_000003", "0_000006"], "the cameras of the other file");
    let seconds = [0.0, 2.0 / 30.0, 0.1];
    assert_eq!(times(&train.views), [0, 0, 1, 1, 2, 2].map(|moment| seconds[moment]), "gaps keep their time");
    assert_eq!(times(&test.views), [0.0, 0.1], "the same clock");
    for (view, camera) in train.views.iter().chain(&test.views).zip([1, 2, 1, 2, 1, 2, 0, 0]) {
        Looking::on_arc(camera).check(view, focal(camera), CENTER);
    }
    train.require_images().expect("the images are in ims");
    assert_eq!(test.views[0].image, folder.path().join("ims/0/000003.jpg"), "where an image is to be");
    let masks: Vec<_> = train.views.iter().map(|view| view.mask.clone()).collect();
    assert_eq!(masks[2], Some(folder.path().join("masks/1/000005.png")), "a mask");
    assert_eq!(masks[0], None, "pictures of people are no masks");
    let notes = train.notes.join("; ");
    assert!(notes.contains("seg/ tells people"), "they are named: {notes}");
    let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
    assert!(summary.format.starts_with("PanopticSports"), "the format is named: {}", summary.format);
}

#[test]
fn without_one_file_its_split_is_missing_and_noted() {
    let folder = Folder::new();
    folder.write_json("train_meta.json", &meta(&[1, 2], &[0, 1]));
    let train = open(&folder, Split::Train);
    assert!(train.notes.iter().any(|note| note.contains("no test_meta.json")), "it is noted: {:?}", train.notes);
    assert_eq!((train.views.len(), train.points), (4, None), "all views of the other, and no points");
}

#[test]
fn moments_whose_numbers_differ_follow_each_other() {
    let folder = Folder::new();
    let names = json!([["1/000010.jpg", "2/000011.jpg"], ["1/000020.jpg", "2/000021.jpg"]]);
    folder.write_json("train_meta.json", &with(meta(&[1, 2], &[0, 1]), "/fn", names));
    let train = open(&folder, Split::Train);
    assert_eq!(times(&train.views)[2..], [1.0 / 30.0; 2], "one frame later");
    assert!(train.notes.iter().any(|note| note.contains("follow each other")), "it is noted: {:?}", train.notes);
}

#[test]
fn files_that_do_not_fit_are_refused_with_their_moment_or_image() {
    let folder = Folder::new();
    let whole = || meta(&[1, 2], &[0, 1]);
    let matrix = |skew: f64| json!([[50.0, skew, 19.0], [0.0, 52.0, 16.0], [0.0, 0.0, 1.0]]);
    for (pointer, value, part) in [
        ("/k", json!([]), "2 moments in fn, 0 in k and 2 in w2c"),
        ("/w2c/1", json!([]), "moment 1 has 2 cameras in fn, 2 in k and 0 in w2c"),
        ("/k/1/0", matrix(3.0), "image 1/000001.jpg: the skew of K is not 0 but 3"),
        ("/k/0/1", json!([[50.0, 0.0, 19.0]]), "image 2/000000.jpg: the camera matrix k must be three rows"),
        ("/w2c/0/0/2", json!([0, 0, 0, 1]), "image 1/000000.jpg: the camera matrix cannot be inverted"),
        ("/fn/0/0", json!("../a/000000.jpg"), "names no file"),
        ("/fn/0/0", json!("/a/000000.jpg"), "names no file"),
        ("/fn/0/0", json!("a\u{1b}[2J.jpg"), "control characters"),
        ("/fn/0/0", json!(7), "invalid type"),
        ("/fn", Value::Null, "invalid type"),
        ("/w", json!(0), "0x30"),
    ] {
        folder.write_json("train_meta.json", &with(whole(), pointer, value));
        refused(&folder, part);
        refused(&folder, "train_meta.json");
    }
    folder.write("train_meta.json", r#"{"w": 40, "h": 30}"#);
    refused(&folder, "missing field");
}

/// Returns an archive with an array of this type and shape.
fn points(kind: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}\n");
    let length = (header.len() as u16).to_le_bytes();
    let array = [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), values].concat();
    pth::archive(&[("data.npy".to_owned(), array)])
}

#[test]
fn points_have_places_and_colors() {
    let folder = Folder::new();
    folder.write_json("train_meta.json", &meta(&[1, 2], &[0, 1]));
    let load = |bytes: Vec<u8>| {
        let path = folder.write("init_pt_cld.npz", bytes);
        PointCloud::load(&path, &Origin::default()).map(|PointCloud(points)| points).map_err(|error| error.to_string())
    };
    let expected = CloudPoint {
        position: Vec3::new(1.0, -2.0, 0.5),
        color: Some(Vec3::new(0.2, 0.4, 1.0)),
        time: None,
        velocity: Vec3::ZERO,
    };
    for scale in [1.0, 255.0] {
        let rows = [[1.0, -2.0, 0.5, 0.2 * scale, 0.4 * scale, scale, 1.0], [f64::NAN; 7]];
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        assert_eq!(load(points("<f8", "2, 7", &bytes)), Ok(vec![expected]), "one finite point, colors to {scale}");
    }
    let train = open(&folder, Split::Train);
    assert_eq!(train.points, Some(folder.path().join("init_pt_cld.npz")), "the points of the dataset");
    assert!(train.notes.iter().any(|note| note.contains("first moment")), "it is noted: {:?}", train.notes);
    for (bytes, part) in [
        (points("<f2", "1, 7", &[0; 14]), "type <f2"),
        (points("<f4", "1, 6", &[0; 24]), "shape"),
        (points("<f4", "999999999, 7", &[0; 28]), "copy it again"),
        (pth::archive(&[("other.npy".to_owned(), vec![0; 99])]), "array data"),
        (b"PK".to_vec(), "zip"),
    ] {
        let error = load(bytes).expect_err(part);
        assert!(error.contains(part) && error.contains("init_pt_cld.npz"), "{part:?} is not in: {error}");
    }
}
