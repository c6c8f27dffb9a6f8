//! Folders, names and models of COLMAP, also as users arrange them.
//!
//! In: small models made here, with images in subfolders, without points, twice, with other names than on disk. Out:
//! proof that no image is lost, and that assumptions are noted.

use super::Folder;
use super::formats::{PINHOLE, colmap_binary, colmap_text, n3v, names, open, picture, refused, times};
use bevy_gs4d::internal::offline::dataset::PointCloud;
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use glam::DVec3;
use std::fs;

/// Returns all views of both splits, sorted by name, and the notes.
fn read(folder: &Folder, options: &CameraOptions) -> (Vec<TrainingView>, Vec<String>) {
    let splits = [Split::Train, Split::Test].map(|split| Dataset::open(folder.path(), split, options));
    let [train, test] = splits.map(|split| split.expect("a valid dataset"));
    let mut views = [train.views, test.views].concat();
    views.sort_by(|a, b| a.name.cmp(&b.name));
    (views, train.notes)
}

fn views(folder: &Folder) -> Vec<TrainingView> {
    read(folder, &CameraOptions::default()).0
}

#[test]
fn images_in_subfolders_are_at_rest_unless_the_subfolders_are_cameras() {
    let folder = Folder::new();
    let images: Vec<String> =
        (0..12).map(|index| format!("{:02}/{:02}_{index:05}.png", index / 6, index / 6)).collect();
    let images: Vec<(&str, usize)> = images.iter().map(String::as_str).zip(0..).collect();
    colmap_text(&folder, PINHOLE, &images);
    let (found, notes) = read(&folder, &CameraOptions::default());
    assert_eq!((found.len(), times(&found)), (12, vec![0.0; 12]), "each image is a picture of a scene at rest");
    assert!(notes.iter().any(|note| note.contains("at rest") && note.contains("00, 01")), "a note says so: {notes:?}");

    let frames = [("a/0001.png", 0), ("a/0002.png", 1), ("b/0001.png", 2), ("b/0002.png", 3)];
    colmap_text(&folder, PINHOLE, &frames);
    let (found, notes) = read(&folder, &CameraOptions::default());
    assert_eq!(times(&found), [0.0, 1.0 / 30.0, 0.0, 1.0 / 30.0], "folders with the same frames are cameras");
    assert!(notes.iter().any(|note| note.contains("--static")), "the option is named: {notes:?}");
    let (found, notes) = read(&folder, &CameraOptions { is_static: true, ..CameraOptions::default() });
    assert_eq!(times(&found), [0.0; 4], "the option reads them at rest");
    assert!(notes.is_empty(), "nothing is assumed: {notes:?}");
}

#[test]
fn the_option_for_scenes_at_rest_reads_only_the_images_of_the_model() {
    let folder = Folder::new();
    colmap_text(&folder, PINHOLE, &[("cam0/005.png", 0), ("cam1.png", 1), ("cam2/005.png", 2)]);
    for camera in 0..3 {
        for frame in [5, 6] {
            picture(&folder, &format!("images/cam{camera}/{frame:03}.png"), [1, 2, 3]);
        }
    }
    let (found, notes) = read(&folder, &CameraOptions::default());
    assert_eq!(found.len(), 6, "two frames of each camera");
    assert!(notes.iter().any(|note| note.contains("do not move") && note.ends_with('3')), "a note says so: {notes:?}");
    let (found, _) = read(&folder, &CameraOptions { is_static: true, ..CameraOptions::default() });
    assert_eq!(names(&found), ["cam0_005", "cam1", "cam2_005"], "the images of the model");
    assert_eq!(times(&found), [0.0; 3], "at time 0");
}

#[test]
fn every_time_is_0_with_the_option_for_scenes_at_rest() {
    let folder = Folder::new();
    let frame = |x: i32| {
        serde_json::json!({
            "file_path": format!("f{x}"), "time": x,
            "transform_matrix": [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]],
        })
    };
    let json = serde_json::json!({ "camera_angle_x": 0.8, "w": 8, "h": 8, "frames": [frame(2), frame(3), frame(4)] });
    for name in ["transforms.json", "transforms_train.json"] {
        let folder = folder.path().join(name.replace(".json", ""));
        fs::create_dir(&folder).expect("the folder can be made");
        fs::write(folder.join(name), json.to_string()).expect("the folder can be written to");
        let options = CameraOptions { is_static: true, time_interval: Some([0.0, 1.0]), ..CameraOptions::default() };
        let found = Dataset::open(&folder, Split::Train, &options).expect("a valid dataset").views;
        assert!(found.iter().all(|view| view.time == 0.0) && found.len() > 1, "{name}: {:?}", times(&found));
    }
}

