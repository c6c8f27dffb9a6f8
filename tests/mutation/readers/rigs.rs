//! The files of small folders of LLFF, Nerfies, Technicolor and Google Immersive.
//!
//! In: nothing. Out: the names and the contents of the files of a folder, of which a reader changes one.

use super::datasets::poses;
use image::{ImageFormat, RgbImage};
use serde_json::{Value, json};
use std::io::Cursor;

/// Number of cameras.
const CAMERAS: usize = 3;

/// Files by name.
pub type Files = Vec<(&'static str, Vec<u8>)>;

fn file(json: &Value) -> Vec<u8> {
    json.to_string().into_bytes()
}

/// Returns the bytes of a PNG of 40 x 30 pixels.
pub fn picture() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    RgbImage::new(40, 30).write_to(&mut bytes, ImageFormat::Png).expect("a picture can be encoded");
    bytes.into_inner()
}

/// `poses_bounds.npy` with a picture for each row.
pub fn llff() -> Files {
    let pictures = ["images/a1.png", "images/a2.png", "images/a3.png"].map(|name| (name, Vec::new()));
    [("poses_bounds.npy", poses())].into_iter().chain(pictures).collect()
}

/// Three pictures, of which one is for the test.
pub fn nerfies() -> Files {
    let camera = |index: usize| {
        file(&json!({
            "orientation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "position": [index, 0, -3], "focal_length": 50.0,
            "principal_point": [19.0, 16.0], "skew": 0.0, "pixel_aspect_ratio": 1.0,
            "radial_distortion": [0.01, -0.01, 0.0], "tangential_distortion": [0.001, 0.0], "image_size": [40, 30],
        }))
    };
    let names = json!({ "count": 3, "ids": ["a", "b", "c"], "train_ids": ["a", "c"], "val_ids": ["b"] });
    let moment = |index: usize| json!({ "warp_id": index, "appearance_id": index, "camera_id": 0 });
    vec![
        ("dataset.json", file(&names)),
        ("scene.json", file(&json!({ "center": [0.5, 0, 0], "scale": 0.5, "near": 0.1, "far": 2.0 }))),
        ("metadata.json", file(&json!({ "a": moment(0), "b": moment(1), "c": moment(2) }))),
        ("extra.json", file(&json!({ "fps": 15.0 }))),
        ("camera/a.json", camera(0)),
        ("camera/b.json", camera(1)),
        ("camera/c.json", camera(2)),
    ]
}

/// Three cameras with a picture each.
pub fn technicolor() -> Files {
    let line = |camera: usize| format!("50.0 19.0 16.0 1.0 0.0 1.0 0.0 0.0 0.0 {camera} 0.0 3.0\n");
    let lines: String = (0..CAMERAS).map(line).collect();
    let pictures = ["a_00001_00.png", "a_00001_01.png", "a_00001_02.png"].map(|name| (name, picture()));
    let cameras = format!("f cx cy aspect skew qw qx qy qz tx ty tz\n{lines}").into_bytes();
    [("cameras_parameters.txt", cameras)].into_iter().chain(pictures).collect()
}

/// Three fisheye cameras with a frame each.
pub fn immersive() -> Files {
    let camera = |index: usize| {
        json!({
            "name": format!("camera_000{index}"), "position": [index, 0, -3], "orientation": [0.01, 0.02, -0.03],
            "focal_length": 50.0, "pixel_aspect_ratio": 1.0, "principal_point": [19.0, 16.0], "width": 40.0,
            "height": 30.0, "radial_distortion": [0.01, -0.01, 0.0], "projection_type": "fisheye",
        })
    };
    let frames = ["camera_0000/0.png", "camera_0001/0.png", "camera_0002/0.png"].map(|name| (name, picture()));
    let models = Value::from((0..CAMERAS).map(camera).collect::<Vec<_>>());
    [("models.json", file(&models))].into_iter().chain(frames).collect()
}
