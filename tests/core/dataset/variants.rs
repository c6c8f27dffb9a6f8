//! Camera files as other programs write them.
//!
//! In: a small nerfstudio or Blender folder, with a byte order mark, NaN and infinities, paths of Windows, names
//! without extension, matrices of other forms and scales, frames without times. Out: proof that each is read as it is
//! meant, or refused by name.

use super::Folder;
use super::formats::{names, nerfstudio, open, picture, refused};
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, DatasetError, Split, TrainingView};
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

/// Returns the folder of a file.
fn folder_of(json: &Value) -> Folder {
    let folder = Folder::new();
    folder.write_json("transforms.json", json);
    folder
}

/// Returns the views of a file but for the paths of their images, which are those of a temporary folder.
fn views(json: &Value) -> Vec<TrainingView> {
    let views = open(&folder_of(json), Split::Train).views;
    views.into_iter().map(|view| TrainingView { image: "none.png".into(), ..view }).collect()
}

/// Applies a change to the matrix of each frame.
fn changed(mut json: Value, change: impl Fn(usize, &Value) -> Value) -> Value {
    for (index, frame) in json["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
        frame["transform_matrix"] = change(index, &frame["transform_matrix"]);
    }
    json
}

/// Returns a matrix with columns times these factors. The place of the camera stays.
fn scaled(matrix: &Value, factors: [f64; 3]) -> Value {
    let mut matrix = matrix.clone();
    for row in 0..3 {
        for (column, factor) in factors.into_iter().enumerate() {
            matrix[row][column] = json!(matrix[row][column].as_f64().expect("a number") * factor);
        }
    }
    matrix
}

#[test]
fn a_byte_order_mark_is_skipped_and_other_encodings_are_named() {
    let folder = Folder::new();
    folder.write("transforms.json", format!("\u{feff}{}", nerfstudio(3)));
    assert_eq!(open(&folder, Split::Train).views.len(), 2, "a mark of UTF-8");
    let wide: Vec<u8> = format!("\u{feff}{}", nerfstudio(3)).encode_utf16().flat_map(u16::to_le_bytes).collect();
    folder.write("transforms.json", wide);
    refused(&folder, "UTF-16");
}

#[test]
fn nan_and_infinity_are_refused_where_numbers_are_needed() {
    let folder = Folder::new();
    let whole = serde_json::to_string_pretty(&nerfstudio(3)).expect("JSON");
    folder.write(
        "transforms.json",
        whole.replacen('{', "{\n\"applied_scale\": NaN, \"aabb\": [-Infinity, Infinity],", 1),
    );
    assert_eq!(open(&folder, Split::Train).views.len(), 2, "entries that are not read are harmless");
    for (name, wrong) in [("fl_x", "NaN"), ("w", "Infinity"), ("k1", "-Infinity")] {
        let mut json = nerfstudio(3);
        json.as_object_mut().expect("an object").remove(name);
        let text = serde_json::to_string_pretty(&json).expect("JSON");
        folder.write("transforms.json", text.replacen('{', &format!("{{\n\n\"{name}\": {wrong},"), 1));
        refused(&folder, &format!("{wrong} in line 3"));
    }
    let flat = changed(nerfstudio(3), |_, _| json!("HERE"));
    folder.write("transforms.json", flat.to_string().replacen("\"HERE\"", "\n[[NaN, 0, 0, 0]]", 1));
    refused(&folder, "frame 0: the camera matrix holds \"NaN in line 2\", which is no number");
}

#[test]
fn paths_of_windows_lead_to_their_files() {
    let mut json = nerfstudio(4);
    for (index, frame) in json["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
        frame["file_path"] = json!(format!(r".\images\f{index:02}.png"));
    }
    json["frames"][1]["mask_path"] = json!(r"masks\f01.png");
    json["ply_file_path"] = json!(r"points\first.ply");
    json["train_filenames"] = json!([r"images\f01.png", "images/f02.png", r".\images\f03.png"]);
    json["test_filenames"] = json!(["./images/f00.png"]);
    let folder = folder_of(&json);
    for index in 0..4 {
        picture(&folder, &format!("images/f{index:02}.png"), [9, 9, 9]);
    }
    picture(&folder, "masks/f01.png", [255, 255, 255]);
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&train.views), ["f01", "f02", "f03"], "the list of training views");
    assert_eq!(names(&test.views), ["f00"], "the list of test views");
    train.require_images().expect("the images and the mask are found");
    assert_eq!(train.views[0].mask, Some(folder.path().join("masks/f01.png")), "the mask");
    assert_eq!(train.points, Some(folder.path().join("points/first.ply")), "the file of points");
    assert!(train.notes.is_empty(), "paths of Windows need no note: {:?}", train.notes);
}

