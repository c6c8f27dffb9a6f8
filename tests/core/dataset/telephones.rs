//! Scans of telephones: Record3D and Polycam.
//!
//! In: small folders made here, of cameras that look at the origin. Out: proof that poses, lenses and times are those
//! of the files, and that pictures without a pose, poses without a picture and blurred pictures are named.

use super::Folder;
use super::formats::{names, open, picture, refused, times};
use super::looking::Looking;
use bevy_gs4d::offline::dataset::Split;
use serde_json::{Value, json};

const FOCAL: [f64; 2] = [50.0, 52.0];
const CENTER: [f64; 2] = [19.0, 16.0];

/// Returns the metadata of Record3D for cameras on an arc. Its quaternions turn from the camera with OpenGL's axes to
/// the world.
fn record3d(frames: usize) -> Value {
    let pose = |index: usize| {
        let camera = Looking::on_arc(index);
        // To the world: the inverse of the rotation to the camera with OpenCV's axes, after half a turn about x.
        let [w, x, y, z] = camera.quaternion();
        let [w, x, y, z] = [w, -x, -y, -z];
        let [px, py, pz] = camera.position;
        json!([w, z, -y, -x, px, py, pz])
    };
    json!({
        "w": 40, "h": 30, "dw": 20, "dh": 15, "fps": 60, "K": [FOCAL[0], 0, 0, 0, FOCAL[1], 0, CENTER[0], CENTER[1], 1],
        "initPose": [0, 0, 0, 1, 0, 0, 0], "poses": (0..frames).map(pose).collect::<Vec<_>>(),
    })
}

#[test]
fn record3d_projects_points_as_its_cameras_do() {
    let folder = Folder::new();
    let mut json = record3d(12);
    json["frameTimestamps"] = (0..12).map(|index| 100.0 + 0.5 * f64::from(index)).collect();
    folder.write_json("metadata.json", &json);
    for index in 0..12 {
        picture(&folder, &format!("rgbd/{index}.jpg"), [9, 9, 9]);
        folder.write(format!("rgbd/{index}.depth"), "");
    }
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["0", "8"], "every eighth camera is for the test");
    assert_eq!(names(&train.views), ["1", "2", "3", "4", "5", "6", "7", "9", "10", "11"], "in the order of numbers");
    for (view, index) in train.views.iter().zip([1, 2, 3, 4, 5, 6, 7, 9, 10, 11]) {
        Looking::on_arc(index).check(view, FOCAL, CENTER);
        assert_eq!(view.time, 0.5 * index as f32, "{}: after the first time", view.name);
    }
    train.require_images().expect("the pictures are on disk");
    assert!(train.notes.is_empty(), "nothing is assumed: {:?}", train.notes);
}

