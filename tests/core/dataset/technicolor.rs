//! `cameras_parameters.txt` of Technicolor.
//!
//! In: small folders made here, of sixteen cameras that look at the origin. Out: proof that lines go with the cameras
//! of pictures, folders and videos, and of the test camera, times and lenses.

use super::Folder;
use super::formats::{names, open, picture, refused, times};
use super::looking::Looking;
use bevy_gs4d::internal::offline::dataset::Summary;
use bevy_gs4d::offline::dataset::{CameraOptions, Split};
use std::collections::HashSet;

const FOCAL: f64 = 50.0;
const ASPECT: f64 = 1.02;
const CENTER: [f64; 2] = [19.0, 16.0];

/// Returns the numbers of a line before the rotation.
fn lens() -> String {
    format!("{FOCAL} {} {} {ASPECT} 0.0", CENTER[0], CENTER[1])
}

/// Returns the numbers of the rotation and the translation of a camera.
fn pose(index: usize) -> String {
    let looking = Looking::on_arc(index);
    let numbers = looking.quaternion().into_iter().chain(looking.translation());
    numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(" ")
}

/// Writes the file of cameras.
fn cameras(folder: &Folder, count: usize) {
    let lines: String = (0..count).map(|index| format!("{} {}\n", lens(), pose(index))).collect();
    folder.write("cameras_parameters.txt", format!("f cx cy aspect skew qw qx qy qz tx ty tz \r\n{lines}\n"));
}

/// Checks that all views but those of some cameras are trained on.
fn check_train(folder: &Folder, without: &[usize], frames: usize) {
    let train = open(folder, Split::Train);
    let expected: Vec<usize> = (0..16).filter(|index| !without.contains(index)).collect();
    assert_eq!(train.views.len(), frames * expected.len(), "the views of all other cameras");
    for (views, index) in train.views.chunks(frames).zip(expected) {
        for view in views {
            Looking::on_arc(index).check(view, [FOCAL, FOCAL * ASPECT], CENTER);
        }
    }
    train.require_images().expect("the pictures are on disk");
}

#[test]
fn pictures_have_frame_and_camera_in_their_names() {
    for place in ["", "images/"] {
        let folder = Folder::new();
        cameras(&folder, 16);
        for camera in 0..16 {
            for frame in [151, 152, 160] {
                picture(&folder, &format!("{place}Train_undist_{frame:05}_{camera:02}.png"), [9, 9, 9]);
            }
        }
        check_train(&folder, &[10], 3);
        let test = open(&folder, Split::Test);
        assert_eq!(
            names(&test.views),
            ["Train_undist_00151_10", "Train_undist_00152_10", "Train_undist_00160_10"],
            "camera 10 is for the test"
        );
        assert_eq!(times(&test.views), [0.0, 1.0 / 30.0, 0.3], "30 frames a second, from the first frame");
        Looking::on_arc(10).check(&test.views[2], [FOCAL, FOCAL * ASPECT], CENTER);
        let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
        assert!(summary.format.starts_with("Technicolor"), "the format: {}", summary.format);
        assert_eq!((summary.cameras.len(), summary.times), (16, 3), "cameras and moments");
        assert!(summary.notes.iter().any(|note| note.contains("camera 10 is the test camera")), "{:?}", summary.notes);
    }
}

#[test]
fn undistorted_pictures_are_taken_and_missing_cameras_are_noted() {
    let folder = Folder::new();
    cameras(&folder, 16);
    for camera in (0..16).filter(|camera| ![3, 10].contains(camera)) {
        picture(&folder, &format!("Train_undist_00001_{camera:02}.png"), [9, 9, 9]);
        picture(&folder, &format!("Train_00001_{camera:02}.png"), [9, 9, 9]);
    }
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!((train.views.len(), test.views.len()), (12, 2), "without camera 10 every eighth camera is for the test");
    assert!(train.views.iter().all(|view| view.name.contains("undist")), "{:?}", names(&train.views));
    let notes = train.notes.join("; ");
    assert!(notes.contains("cameras without pictures are left out: 2 (number 3, 10)"), "{notes}");
}

