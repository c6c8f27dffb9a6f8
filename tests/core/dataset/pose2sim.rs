//! Calibrations of Pose2Sim and Qualisys beside videos and folders of frames.
//!
//! In: small folders made here, of cameras that look at the origin. Out: proof that both forms give the same cameras,
//! that footage is found by the names of cameras, and that times are those of the videos.

use super::Folder;
use super::formats::{names, picture, times};
use super::looking::Looking;
use bevy_gs4d::internal::offline::dataset::Summary;
use bevy_gs4d::offline::dataset::{CameraOptions, Correction, Dataset, DatasetError, Split, TrainingView};
use glam::UVec2;
use image::RgbImage;
use std::path::PathBuf;

const FOCAL: [f64; 2] = [50.0, 52.0];
const CENTER: [f64; 2] = [19.0, 16.0];
/// The pictures of the helpers of the tests.
const SIZE: [u32; 2] = [40, 30];

/// A dataset inside of a temporary folder, so that decoded frames lie there, too.
struct Data {
    folder: Folder,
}

impl Data {
    fn new() -> Self {
        let data = Self { folder: Folder::new() };
        data.write("notes.txt", "");
        data
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        self.folder.write(format!("data/{name}"), contents);
    }

    fn picture(&self, name: &str) {
        picture(&self.folder, &format!("data/{name}"), [9, 9, 9]);
    }

    /// Writes pictures of any size in the place of decoded frames.
    fn decoded(&self, camera: &str, frames: u32, size: [u32; 2]) {
        for frame in 0..frames {
            let path = self.folder.write(format!("data.frames/{camera}/{frame:05}.png"), "");
            RgbImage::new(size[0], size[1]).save(path).expect("an image");
        }
    }

    fn try_open(&self, split: Split) -> Result<Dataset, DatasetError> {
        Dataset::open(&self.path(), split, &CameraOptions::default())
    }

    fn open(&self, split: Split) -> Dataset {
        self.try_open(split).expect("a valid dataset")
    }