/// Returns `images.txt` with `points` after each image.
fn images_txt(folder: &Folder, images: &[(&str, usize)], points: &str) {
    colmap_text(folder, PINHOLE, images);
    let text = fs::read_to_string(folder.path().join("sparse/0/images.txt")).expect("just written");
    folder.write("sparse/0/images.txt", text.replace("1.5 2.5 -1 3.5 4.5 12\n", points));
}

#[test]
fn images_txt_is_read_with_any_form_of_second_lines() {
    let images: Vec<String> = (0..12).map(|index| format!("i {index:02}.png")).collect();
    let images: Vec<(&str, usize)> = images.iter().map(String::as_str).zip(0..).collect();
    let folder = Folder::new();
    for points in ["1.5 2.5 -1\n", "\n", "", "# none\n", "\n\n", "1.5 2.5 -1 nan 4.5 12\n\n"] {
        images_txt(&folder, &images, points);
        assert_eq!(views(&folder).len(), 12, "{points:?} after each image");
    }
    images_txt(&folder, &images, "");
    let text = fs::read_to_string(folder.path().join("sparse/0/images.txt")).expect("just written");
    let lines: Vec<&str> = text.lines().collect();
    folder.write("sparse/0/images.txt", [&lines[..3], &["1.5 2.5 -1"], &lines[3..]].concat().join("\r\n"));
    assert_eq!(views(&folder).len(), 12, "points of one image, and line ends of Windows");
    for (wrong, part) in [("1.5 2.5", "line 4: neither the points"), ("1.5 2.5 -1\n1.5 2.5 -1", "line 5: must be ID")] {
        folder.write("sparse/0/images.txt", [&lines[..3], &[wrong], &lines[3..]].concat().join("\n"));
        refused(&folder, part);
    }
}

#[test]
fn images_that_are_in_a_model_twice_are_used_once_or_refused() {
    let (text, binary) = (Folder::new(), Folder::new());
    for (folder, is_text) in [(&text, true), (&binary, false)] {
        let write = |images: &[(&str, usize)]| match is_text {
            true => colmap_text(folder, PINHOLE, images),
            false => colmap_binary(folder, images),
        };
        write(&[("a.png", 0), ("b.png", 1), (r".\a.png", 0)]);
        let (found, notes) = read(folder, &CameraOptions::default());
        assert_eq!(names(&found), ["a", "b"], "the same pose: once");
        assert!(notes.iter().any(|note| note.contains("twice") && note.contains("a.png")), "a note says so: {notes:?}");
        write(&[("a.png", 0), ("b.png", 1), ("a.png", 2)]);
        refused(folder, "image a.png is in it twice");
    }
    let cameras = format!("7 {PINHOLE}\n7 PINHOLE 40 30 90 90 20 15\n");
    text.write("sparse/0/cameras.txt", cameras);
    refused(&text, "line 2: camera 7 is in it twice");
}

/// Moves the model of a folder to another place.
fn move_model(folder: &Folder, to: &str) {
    let to = folder.path().join(to);
    fs::create_dir_all(to.parent().expect("a folder")).expect("the folder can be made");
    fs::rename(folder.path().join("sparse/0"), to).expect("the folder can be moved");
}

