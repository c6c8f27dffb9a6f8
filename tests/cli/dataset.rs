//! `info` on the folders of datasets.
//!
//! In: small datasets. Out: proof that counts, splits and missing files are shown, that cameras are drawn, and that wrong folders are refused.

use crate::support::command::{arguments, folder, gs4d};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Writes a nerfstudio file of cameras on a line, without images.
fn write(folder: &Path, cameras: usize) {
    let frame = |index: usize| {
        json!({
            "file_path": format!("images/f{index}.png"), "time": index,
            "transform_matrix": [[1, 0, 0, index], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]],
        })
    };
    let frames: Vec<Value> = (0..cameras).map(frame).collect();
    let file = json!({ "w": 40, "h": 30, "fl_x": 50, "fl_y": 50, "cx": 20, "cy": 15, "frames": frames });
    fs::write(folder.join("transforms.json"), file.to_string()).expect("the folder can be written to");
}

#[test]
fn a_dataset_is_described_and_its_cameras_are_drawn() {
    let folder = folder();
    let data = folder.path().join("data");
    fs::create_dir(&data).expect("the folder can be made");
    write(&data, 10);
    let picture = folder.path().join("cameras.png");
    let json = gs4d(&arguments!["info", &data, "--cameras", &picture, "--json"]).json();
    assert_eq!((&json["cameras"], &json["times"]), (&10.into(), &10.into()), "ten cameras, each at its own time");
    assert_eq!(json["sizes"], json!([[40, 30]]), "the size of the pictures");
    assert_eq!(json["time_interval"], json!([0.0, 9.0]), "the first and the last time");
    let views: Vec<&Value> = json["splits"].as_array().expect("splits").iter().map(|split| &split["views"]).collect();
    assert_eq!(views, [8, 2], "training and test views");
    assert!(json["missing"][0].as_str().is_some_and(|text| text.starts_with("10 images")), "no image: {json}");
    let drawn = image::open(&picture).expect("the picture can be read").into_rgb8();
    assert_eq!(drawn.dimensions(), (1024, 512), "two parts");
    assert!(drawn.pixels().any(|pixel| pixel.0[0] > 150 && pixel.0[2] < 80), "the cameras are drawn in red");
    let text = gs4d(&arguments!["info", &data]).text();
    for part in ["nerfstudio", "10 from 0 to 9", "40 x 30", "train", "10 images or masks are not on disk"] {
        assert!(text.contains(part), "{part:?} is not in: {text}");
    }
}

#[test]
fn wrong_datasets_are_refused_with_their_cause() {
    let folder = folder();
    gs4d(&arguments!["info", folder.path()]).must_fail("poses_bounds.npy");
    write(folder.path(), 1);
    gs4d(&arguments!["info", folder.path()]).must_fail("one view");
    write(folder.path(), 3);
    let inside = folder.path().join("transforms.json");
    gs4d(&arguments!["info", folder.path(), "--cameras", &inside]).must_fail("transforms.json");
    gs4d(&arguments!["info", &inside, "--cameras", folder.path().join("a.png")]).must_fail("--cameras");
}

#[test]
fn info_decodes_no_video() {
    let folder = folder();
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 17), }\n";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for x in [0.0, 1.0] {
        let row = [0.0, 1.0, 0.0, x, 30.0, -1.0, 0.0, 0.0, 0.0, 40.0, 0.0, 0.0, 1.0, 3.0, 50.0, 0.1, 100.0];
        bytes.extend(row.into_iter().flat_map(f64::to_le_bytes));
    }
    let data = folder.path().join("data");
    fs::create_dir(&data).expect("the folder can be made");
    fs::write(data.join("poses_bounds.npy"), bytes).expect("the folder can be written to");
    for name in ["cam00.mp4", "cam07.mp4"] {
        fs::write(data.join(name), b"no video").expect("the folder can be written to");
    }
    let json = gs4d(&arguments!["info", &data, "--json"]).json();
    assert_eq!(json["cameras"], 2, "a camera for each row");
    assert!(json["missing"].to_string().contains("2 videos have not been decoded"), "the videos are named: {json}");
    assert!(!json["missing"].to_string().contains("static"), "the times of videos are not known yet: {json}");
    assert!(!folder.path().join("data.frames").exists(), "no frames are written");
}