#[test]
fn a_name_without_extension_is_found_with_any_image_extension() {
    let mut json = nerfstudio(3);
    for name in ["w", "h"] {
        json.as_object_mut().expect("an object").remove(name);
    }
    for (index, frame) in json["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
        frame["file_path"] = json!(format!("images/f{index:02}"));
    }
    let folder = folder_of(&json);
    std::fs::create_dir(folder.path().join("images")).expect("the folder can be made");
    for name in ["f00.jpg", "f01.jpeg", "f02.JPG"] {
        let path = folder.path().join("images").join(name);
        RgbImage::from_pixel(40, 30, Rgb([9, 9, 9])).save(path).expect("an image");
    }
    let found = open(&folder, Split::Train);
    found.require_images().expect("the images are found");
    assert_eq!(names(&found.views), ["f01", "f02"], "the names of the views");
    assert_eq!(found.views[1].image, folder.path().join("images/f02.JPG"), "an extension in capital letters");
    assert_eq!(found.views[1].original.to_array(), [40, 30], "the size of the first image");
    picture(&folder, "images/f02.png", [9, 9, 9]);
    let found = open(&folder, Split::Train);
    assert_eq!(found.views[1].image, folder.path().join("images/f02.png"), "png first, as in the original");
    std::fs::remove_file(folder.path().join("images/f01.jpeg")).expect("the image exists");
    let error = open(&folder, Split::Train).require_images().expect_err("an image is missing").to_string();
    for part in ["1 of 2 images are missing", "f01.png", "jpg", "letter case"] {
        assert!(error.contains(part), "{part:?} is not in: {error}");
    }
}

#[test]
fn matrices_of_three_rows_and_flat_matrices_equal_those_of_four_rows() {
    let expected = views(&nerfstudio(4));
    let rows = |matrix: &Value, count: usize| matrix.as_array().expect("rows")[..count].to_vec();
    let flat = |rows: Vec<Value>| {
        Value::from(rows.iter().flat_map(|row| row.as_array().expect("a row").clone()).collect::<Vec<_>>())
    };
    assert_eq!(views(&changed(nerfstudio(4), |_, matrix| Value::from(rows(matrix, 3)))), expected, "three rows");
    assert_eq!(views(&changed(nerfstudio(4), |_, matrix| flat(rows(matrix, 4)))), expected, "sixteen numbers");
    assert_eq!(views(&changed(nerfstudio(4), |_, matrix| flat(rows(matrix, 3)))), expected, "twelve numbers");
    refused(
        &folder_of(&changed(nerfstudio(4), |_, matrix| flat(rows(matrix, 2)))),
        "frame 0: the camera matrix must be four rows",
    );
}

#[test]
fn frames_without_a_time_among_others_that_have_one_are_refused() {
    let timed = |wanted: &dyn Fn(usize) -> bool| {
        let mut json = nerfstudio(4);
        for index in (0..4).filter(|&index| wanted(index)) {
            json["frames"][index]["time"] = json!(0.25 * index as f64);
        }
        json
    };
    let mixed = folder_of(&timed(&|index| index != 2));
    refused(&mixed, "frame 2: \"images/f02.png\" has no \"time\"");
    let options = CameraOptions { is_static: true, ..CameraOptions::default() };
    let still = Dataset::open(mixed.path(), Split::Train, &options).expect("a scene at rest needs no times");
    assert!(still.views.iter().all(|view| view.time == 0.0), "every view is at time 0");
    for (wanted, times) in [(true, [0.25, 0.5, 0.75]), (false, [0.0; 3])] {
        let found: Vec<f32> = views(&timed(&|_| wanted)).iter().map(|view| view.time).collect();
        assert_eq!(found, times, "all times or none");
    }
    let mut numbered = timed(&|index| index != 1);
    numbered["frames"][1]["frame_number"] = json!(15);
    refused(&folder_of(&numbered), "frame 1: \"images/f01.png\" has no \"time\"");
    let mut numbered = timed(&|_| false);
    numbered["frames"][3]["frame_number"] = json!(15);
    refused(&folder_of(&numbered), "frame 0: \"images/f00.png\" has no \"time\"");
}