#[test]
fn the_model_with_the_most_images_is_read() {
    let images = [("a.png", 0), ("b.png", 1), ("c.png", 2), ("d.png", 3), ("e.png", 4)];
    let folder = Folder::new();
    colmap_text(&folder, PINHOLE, &images);
    move_model(&folder, "sparse/1");
    let (found, notes) = read(&folder, &CameraOptions::default());
    assert_eq!((found.len(), notes.len()), (5, 0), "the only model, in sparse/1");
    colmap_text(&folder, PINHOLE, &images[..2]);
    let (found, notes) = read(&folder, &CameraOptions::default());
    assert_eq!(found.len(), 5, "five images are more than two");
    assert!(notes[0].contains("most images, 5") && notes[0].contains("has 2"), "a note says so: {notes:?}");
    colmap_binary(&folder, &[images[0], images[1], images[2], images[3], images[4], ("f.png", 5)]);
    assert_eq!(views(&folder).len(), 6, "the binary model in sparse/0");
    let below = Folder::new();
    for (name, count) in [("colmap/sparse/2", 2), ("colmap/sparse/10", 4), ("colmap/sparse/11", 4)] {
        colmap_text(&below, PINHOLE, &images[..count]);
        move_model(&below, name);
    }
    let dataset = open(&below, Split::Train);
    assert!(dataset.notes[0].contains("sparse/10 is read"), "the first of the largest: {:?}", dataset.notes);
}

#[test]
fn names_with_backslashes_are_paths() {
    let folder = Folder::new();
    colmap_text(&folder, PINHOLE, &[(r"a\i00.png", 0), (r".\a\i01.png", 1)]);
    for name in ["i00", "i01"] {
        picture(&folder, &format!("images/a/{name}.png"), [1, 2, 3]);
    }
    let dataset = open(&folder, Split::Train);
    dataset.require_images().expect("the images are on disk");
    assert_eq!(names(&dataset.views), ["a_i01"], "the name of a view has neither backslashes nor a leading dot");
}

#[cfg(target_os = "linux")]
#[test]
fn images_are_found_by_names_of_another_case_extension_or_encoding() {
    let folder = Folder::new();
    colmap_text(&folder, PINHOLE, &[("img_01.jpg", 0), ("caf\u{e9}.png", 1), ("c.png", 2)]);
    for name in ["images.txt", "cameras.txt"] {
        let path = folder.path().join("sparse/0").join(name);
        let text = fs::read_to_string(&path).expect("just written");
        let latin: Vec<u8> = text.chars().map(|character| u8::try_from(character).expect("Latin-1")).collect();
        fs::write(path, [&b"\xef\xbb\xbf"[..], &latin].concat()).expect("the folder can be written to");
    }
    for name in ["IMG_01.JPG", "caf\u{e9}.png", "C.PNG"] {
        picture(&folder, &format!("images/{name}"), [1, 2, 3]);
    }
    let (found, notes) = read(&folder, &CameraOptions::default());
    assert_eq!(found.len(), 3, "a byte order mark is not part of the first line");
    for view in &found {
        view.load_covered().expect("the image is on disk");
    }
    assert!(notes.iter().any(|note| note.starts_with("2 files have other names")), "a note says so: {notes:?}");
    fs::remove_file(folder.path().join("images/C.PNG")).expect("the image is there");
    let error = open(&folder, Split::Test).require_images().expect_err("an image is missing").to_string();
    assert!(error.contains("c.png"), "the name in the model: {error}");
}

#[test]
fn hidden_files_of_operating_systems_are_not_frames() {
    let folder = Folder::new();
    n3v(&folder, 3);
    for camera in 0..3 {
        for name in ["0000", "0001"] {
            picture(&folder, &format!("cam{camera:02}/{name}.png"), [9, 9, 9]);
            folder.write(format!("cam{camera:02}/._{name}.png"), b"\x00\x05\x16\x07");
        }
        folder.write(format!("._cam{camera:02}.mp4"), b"\x00\x05\x16\x07");
        folder.write(format!("cam{camera:02}/Thumbs.db"), b"");
    }
    folder.write("__MACOSX/cam00/._0000.png", b"");
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!((train.views.len(), test.views.len()), (4, 2), "two frames of three cameras");
    let colmap = Folder::new();
    colmap_text(&colmap, PINHOLE, &[("cam0/1.png", 0), ("cam1/1.png", 1)]);
    for name in ["1.png", "2.png", "._1.png", "._2.png"] {
        picture(&colmap, &format!("images/cam0/{name}"), [9, 9, 9]);
    }
    assert_eq!(views(&colmap).len(), 3, "two frames of one camera, one of the other");
}