#[test]
fn cameras_may_have_folders_of_frames() {
    for name in ["cam00", "00", "Camera_1"] {
        let folder = Folder::new();
        cameras(&folder, 16);
        for camera in 0..16 {
            let name = match name {
                "cam00" => format!("cam{camera:02}"),
                "00" => format!("images/{camera:02}"),
                _ => format!("frames/Camera_{}", camera + 1),
            };
            for frame in [5, 8] {
                picture(&folder, &format!("{name}/{frame:04}.png"), [9, 9, 9]);
            }
        }
        // A folder of work that other programs leave.
        picture(&folder, "colmap_0/input/cam00.png", [9, 9, 9]);
        let test = open(&folder, Split::Test);
        assert_eq!(test.views.len(), 2, "{name}: the frames of the test camera");
        for view in &test.views {
            Looking::on_arc(10).check(view, [FOCAL, FOCAL * ASPECT], CENTER);
        }
        assert_eq!(times(&test.views), [0.0, 0.1], "{name}: 30 frames a second");
        check_train(&folder, &[10], 2);
        let all = open(&folder, Split::Train).views;
        assert_eq!(all.iter().map(|view| &view.name).collect::<HashSet<_>>().len(), 30, "{name}: names of their own");
    }
}

#[test]
fn other_numbers_of_cameras_are_divided_as_usual() {
    let folder = Folder::new();
    cameras(&folder, 12);
    for camera in 0..12 {
        picture(&folder, &format!("a_1_{camera}.png"), [9, 9, 9]);
    }
    assert_eq!(names(&open(&folder, Split::Test).views), ["a_1_0", "a_1_8"], "every eighth camera");
}

#[test]
fn principal_points_far_from_the_center_are_noted() {
    let folder = Folder::new();
    cameras(&folder, 3);
    for camera in 0..3 {
        let path = folder.path().join(format!("a_1_{camera}.png"));
        image::RgbImage::new(20, 15).save(path).expect("an image of half the size");
    }
    let notes = open(&folder, Split::Train).notes.join("; ");
    assert!(notes.contains("a principal point is at 19, 16 in pictures of 20 x 15 pixels"), "{notes}");
}

#[test]
fn lines_and_pictures_that_cannot_be_used_are_named() {
    let folder = Folder::new();
    for camera in 0..2 {
        picture(&folder, &format!("a_1_{camera}.png"), [9, 9, 9]);
    }
    let header = "f cx cy aspect skew qw qx qy qz tx ty tz";
    let first = format!("{} {}", lens(), pose(0));
    for (second, part) in [
        (format!("{} 0.1 0 {}", lens(), pose(1)), "line 3: its pictures are distorted"),
        (format!("{} 1 0 0 1 0 0 0", lens()), "line 3: the quaternion qw qx qy qz has the length 1.41"),
        (format!("{} nan 0 0 0 0 0 0", lens()), "line 3: the quaternion"),
        (format!("{} {} 7", lens(), pose(1)), "line 3: must be the 12 numbers"),
        ("50 19 16 here".to_owned(), "line 3: must be the 12 numbers"),
        (format!("50 19 16 1 3 {}", pose(1)), "frame 1: skew is not 0 but 3"),
        (format!("-50 19 16 1 0 {}", pose(1)), "frame 1: the lens cannot be used"),
        (format!("50 19 16 0 0 {}", pose(1)), "frame 1: the lens cannot be used"),
    ] {
        folder.write("cameras_parameters.txt", format!("{header}\n{first}\n{second}\n"));
        refused(&folder, part);
    }
    let undistorted = format!("{} 0 0 {}", lens(), pose(1));
    folder.write("cameras_parameters.txt", format!("{header} d1 d2\n{first}\n{undistorted}\n"));
    assert_eq!(open(&folder, Split::Train).views.len(), 1, "a distortion of 0 is none");
    picture(&folder, "a_1_2.png", [9, 9, 9]);
    refused(&folder, "a_1_2.png: it is a picture of camera 2, and cameras_parameters.txt has the cameras 0 to 1");
    std::fs::remove_file(folder.path().join("a_1_2.png")).expect("the picture is there");
    picture(&folder, "a_1_00.png", [9, 9, 9]);
    refused(&folder, "a_1_00.png: it has the camera and the frame of");
    let empty = Folder::new();
    cameras(&empty, 2);
    refused(&empty, "has a video or a folder of frames beside it");
}
