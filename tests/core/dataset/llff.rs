//! `poses_bounds.npy` of LLFF, with pictures in `images/`.
//!
//! In: small folders made here, of cameras that look at the origin. Out: proof that pictures go with the rows by their
//! names, at rest, as frames of a camera that moves, and as frames of several cameras.

use super::Folder;
use super::formats::{colmap_text, names, open, picture, refused, times};
use super::looking::Looking;
use bevy_gs4d::internal::offline::dataset::Summary;
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split};

const FOCAL: f64 = 50.0;
/// Half of the width and the height of the pictures.
const CENTER: [f64; 2] = [20.0, 15.0];

/// Writes `poses_bounds.npy` with a row for each camera: for each axis of the world the camera's axes down, right and
/// backwards, its place, and one of height, width and focal length; then the nearest and the farthest depth.
fn poses(folder: &Folder, cameras: usize) {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({cameras}, 17), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for index in 0..cameras {
        let Looking { position, right, down, forward } = Looking::on_arc(index);
        let lens = [2.0 * CENTER[1], 2.0 * CENTER[0], FOCAL];
        for axis in 0..3 {
            let row = [down[axis], right[axis], -forward[axis], position[axis], lens[axis]];
            bytes.extend(row.into_iter().flat_map(f64::to_le_bytes));
        }
        bytes.extend([0.5, 90.0].into_iter().flat_map(f64::to_le_bytes));
    }
    folder.write("poses_bounds.npy", bytes);
}

fn notes(folder: &Folder) -> String {
    open(folder, Split::Train).notes.join("; ")
}

#[test]
fn pictures_of_a_scene_at_rest_go_with_the_rows_by_name() {
    let folder = Folder::new();
    poses(&folder, 9);
    // The order of names as text is that of the rows; hidden files and texts are no pictures.
    for number in [12, 14, 15, 20, 21, 22, 30, 31, 99] {
        picture(&folder, &format!("images/IMG_{number}.png"), [9, 9, 9]);
    }
    folder.write("images/._IMG_12.png", b"");
    folder.write("images/readme.txt", b"");
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["IMG_12", "IMG_99"], "every eighth picture is for the test");
    assert_eq!(names(&train.views)[..2], ["IMG_14", "IMG_15"], "the others are trained on, with their own names");
    for (view, index) in train.views.iter().zip(1..) {
        Looking::on_arc(index).check(view, [FOCAL; 2], CENTER);
        assert_eq!(view.time, 0.0, "{}: the scene is at rest", view.name);
    }
    Looking::on_arc(8).check(&test.views[1], [FOCAL; 2], CENTER);
    train.require_images().expect("the pictures are on disk");
    let notes = notes(&folder);
    for part in ["9 pictures are read as pictures of a scene at rest", "name their folder frames", "principal point"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
    let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
    assert_eq!((summary.format, summary.times), ("LLFF (poses_bounds.npy with images)", 1), "the name of the format");
}

#[test]
fn an_order_of_names_that_is_not_that_of_numbers_is_noted() {
    let folder = Folder::new();
    poses(&folder, 4);
    for name in ["1", "2", "3", "10"] {
        picture(&folder, &format!("images/{name}.png"), [9, 9, 9]);
    }
    let train = open(&folder, Split::Train);
    assert_eq!(names(&train.views), ["10", "2", "3"], "the order of names as text, as LLFF writes the rows");
    Looking::on_arc(1).check(&train.views[0], [FOCAL; 2], CENTER);
    assert!(notes(&folder).contains("as text, not of their numbers"), "the order is noted: {}", notes(&folder));
}

#[test]
fn numbered_pictures_are_frames_of_a_moving_camera_if_the_folder_says_so() {
    for (inside, beside, reason) in
        [("frames", None, "their folder is frames"), ("images", Some("motion_masks"), "motion_masks lies beside")]
    {
        let folder = Folder::new();
        poses(&folder, 4);
        for number in [7, 8, 9, 22] {
            picture(&folder, &format!("{inside}/{number:05}.png"), [9, 9, 9]);
        }
        if let Some(name) = beside {
            folder.write(format!("{name}/00007.png"), b"");
        }
        let train = open(&folder, Split::Train);
        assert_eq!(times(&train.views), [1.0 / 30.0, 2.0 / 30.0, 0.5], "{inside}: 30 frames a second, with the gap");
        Looking::on_arc(3).check(&train.views[2], [FOCAL; 2], CENTER);
        assert!(notes(&folder).contains(reason), "{reason:?} is not in: {}", notes(&folder));
        let options = CameraOptions { is_static: true, ..CameraOptions::default() };
        let still = Dataset::open(folder.path(), Split::Train, &options).expect("a scene at rest");
        assert_eq!(times(&still.views), [0.0; 3], "--static reads them as pictures of a scene at rest");
        assert!(!still.notes.iter().any(|note| note.contains("pictures are read")), "nothing is assumed then");
    }
}

#[test]
fn frames_of_several_cameras_go_with_the_rows() {
    let (flat, folders) = (Folder::new(), Folder::new());
    for folder in [&flat, &folders] {
        poses(folder, 3);
    }
    for camera in ["a", "b", "c"] {
        for number in [3, 4, 10] {
            picture(&flat, &format!("images/{camera}_{number}.png"), [9, 9, 9]);
            picture(&folders, &format!("images/{camera}/{number}.png"), [9, 9, 9]);
        }
    }
    for folder in [&flat, &folders] {
        let (train, test) = (open(folder, Split::Train), open(folder, Split::Test));
        assert_eq!(names(&test.views), ["a_3", "a_4", "a_10"], "the first camera of up to eight is for the test");
        assert_eq!(times(&test.views), [0.0, 1.0 / 30.0, 7.0 / 30.0], "the numbers are times");
        for (view, index) in train.views.iter().zip([1, 1, 1, 2, 2, 2]) {
            Looking::on_arc(index).check(view, [FOCAL; 2], CENTER);
        }
        train.require_images().expect("the pictures are on disk");
    }
}

#[test]
fn each_row_needs_its_picture() {
    let folder = Folder::new();
    poses(&folder, 3);
    picture(&folder, "images/a.png", [9, 9, 9]);
    picture(&folder, "images/b.png", [9, 9, 9]);
    refused(&folder, "it has 3 rows, and beside it are 2 pictures and 0 folders of pictures in images");
    folder.write("poses_bounds.npy", b"\x93NUMPY");
    refused(&folder, "poses_bounds.npy: not a whole .npy file");
}

#[test]
fn a_colmap_model_is_read_in_place_of_poses_beside_it() {
    let folder = Folder::new();
    poses(&folder, 2);
    for name in ["a.png", "b.png"] {
        picture(&folder, &format!("images/{name}"), [9, 9, 9]);
    }
    colmap_text(&folder, "PINHOLE 40 30 50 52 19 16", &[("a.png", 0), ("b.png", 1)]);
    let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
    assert!(summary.format.starts_with("COLMAP"), "the model has the lens, too: {}", summary.format);
}