    #[track_caller]
    fn refused(&self, parts: &[&str]) {
        let error = self.try_open(Split::Train).expect_err("a wrong dataset").to_string();
        for part in parts {
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }
}

/// Returns the table of a camera as Pose2Sim writes it.
fn table(name: &str, camera: &Looking, coefficients: &str) -> String {
    // OpenCV counts from the middle of the first pixel.
    let [[fx, fy], [cx, cy], [width, height]] = [FOCAL, CENTER.map(|side| side - 0.5), SIZE.map(f64::from)];
    format!(
        "[{name}]\nname = \"{name}\"\nsize = [ {width:?}, {height:?},]\n\
         matrix = [ [ {fx:?}, 0.0, {cx:?},], [ 0.0, {fy:?}, {cy:?},], [ 0.0, 0.0, 1.0,],]\n\
         distortions = [ {coefficients},]\nrotation = {:?}\ntranslation = {:?}\nfisheye = false\n\n",
        camera.vector(),
        camera.translation()
    )
}

const METADATA: &str = "[metadata]\nadjusted = false\nerror = 0.0\n";
const NONE: &str = "0.0, 0.0, 0.0, 0.0";

/// Returns a calibration of these cameras in TOML.
fn toml(names: &[&str]) -> String {
    let tables = names.iter().enumerate().map(|(index, name)| table(name, &Looking::on_arc(index), NONE));
    tables.collect::<String>() + METADATA
}

/// Returns the element of a camera as Qualisys writes it. Its pictures have this part of 1080 lines, and its field
/// begins at this pixel of the sensor.
fn element(name: &str, camera: &Looking, lines: u32, corner: [u32; 2]) -> String {
    let Looking { position, right, down, forward } = *camera;
    let [up, backwards] = [down, forward].map(|axis| axis.map(|value| -value));
    let [x, y, z] = position.map(|value| 1000.0 * value);
    let sensor = 1080.0 / f64::from(lines);
    // 64ths of a pixel of the sensor.
    let [fu, fv] = FOCAL.map(|value| 64.0 * sensor * value);
    let [cu, cv] = [0, 1].map(|axis| 64.0 * (sensor * CENTER[axis] + f64::from(corner[axis])));
    let [last_u, last_v] = [0, 1].map(|axis| f64::from(corner[axis]) + sensor * f64::from(SIZE[axis]) - 1.0);
    let axes = [("r1", right), ("r2", up), ("r3", backwards)];
    let axes = axes.map(|(row, [a, b, c])| format!("{row}1=\"{a}\" {row}2=\"{b}\" {row}3=\"{c}\" ")).concat();
    format!(
        "    <camera active=\"1\" avg-residual=\"0.402\" model=\"Miqus Video\" serial=\"{name}\" viewrotation=\"0\" \
         video_resolution=\"{lines}p\">\n\
         <fov_marker left=\"0\" top=\"0\" right=\"1\" bottom=\"1\"/>\n\
         <fov_video left=\"{}\" top=\"{}\" right=\"{last_u}\" bottom=\"{last_v}\"/>\n\
         <transform {axes} x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n\
         <intrinsic focallength=\"9.3\" sensorMinU=\"0.000000\" focalLengthU=\"{fu}\" focalLengthV=\"{fv}\" \
         centerPointU=\"{cu}\" centerPointV=\"{cv}\" skew=\"0.000000\" radialDistortion1=\"0.000000\" \
         radialDistortion2=\"0\" radialDistortion3=\"0\" tangentalDistortion1=\"0\" tangentalDistortion2=\"0\"/>\n\
         </camera>\n",
        corner[0], corner[1]
    )
}

/// Returns a calibration of these elements.
fn qualisys(elements: &str) -> String {
    format!(
        "<?xml version='1.0' encoding='ASCII'?>\n<calibration created=\"today\" type=\"regular\">\n  \
         <results min-max-diff=\"0.\" std-dev=\"0.\"/>\n  <cameras>\n{elements}  </cameras>\n</calibration>\n"
    )
}

/// Returns a box of an MP4 file.
fn boxed(kind: &[u8; 4], contents: &[u8]) -> Vec<u8> {
    [&(contents.len() as u32 + 8).to_be_bytes()[..], kind, contents].concat()
}

/// Returns an MP4 file without pictures, whose header says how many there are and how many parts of a second, of 15360,
/// each takes.
fn video(frames: u32, parts: u32) -> Vec<u8> {
    let numbers = |numbers: &[u32]| numbers.iter().flat_map(|number| number.to_be_bytes()).collect::<Vec<u8>>();
    let header = boxed(b"mdhd", &numbers(&[0, 0, 0, 15360, frames * parts, 0]));
    let handler = boxed(b"hdlr", &[&[0; 8][..], b"vide", &[0; 12]].concat());
    let table = boxed(b"stbl", &boxed(b"stts", &numbers(&[0, 1, frames, parts])));
    let media = boxed(b"mdia", &[header, handler, boxed(b"minf", &table)].concat());
    [boxed(b"ftyp", b"isom"), boxed(b"moov", &boxed(b"trak", &media))].concat()
}

fn check(view: &TrainingView, index: usize) {
    Looking::on_arc(index).check(view, FOCAL, CENTER);
    assert_eq!(view.original, UVec2::from(SIZE), "{}: the size of the pictures", view.name);
}

#[test]
fn a_toml_beside_folders_of_frames_is_read() {
    let data = Data::new();
    data.write("Calib_scene.toml", toml(&["cam_01", "cam_02", "cam_03"]));
    for place in ["cam_01", "frames/CAM_02", "images/cam3/images"] {
        for frame in [10, 11, 25] {
            data.picture(&format!("{place}/f{frame:04}.png"));
        }
    }
    let (train, test) = (data.open(Split::Train), data.open(Split::Test));
    assert_eq!(names(&test.views), ["cam_01_f0010", "cam_01_f0011", "cam_01_f0025"], "the first of eight cameras");
    assert_eq!(names(&train.views)[..4], ["CAM_02_f0010", "CAM_02_f0011", "CAM_02_f0025", "cam3_f0010"], "the others");
    assert_eq!(times(&train.views)[..3], [0.0, 1.0 / 30.0, 0.5], "gaps keep their time, at 30 frames a second");
    for (view, index) in train.views.iter().zip([1, 1, 1, 2, 2, 2]) {
        check(view, index);
    }
    check(&test.views[0], 0);
    train.require_images().expect("every frame is on disk");
    let notes = train.notes.join("; ");
    for part in [
        "letters and numbers are: cam_03 is cam3/",
        "unknown rate count at 30 a second: cam_01, CAM_02, cam3",
        "must be synchronized",
    ] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
}

#[test]
fn a_calibration_of_qualisys_is_the_same_rig() {
    let data = Data::new();
    let elements = [(1080, [0, 0]), (1080, [8, 2]), (540, [0, 0]), (540, [16, 4])];
    let elements = elements
        .iter()
        .enumerate()
        .map(|(index, &(lines, corner))| element(&format!("cam{index}"), &Looking::on_arc(index), lines, corner));
    let marker = "<camera serial=\"9\" model=\"Miqus M3\" calibrated=\"false\"><transform x=\"0\"/></camera>";
    data.write("calibration/Calib.qca.txt", qualisys(&(elements.collect::<String>() + marker)));
    data.write("Calib.toml", toml(&["cam0"]));
    for camera in 0..4 {
        data.picture(&format!("cam{camera}/0.png"));
    }
    let found = data.open(Split::Train);
    assert_eq!(names(&found.views), ["cam1_0", "cam2_0", "cam3_0"], "all cameras but that of the test");
    for (view, index) in found.views.iter().zip(1..) {
        check(view, index);
    }
    let notes = found.notes.join("; ");
    for part in ["read in meters", "not calibrated are left out: 9", "those of Calib.qca.txt; other calibrations"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
}

#[test]
fn frames_of_videos_have_the_rate_of_the_video() {
    let data = Data::new();
    data.write("Calib.toml", toml(&["cam01", "cam02", "cam03", "cam04"]));
    for (camera, frames, parts) in [("cam01", 4, 256), ("cam02", 4, 256), ("cam03", 3, 512)] {
        data.write(&format!("{}{camera}.mp4", if camera == "cam02" { "videos/" } else { "" }), video(frames, parts));
        data.decoded(camera, frames, SIZE);
    }
    data.write("other.mov", "");
    let found = data.open(Split::Train);
    let rates = [0.0, 1.0 / 60.0, 2.0 / 60.0, 3.0 / 60.0, 0.0, 1.0 / 30.0, 2.0 / 30.0];
    assert_eq!(times(&found.views), rates, "60 and 30 frames a second");
    check(&found.views[0], 1);
    let notes = found.notes.join("; ");
    for part in [
        "without a video and without frames are left out: cam04",
        "without a camera in the calibration are left out: other.mov",
        "different rates, frames a second: cam01 60, cam02 60, cam03 30",
        "different numbers of frames: cam01 4, cam02 4, cam03 3",
    ] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
    std::fs::remove_dir_all(data.folder.path().join("data.frames")).expect("the frames exist");
    let summary = Summary::of(&data.path(), &CameraOptions::default()).expect("a summary");
    assert!(
        summary.missing.iter().any(|line| line.contains("3 videos have not been decoded")),
        "{:?}",
        summary.missing
    );
    assert!(summary.format.contains("Pose2Sim"), "the name of the format: {}", summary.format);
}

#[test]
fn pictures_that_the_encoder_has_cut_keep_their_pixels() {
    let data = Data::new();
    let larger = toml(&["a", "b", "c"]).replace("size = [ 40.0, 30.0,]", "size = [ 110.0, 60.0,]");
    data.write("Calib.toml", &larger);
    for (camera, size) in [("a", [110, 60]), ("b", [108, 60]), ("c", [220, 120])] {
        data.write(&format!("{camera}.mp4"), video(2, 256));
        data.decoded(camera, 2, size);
    }
    let found = data.open(Split::Train);
    let sizes: Vec<UVec2> = found.views.iter().map(|view| view.original).collect();
    assert_eq!(sizes, [[108, 60], [108, 60], [110, 60], [110, 60]].map(UVec2::from), "cut; scaled");
    for (view, index) in found.views.iter().zip([1, 1, 2, 2]) {
        Looking::on_arc(index).check(view, FOCAL, CENTER);
        view.load_covered().expect("the picture has the shape of the camera");
    }
    let notes = found.notes.join("; ");
    assert!(notes.contains("cut at the right and the bottom: b at 108 x 60"), "the camera is named: {notes}");
    data.decoded("b", 2, [60, 110]);
    data.refused(&["Calib.toml", "camera b is calibrated for 110 x 60 pixels", "60 x 110", "turn them by 90 degrees"]);
    data.decoded("b", 2, [90, 60]);
    data.refused(&["camera b", "90 x 60", "correct the size"]);
}

#[test]
fn distortion_is_that_of_opencv_or_of_a_fisheye_lens() {
    let data = Data::new();
    let of = |coefficients: &str, fisheye: bool| {
        let tables = ["a", "b"].iter().enumerate().map(|(index, name)| {
            table(name, &Looking::on_arc(index), coefficients).replace("false", if fisheye { "true" } else { "false" })
        });
        data.write("Calib.toml", tables.collect::<String>());
        data.try_open(Split::Train)
    };
    for camera in ["a", "b"] {
        data.picture(&format!("{camera}/0.png"));
    }
    for (coefficients, fisheye, is_distorted) in [
        (NONE, false, false),
        ("-0.1, 0.01, 0.001, -0.001, 0.002", false, true),
        ("-0.1, 0.01, 0.001, -0.001, 0.0, 0.01, 0.0, 0.0", false, true),
        (NONE, true, true),
        ("0.01, 0.0, 0.0, 0.0, 0", true, true),
    ] {
        let found = of(coefficients, fisheye).expect("a distortion that can be undone");
        let correction = found.views[0].correction;
        assert_eq!(correction != Correction::default(), is_distorted, "{coefficients}, fisheye: {fisheye}");
    }
    for (coefficients, fisheye, part) in [("0.1, 0.2, 0.3", false, "3 coefficients"), ("0.1", true, "1 coefficients")] {
        let error = of(coefficients, fisheye).expect_err(part).to_string();
        assert!(error.contains(part) && error.contains("camera [a]"), "{part:?} is not in: {error}");
    }
}

#[test]
fn wrong_calibrations_are_refused_by_name() {
    let data = Data::new();
    let whole = toml(&["a", "b"]);
    data.write("Calib.toml", &whole);
    data.refused(&["Calib.toml", "none of its cameras (a, b)", "there is none"]);
    for camera in ["a", "b"] {
        data.picture(&format!("{camera}/0.png"));
    }
    assert_eq!(data.open(Split::Train).views.len(), 1, "the unchanged file is valid");
    for (from, to, part) in [
        ("translation", "place", "camera [a]: it has no translation"),
        ("0.0, 0.0, 1.0,],]", "0.0, 0.0, 1.0,]]\n]", "no TOML"),
        ("[ 50.0, 0.0", "[ -50.0, 0.0", "camera a: the lens cannot be used"),
        ("[ 50.0, 0.0", "[ 50.0, 3.0", "skew"),
        ("[ 50.0, 0.0", "[ nan, 0.0", "its matrix has a value that is no finite number"),
        ("[ 50.0, 0.0", "[ \"50\", 0.0", "its matrix has a value that is no finite number"),
        ("size = [ 40.0, 30.0,]", "size = [ 40.0,]", "its size has 1 numbers, not 2"),
        ("size = [ 40.0, 30.0,]", "size = [ 4e9, 30.0,]", "4000000000x30"),
        ("rotation = [", "rotation = [ 1,", "its rotation has 4 numbers, not 3"),
        ("matrix", "matrices", "no table in it has a matrix"),
        ("name = \"b\"", "name = \"A\"", "two of its cameras are named A"),
    ] {
        let count = if part.starts_with("no table") { 2 } else { 1 };
        data.write("Calib.toml", whole.replacen(from, to, count));
        data.refused(&["Calib.toml", part]);
    }
    let whole = qualisys(&element("a", &Looking::on_arc(0), 1080, [0, 0]));
    for (from, to, part) in [
        ("</calibration>", "", "no XML"),
        ("focalLengthU", "focalLengthW", "camera a: it has no focalLengthU"),
        ("skew=\"0.000000\"", "skew=\"640\"", "skew"),
        ("1080p", "4K", "video_resolution is \"4K\""),
        ("r11=\"", "r11=\"9", "camera a: the camera matrix"),
        ("radialDistortion1=\"0.000000\"", "radialDistortion1=\"inf\"", "radialDistortion1 is \"inf\""),
        ("<camera ", "<kamera ", "no XML"),
        ("serial=\"a\"", "calibrated=\"false\"", "no element camera in it"),
    ] {
        data.write("Calib.qca.txt", whole.replacen(from, to, 1));
        data.refused(&["Calib.qca.txt", part]);
    }
}

#[test]
fn two_videos_of_one_camera_are_refused() {
    let data = Data::new();
    data.write("Calib.toml", toml(&["a", "b"]));
    for name in ["a.mp4", "videos/A.mov", "b.mp4"] {
        data.write(name, video(2, 256));
    }
    data.refused(&["A.mov", "a.mp4", "remove one of them"]);
}