#[test]
fn cameras_and_points_far_from_0_are_relative_to_one_origin() {
    let folder = Folder::new();
    colmap_text(&folder, PINHOLE, &[]);
    let place = |index: i32| DVec3::new(500_000.0 + 3.0 * f64::from(index), 5_400_000.0, 300.0);
    let line = |index: i32| {
        let DVec3 { x, y, z } = -place(index);
        format!("{index} 1 0 0 0 {x} {y} {z} 7 i{index:02}.png\n")
    };
    folder.write("sparse/0/images.txt", (0..12).map(line).collect::<String>());
    folder.write("sparse/0/points3D.txt", "1 500001.5 5400000.25 304.5 10 20 30 0.5\n");
    let dataset = open(&folder, Split::Train);
    let origin = DVec3::from(dataset.origin.place);
    assert!(dataset.notes.iter().any(|note| note.contains("far from 0")), "a note says so: {:?}", dataset.notes);
    for view in &dataset.views {
        let index = view.name[1..].parse().expect("the number of the camera");
        let found = view.camera.world_to_camera.inverse().w_axis.truncate().as_dvec3() + origin;
        assert!(found.distance(place(index)) < 1e-3, "{}: the camera is at {found}", view.name);
    }
    let points = dataset.points.expect("the model has points");
    let PointCloud(points) = PointCloud::load(&points, &dataset.origin).expect("a valid file of points");
    let found = points[0].position.as_dvec3() + origin;
    assert!(found.distance(DVec3::new(500_001.5, 5_400_000.25, 304.5)) < 1e-3, "the point is at {found}");
}

#[test]
fn a_folder_named_lego_has_its_own_test_views_without_a_file_of_the_third_split() {
    let folder = Folder::new();
    let json = super::transforms().to_string();
    for split in ["train", "test"] {
        folder.write(format!("lego/transforms_{split}.json"), &json);
    }
    let lego = folder.path().join("lego");
    let test = || Dataset::open(&lego, Split::Test, &CameraOptions::default()).expect("a dataset");
    assert_eq!((test().split, test().notes.len()), (Split::Test, 0), "the test split");
    folder.write("lego/transforms_val.json", &json);
    assert_eq!(test().split, Split::Val, "the third split, as in the original");
    assert!(test().notes[0].contains("transforms_val.json"), "a note says so: {:?}", test().notes);
}

#[test]
fn poses_in_fortran_order_equal_poses_in_c_order() {
    let folder = Folder::new();
    n3v(&folder, 3);
    for camera in 0..3 {
        picture(&folder, &format!("cam{camera:02}/0000.png"), [9, 9, 9]);
    }
    let expected = views(&folder);
    let bytes = fs::read(folder.path().join("poses_bounds.npy")).expect("just written");
    let (header, values) = bytes.split_at(bytes.len() - 3 * 17 * 8);
    let text = std::str::from_utf8(&header[10..]).expect("the header is ASCII").replace("False", "True ");
    let columns = (0..17).flat_map(|column| (0..3).map(move |row| &values[(row * 17 + column) * 8..][..8]));
    let columns: Vec<&[u8]> = columns.collect();
    folder.write("poses_bounds.npy", [&header[..10], text.as_bytes(), &columns.concat()].concat());
    assert_eq!(views(&folder), expected, "the same cameras");
}

#[test]
fn errors_of_damaged_frames_of_a_video_say_what_to_delete() {
    let folder = Folder::new();
    let data = folder.path().join("data");
    let inside = Folder::new();
    n3v(&inside, 2);
    fs::create_dir(&data).expect("the folder can be made");
    fs::copy(inside.path().join("poses_bounds.npy"), data.join("poses_bounds.npy")).expect("a copy");
    for camera in ["cam00", "cam01"] {
        folder.write(format!("data/{camera}.mp4"), b"no video");
        folder.write(format!("data.frames/{camera}/00000.png"), b"no image");
    }
    let train = Dataset::open(&data, Split::Train, &CameraOptions::default()).expect("the frames are there");
    let error = train.views[0].load_covered().expect_err("no image").to_string();
    for part in ["00000.png: not a readable", "data.frames, so that the frames are decoded"] {
        assert!(error.contains(part), "{part:?} is not in: {error}");
    }
}
