//! `EasyVolcap`, `ENeRF` and `SelfCap`: `intri.yml` and `extri.yml`, with frames or videos of each camera.
//!
//! In: small folders made here, of cameras that look at the origin. Out: proof of poses, lenses, sizes, times and
//! offsets of clocks, and that wrong calibrations are refused by name.

use super::Folder;
use super::formats::{names, open, picture, refused, times};
use super::looking::Looking;
use bevy_gs4d::internal::offline::dataset::Summary;
use bevy_gs4d::offline::dataset::{CameraOptions, Split};
use glam::UVec2;

const FOCAL: [f64; 2] = [50.0, 52.0];
const CENTER: [f64; 2] = [19.0, 16.0];

/// Returns a matrix as `EasyVolcap` writes it.
fn matrix(name: &str, rows: usize, numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:.10}")).collect();
    let columns = numbers.len() / rows;
    let data = numbers.join(", ");
    format!("{name}: !!opencv-matrix\r\n  rows: {rows}\r\n  cols: {columns}\r\n  dt: d\r\n  data: [{data}]\r\n")
}

fn name_list(cameras: usize) -> String {
    let names: String = (0..cameras).map(|camera| format!("  - \"{camera:02}\"\r\n")).collect();
    format!("%YAML:1.0\r\n---\r\nnames:\r\n{names}")
}

/// Returns a camera of `intri.yml`.
fn lens(camera: usize, distortion: [f64; 5]) -> String {
    let k = [FOCAL[0], 0.0, CENTER[0], 0.0, FOCAL[1], CENTER[1], 0.0, 0.0, 1.0];
    matrix(&format!("K_{camera:02}"), 3, &k) + &matrix(&format!("D_{camera:02}"), 5, &distortion)
}

fn size(camera: usize) -> String {
    format!("H_{camera:02}: 30.0000000000\r\nW_{camera:02}: 40.0000000000\r\n")
}

/// Returns the rotation of a camera of `extri.yml` as a vector.
fn vector(camera: usize) -> String {
    matrix(&format!("R_{camera:02}"), 3, &Looking::on_arc(camera).vector())
}

/// Returns the rotation of a camera of `extri.yml` as a matrix.
fn rotation(camera: usize) -> String {
    matrix(&format!("Rot_{camera:02}"), 3, Looking::on_arc(camera).rotation().as_flattened())
}

fn translation(camera: usize) -> String {
    matrix(&format!("T_{camera:02}"), 3, &Looking::on_arc(camera).translation())
}

/// Writes both files of so many cameras, into a folder inside the folder.
fn calibration(folder: &Folder, at: &str, cameras: usize) {
    let each = |of: &dyn Fn(usize) -> String| name_list(cameras) + &(0..cameras).map(of).collect::<String>();
    folder.write(format!("{at}intri.yml"), each(&|camera| lens(camera, [0.0; 5]) + &size(camera)));
    folder.write(format!("{at}extri.yml"), each(&|camera| vector(camera) + &rotation(camera) + &translation(camera)));
}

/// Writes frames of cameras with these numbers.
fn frames(folder: &Folder, cameras: usize, numbers: &[usize]) {
    for camera in 0..cameras {
        for number in numbers {
            picture(folder, &format!("images/{camera:02}/{number:06}.jpg"), [9, 9, 9]);
        }
    }
}

#[test]
fn cameras_stand_where_their_rotations_and_translations_say() {
    let folder = Folder::new();
    calibration(&folder, "", 9);
    frames(&folder, 9, &[10, 12]);
    picture(&folder, "masks/01/000012.png", [255, 255, 255]);
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["00_000010", "00_000012", "08_000010", "08_000012"], "every eighth camera");
    assert_eq!(names(&train.views)[..2], ["01_000010", "01_000012"], "the other cameras");
    for (index, view) in train.views.iter().enumerate() {
        Looking::on_arc(1 + index / 2).check(view, FOCAL, CENTER);
        assert_eq!(view.original, UVec2::new(40, 30), "{}: the size", view.name);
    }
    assert_eq!(times(&train.views)[..2], [0.0, 2.0 / 30.0], "gaps keep their time, 30 frames a second");
    assert_eq!(train.views[1].mask, Some(folder.path().join("masks/01/000012.png")), "a mask");
    train.require_images().expect("every frame is on disk");
    let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
    assert!(summary.format.starts_with("EasyVolcap"), "the format is named: {}", summary.format);
}

#[test]
fn rotations_are_vectors_or_matrices_and_sizes_those_of_the_pictures() {
    for rotated in [vector as fn(usize) -> String, rotation] {
        let folder = Folder::new();
        let each = |of: &dyn Fn(usize) -> String| name_list(3) + &(0..3).map(of).collect::<String>();
        folder.write("intri.yml", each(&|camera| lens(camera, [0.0; 5]).replace("D_", "dist_")));
        folder.write("extri.yml", each(&|camera| rotated(camera) + &translation(camera)));
        frames(&folder, 3, &[0]);
        for (view, camera) in open(&folder, Split::Train).views.iter().zip(1..) {
            Looking::on_arc(camera).check(view, FOCAL, CENTER);
            assert_eq!(view.original, UVec2::new(40, 30), "{}: the size of its picture", view.name);
        }
    }
}