#[test]
fn record3d_has_a_lens_for_each_frame_and_names_what_is_missing() {
    let folder = Folder::new();
    let mut json = record3d(4);
    json["perFrameIntrinsicCoeffs"] = (0..4).map(|index| json!([60 + index, 61, 20, 15])).collect();
    // The file of an unpacked .r3d has no extension.
    folder.write_json("metadata", &json);
    for name in ["0.jpg", "1.jpg", "3.jpg", "3(1).jpg", "4.jpg"] {
        picture(&folder, &format!("rgbd/{name}"), [9, 9, 9]);
    }
    let train = open(&folder, Split::Train);
    assert_eq!(names(&train.views), ["1", "3"], "pictures with poses");
    for (view, index) in train.views.iter().zip([1, 3]) {
        Looking::on_arc(index).check(view, [60.0 + index as f64, 61.0], [20.0, 15.0]);
    }
    assert_eq!(times(&train.views), [1.0 / 60.0, 3.0 / 60.0], "the rate of the file");
    let notes = train.notes.join("; ");
    for part in
        ["without a pose are left out: 3(1).jpg, 4.jpg", "without a picture are left out: 2", "60 frames a second"]
    {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
}

#[test]
fn wrong_files_of_record3d_are_refused() {
    let folder = Folder::new();
    picture(&folder, "rgb/0.jpg", [9, 9, 9]);
    folder.write_json("metadata.json", &json!({"0": {"warp_id": 0}}));
    refused(&folder, "nothing else that a dataset folder holds");
    for (pointer, value, part) in [
        ("/K", json!([1, 2, 3]), "three rows"),
        ("/w", json!(0), "0x30"),
        ("/poses/1", json!([0, 0, 0, 1, 0, 0]), "invalid length 6"),
        ("/poses/1", json!([0, 0, 0, 0, 1, 2, 3]), "frame 1: the camera matrix has a rotation of length 0"),
        ("/poses", json!([]), "its list of frames is empty"),
        ("/frameTimestamps", json!(["a"]), "invalid type"),
    ] {
        folder.write_json("metadata.json", &super::with(record3d(3), pointer, value));
        for index in 0..3 {
            picture(&folder, &format!("rgb/{index}.jpg"), [9, 9, 9]);
        }
        refused(&folder, part);
    }
}

/// Returns a file of Polycam for a camera on an arc. The world of the file has the axes y, z, x of that of the dataset.
fn polycam(index: usize, blur: Option<f64>) -> Value {
    let Looking { position, right, down, forward } = Looking::on_arc(index);
    let mut json = json!({
        "fx": FOCAL[0], "fy": FOCAL[1], "cx": CENTER[0], "cy": CENTER[1], "width": 40, "height": 30,
        "timestamp": 67_890_123, "manual_keyframe": false,
    });
    for (row, axis) in [1, 2, 0].into_iter().enumerate() {
        for (column, value) in [right[axis], -down[axis], -forward[axis], position[axis]].into_iter().enumerate() {
            json[format!("t_{row}{column}")] = json!(value);
        }
    }
    if let Some(blur) = blur {
        json["blur_score"] = json!(blur);
    }
    json
}

#[test]
fn polycam_projects_points_as_its_cameras_do() {
    let folder = Folder::new();
    for index in 0..4 {
        folder.write_json(&format!("keyframes/corrected_cameras/100{index}.json"), &polycam(index, None));
        picture(&folder, &format!("keyframes/corrected_images/100{index}.jpg"), [9, 9, 9]);
        folder.write_json(&format!("keyframes/cameras/100{index}.json"), &json!({"of": "the recording"}));
    }
    let train = open(&folder, Split::Train);
    assert_eq!(names(&train.views), ["1001", "1002", "1003"], "all but the first camera");
    for (view, index) in train.views.iter().zip(1..) {
        Looking::on_arc(index).check(view, FOCAL, CENTER);
        assert_eq!(view.time, 0.0, "{}: the scene is at rest", view.name);
    }
    train.require_images().expect("the pictures are on disk");
    assert!(train.notes.is_empty(), "nothing is assumed: {:?}", train.notes);
}

#[test]
fn blurred_pictures_of_polycam_are_left_out_and_named() {
    let folder = Folder::new();
    for (index, blur) in [(0, 90.0), (1, 24.0), (2, 26.0), (3, 200.0)] {
        folder.write_json(&format!("keyframes/cameras/{index}.json"), &polycam(index, Some(blur)));
        picture(&folder, &format!("keyframes/images/{index}.png"), [9, 9, 9]);
    }
    let train = open(&folder, Split::Train);
    assert_eq!(names(&train.views), ["2", "3"], "picture 1 is blurred");
    let notes = train.notes.join("; ");
    for part in ["has no corrected_cameras", "1 pictures with a blur_score below 25 are left out: 1"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
    for index in [2, 3] {
        folder.write_json(&format!("keyframes/cameras/{index}.json"), &polycam(index, Some(1.0)));
    }
    let train = open(&folder, Split::Train);
    assert_eq!(train.views.len(), 3, "if most are blurred, all are used");
    assert!(train.notes.iter().any(|note| note.contains("most pictures, 3")), "a note says so: {:?}", train.notes);
    folder.write_json("keyframes/cameras/2.json", &json!({"fx": 1}));
    refused(&folder, "2.json: not a valid camera file: missing field");
    folder.write_json("keyframes/cameras/2.json", &super::with(polycam(2, None), "/t_00", json!(9)));
    refused(&folder, "2.json: the camera matrix");
}