#[test]
fn a_split_without_times_beside_a_training_split_with_times_is_refused() {
    let folder = Folder::new();
    let mut json = nerfstudio(3);
    folder.write_json("transforms_test.json", &json);
    for index in 0..3 {
        json["frames"][index]["time"] = json!(0);
    }
    folder.write_json("transforms_train.json", &json);
    assert_eq!(open(&folder, Split::Test).views.len(), 3, "a training split at time 0 is at rest, too");
    json["frames"][1]["time"] = json!(0.5);
    folder.write_json("transforms_train.json", &json);
    let error = Dataset::open(folder.path(), Split::Test, &CameraOptions::default()).expect_err("times are missing");
    assert!(matches!(error, DatasetError::Frame { frame: 0, .. }), "the first frame is named: {error}");
    assert!(error.to_string().contains("transforms_test.json"), "the file is named: {error}");
    assert_eq!(open(&folder, Split::Train).views.len(), 3, "the training split is whole");
}

#[test]
fn matrices_that_mirror_or_shear_are_refused() {
    let mirrored = |index: usize| {
        changed(nerfstudio(4), move |at, matrix| scaled(matrix, [if at == index { -1.0 } else { 1.0 }, 1.0, 1.0]))
    };
    refused(&folder_of(&mirrored(2)), "frame 2: the camera matrix mirrors the picture");
    let stretched = changed(nerfstudio(4), |_, matrix| scaled(matrix, [1.0, 1.1, 1.0]));
    refused(&folder_of(&stretched), "frame 0: the camera matrix is sheared, or stretched");
    let sheared = changed(nerfstudio(4), |_, matrix| {
        let mut matrix = matrix.clone();
        for row in 0..3 {
            let [x, y] = [0, 1].map(|column| matrix[row][column].as_f64().expect("a number"));
            matrix[row][1] = json!(y + 0.05 * x);
        }
        matrix
    });
    refused(&folder_of(&sheared), "frame 0: the camera matrix is sheared, or stretched");
    let rounded = changed(nerfstudio(4), |_, matrix| {
        let mut matrix = matrix.clone();
        for row in 0..3 {
            for column in 0..4 {
                let value = matrix[row][column].as_f64().expect("a number");
                matrix[row][column] = json!((value * 1000.0).round() / 1000.0);
            }
        }
        matrix
    });
    assert_eq!(views(&rounded).len(), 3, "matrices of three decimals are rotations");
}

#[test]
fn a_scale_shared_by_all_matrices_is_undone_and_noted() {
    let expected = views(&nerfstudio(4));
    for factor in [40.0, 0.025] {
        let folder = folder_of(&changed(nerfstudio(4), |_, matrix| scaled(matrix, [factor; 3])));
        let found = open(&folder, Split::Train);
        for (view, expected) in found.views.iter().zip(&expected) {
            let (pose, expected) = (view.camera.world_to_camera, expected.camera.world_to_camera);
            assert!(pose.abs_diff_eq(expected, 1e-5), "{}: the pose without the scale: {pose}", view.name);
        }
        assert!(found.notes.iter().any(|note| note.contains("scale")), "a note says so: {:?}", found.notes);
    }
    let mixed = changed(nerfstudio(4), |index, matrix| scaled(matrix, [if index == 3 { 2.0 } else { 1.0 }; 3]));
    refused(&folder_of(&mixed), "frame 3: the axes of the camera have the length 2, and those of most cameras 1");
}