#[test]
fn offsets_of_clocks_move_the_times_of_cameras() {
    let folder = Folder::new();
    calibration(&folder, "optimized/", 3);
    // The cameras beside it are less good: they are not read.
    folder.write("intri.yml", "nothing");
    folder.write("optimized/sync.json", r#"{"00": 0.02, "01": -0.01, "02": 0.02, "03": 9}"#);
    frames(&folder, 3, &[7, 8]);
    let train = open(&folder, Split::Train);
    let expected = [0.03, 0.03 + 1.0 / 60.0, 0.0, 1.0 / 60.0];
    for (found, expected) in times(&train.views).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-6, "frame / 60 - offset, counted from the first: {found} is {expected}");
    }
    let notes = train.notes.join("; ");
    for part in ["optimized/", "up to 0.030 s", "60 a second"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
    folder.write("optimized/sync.json", r#"{"00": 0.02, "01": "late"}"#);
    refused(&folder, "sync.json: it has no offset in seconds of camera 01");
}

#[test]
fn videos_have_the_names_of_their_cameras() {
    let folder = Folder::new();
    calibration(&folder, "", 3);
    for camera in 0..2 {
        folder.write(format!("videos/{camera:02}.mp4"), b"not decoded");
    }
    let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
    assert_eq!(summary.cameras.len(), 2, "a camera for each video");
    let said = [summary.missing, summary.notes].concat().join("; ");
    for part in ["2 videos have not been decoded", "left out: 02"] {
        assert!(said.contains(part), "{part:?} is not in: {said}");
    }
}

#[test]
fn entries_that_are_not_used_are_noted() {
    let folder = Folder::new();
    calibration(&folder, "", 2);
    frames(&folder, 2, &[0]);
    let more = |file: &str, text: &str| {
        let path = folder.path().join(file);
        let whole = std::fs::read_to_string(&path).expect("just written") + text;
        std::fs::write(path, whole).expect("the folder can be written to");
    };
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    more("intri.yml", &(matrix("ccm_00", 3, &identity) + &matrix("ccm_01", 3, &[1.5; 9])));
    more("extri.yml", "t_00: 0.0000000000\r\nt_01: 0.5000000000\r\nn_00: 1.0\r\n");
    let notes = open(&folder, Split::Train).notes;
    for part in ["(ccm) are not made: 01", "numbers of frames: 01"] {
        assert!(notes.iter().any(|note| note.ends_with(part)), "{part:?} ends none of: {notes:?}");
    }
}

#[test]
fn wrong_calibrations_are_refused_with_their_camera() {
    let folder = Folder::new();
    frames(&folder, 2, &[0]);
    let changed = |file: &str, from: &str, to: &str, part: &str| {
        calibration(&folder, "", 2);
        let path = folder.path().join(file);
        let text = std::fs::read_to_string(&path).expect("just written");
        assert!(text.contains(from), "{from:?} is in {file}");
        std::fs::write(&path, text.replacen(from, to, 1)).expect("the folder can be written to");
        refused(&folder, part);
    };
    changed("extri.yml", "T_01", "T_02", "extri.yml: it has no T_01");
    changed("extri.yml", "rows: 3", "rows: 4", "extri.yml: line 6: R_00 has 3 numbers, and says 4 rows");
    changed("intri.yml", "K_01", "X_01", "intri.yml: it has no K_01");
    changed("intri.yml", "[50.0", "[-50.0", "camera 00: the lens cannot be used");
    changed("intri.yml", "[50.0000000000, 0.0", "[50.0000000000, 3.0", "camera 00: the skew of K");
    changed(
        "intri.yml",
        "cols: 1\r\n  dt: d\r\n  data: [0.0",
        "cols: 1\r\n  dt: d\r\n  data: [-9.0",
        "camera 00: the distortion",
    );
    changed("intri.yml", "\"01\"", "\"../01\"", "\"../01\" of a camera is that of no folder");
    changed("intri.yml", "H_00: 30.0", "H_00: 30.5", "camera 00: pictures of 40x30.5 pixels");
    let other = Looking::on_arc(5).rotation();
    calibration(&folder, "", 2);
    let text = name_list(2) + &vector(0) + &matrix("Rot_00", 3, other.as_flattened()) + &translation(0);
    folder.write("extri.yml", text);
    refused(&folder, "R_00 and Rot_00 are different rotations");
    folder.write("extri.yml", name_list(2) + &translation(0));
    refused(&folder, "it has no R_00 and no Rot_00");
    std::fs::remove_file(folder.path().join("extri.yml")).expect("the file exists");
    refused(&folder, "extri.yml: cannot be read");
}
