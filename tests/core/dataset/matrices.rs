//! Camera files whose frames have the matrix of their lens.
//!
//! In: a small nerfstudio folder with `K`, `intrinsics` or `camera_intrinsics` in place of focal lengths. Out: proof
//! that each frame has its own lens.

use super::Folder;
use super::formats::{names, nerfstudio, open, refused};
use super::looking::intrinsics;
use bevy_gs4d::offline::dataset::Split;
use serde_json::{Value, json};

/// Returns a file of four cameras without a lens.
fn without_lens() -> Value {
    let mut json = nerfstudio(4);
    for name in ["fl_x", "fl_y", "cx", "cy"] {
        json.as_object_mut().expect("an object").remove(name);
    }
    json
}

#[test]
fn each_frame_has_the_lens_of_its_own_matrix() {
    for name in ["K", "intrinsics", "camera_intrinsics"] {
        let mut json = without_lens();
        for index in 0..4 {
            let focal = 50 + index;
            json["frames"][index][name] = match index {
                1 => json!([[focal, 0, 19], [0, 52, 16], [0, 0, 1]]),
                2 => json!([focal, 0, 0, 0, 52, 0, 19, 16, 1]),
                _ => json!({"fx": focal, "fy": 52, "cx": 19, "cy": 16}),
            };
        }
        let folder = Folder::new();
        folder.write_json("transforms.json", &json);
        let views = open(&folder, Split::Train).views;
        assert_eq!(names(&views), ["f01", "f02", "f03"], "all but the first camera");
        for (view, focal) in views.iter().zip([51.0, 52.0, 53.0]) {
            assert_eq!(intrinsics(view), ([focal, 52.0], [19.0, 16.0]), "{name} of {}", view.name);
        }
    }
}

#[test]
fn a_matrix_of_the_whole_file_is_that_of_all_frames() {
    let folder = Folder::new();
    let mut json = without_lens();
    json["K"] = json!([[70, 0, 19, 0], [0, 52, 16, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    json["frames"][2]["K"] = json!([60, 61, 20, 15]);
    folder.write_json("transforms.json", &json);
    let views = open(&folder, Split::Train).views;
    assert_eq!(intrinsics(&views[0]), ([70.0, 52.0], [19.0, 16.0]), "the matrix of the file");
    assert_eq!(intrinsics(&views[1]), ([60.0, 61.0], [20.0, 15.0]), "the matrix of the frame");
}

#[test]
fn wrong_matrices_are_refused_where_they_are_needed() {
    let folder = Folder::new();
    let mut json = without_lens();
    folder.write_json("transforms.json", &json);
    refused(&folder, "frame 0: no lens: give camera_angle_x, all of fl_x, fl_y, cx and cy, or a matrix K");
    for (matrix, part) in [
        (json!([[50, 2, 19], [0, 52, 16], [0, 0, 1]]), "the skew of K is not 0 but 2"),
        (json!([[50, 0], [0, 52]]), "three rows of three numbers"),
        (json!([[0, 0, 19], [0, 52, 16], [0, 0, 1]]), "focal lengths must be above 0"),
    ] {
        json["K"] = matrix;
        folder.write_json("transforms.json", &json);
        refused(&folder, part);
    }
    let mut whole = nerfstudio(4);
    whole["K"] = json!("of another kind");
    folder.write_json("transforms.json", &whole);
    let views = open(&folder, Split::Train).views;
    assert_eq!(intrinsics(&views[0]).0, [50.0, 52.0], "focal lengths are enough");
}
