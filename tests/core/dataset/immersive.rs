//! `models.json` of Google Immersive.
//!
//! In: small folders made here, and the worked example of the publisher. Out: proof that fisheye cameras have the poses
//! and lenses of the file, that their pictures are undistorted, and of what is missing.

use super::Folder;
use super::formats::{names, open, picture, refused, times};
use super::looking::{Looking, intrinsics};
use super::with;
use bevy_gs4d::internal::offline::dataset::Summary;
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split};
use glam::{UVec2, Vec3};
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

/// A camera of the dataset, as its publisher describes it.
fn published() -> Value {
    json!({
        "name": "camera_0001", "position": [0.003311238794086777, 0.000126384684934784, 0.42421246053630285],
        "orientation": [-0.03295944563072383, 0.02964606619481096, -0.03337751007195316],
        "focal_length": 1111.3638715594666, "pixel_aspect_ratio": 1.0, "principal_point": [1284.7296468363463, 925.4651609728676],
        "height": 1920.0, "width": 2560.0, "radial_distortion": [0.0970525284520715, -0.01708587111009977, 0.0],
        "projection_type": "fisheye",
    })
}

/// A camera that looks at the origin, with a lens whose pictures are not distorted much.
fn model(name: &str, index: usize) -> Value {
    let looking = Looking::on_arc(index);
    json!({
        "name": name, "position": looking.position, "orientation": looking.vector(), "focal_length": 50.0,
        "pixel_aspect_ratio": 1.04, "principal_point": [19.0, 16.0], "width": 40.0, "height": 30.0,
        "radial_distortion": [0.0, 0.0, 0.0], "projection_type": "fisheye",
    })
}

/// Writes three cameras, whose names are not in the order of the file, each with two frames.
fn rig() -> Folder {
    let folder = Folder::new();
    let models = [model("camera_0003", 3), model("camera_0001", 1), model("camera_0002", 2)];
    folder.write_json("models.json", &json!(models));
    for camera in 1..4 {
        for frame in [0, 3] {
            picture(&folder, &format!("camera_000{camera}/{frame}.png"), [9, 9, 9]);
        }
    }
    folder
}

#[test]
fn cameras_go_with_their_frames_by_name() {
    let folder = rig();
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["camera_0001_0", "camera_0001_3"], "the first camera is for the test");
    assert_eq!(times(&test.views), [0.0, 0.1], "30 frames a second");
    assert_eq!(train.views.len(), 4, "the others are trained on");
    for view in train.views.iter().chain(&test.views) {
        let index = view.name["camera_000".len()..][..1].parse().expect("the number of the camera");
        Looking::on_arc(index).check(view, [50.0, 52.0], [19.0, 16.0]);
    }
    train.require_images().expect("the frames are on disk");
    let summary = Summary::of(folder.path(), &CameraOptions::default()).expect("a dataset");
    assert!(summary.format.starts_with("Google Immersive"), "the format: {}", summary.format);
    assert!(summary.notes.iter().any(|note| note.contains("camera_0001 is the test camera")), "{:?}", summary.notes);
}

#[test]
fn the_test_camera_is_that_of_the_file_whatever_the_name_of_its_footage() {
    let folder = Folder::new();
    let models = [model("camera_0001", 1), model("camera_0002", 2), model("camera_0001_0", 3)];
    folder.write_json("models.json", &json!(models));
    for name in ["Camera_0001", "camera-0002", "camera_0001_0"] {
        picture(&folder, &format!("{name}/0.png"), [9, 9, 9]);
    }
    assert_eq!(names(&open(&folder, Split::Test).views), ["Camera_0001_0"], "of another letter case");
    let train = open(&folder, Split::Train);
    assert_eq!(names(&train.views), ["camera-0002_0", "camera_0001_0_0"], "another camera whose name begins alike");
}

#[test]
fn the_example_of_the_publisher_has_its_pixel() {
    let folder = Folder::new();
    let mut other = published();
    other["name"] = json!("camera_0002");
    other["position"] = json!([0.2, 0.1, 0.3]);
    folder.write_json("models.json", &json!([published(), other]));
    // A sixteenth of the size: columns are red, rows are green.
    let image = RgbImage::from_fn(160, 120, |x, y| Rgb([x as u8, y as u8, 0]));
    for camera in ["camera_0001", "camera_0002"] {
        std::fs::create_dir(folder.path().join(camera)).expect("the folder can be made");
        image.save(folder.path().join(camera).join("0.png")).expect("an image");
    }
    let options = CameraOptions { size: Some(UVec2::new(160, 120)), ..CameraOptions::default() };
    let test = Dataset::open(folder.path(), Split::Test, &options).expect("a dataset");
    let view = &test.views[0];
    let at = view.camera.world_to_camera.transform_point3(Vec3::new(0.5, 0.5, 10.0)).as_dvec3();
    // The formula of the publisher, with the angle to the axis, gives the pixel of the example.
    let (radius, angle) = (at.x.hypot(at.y), at.x.hypot(at.y).atan2(at.z));
    let factor = 1.0 + angle.powi(2) * (0.0970525284520715 - angle.powi(2) * 0.01708587111009977);
    let distorted = [at.x, at.y].map(|value| 1111.3638715594666 * angle / radius * value * factor);
    let expected = [1377.85525, 1017.61440];
    for (axis, center) in [1284.7296468363463, 925.4651609728676].into_iter().enumerate() {
        let found = distorted[axis] + center;
        assert!((found - expected[axis]).abs() < 0.02, "axis {axis}: the pixel {}, not {found}", expected[axis]);
    }
    // The pinhole picture shows at the point's pixel what the fisheye picture has at the pixel of the example.
    let (focal, center) = intrinsics(view);
    assert!((focal[0] - 1111.3638715594666 / 16.0).abs() < 1e-3, "the focal length of the file: {focal:?}");
    let pixel = [focal[0] * at.x / at.z + center[0], focal[1] * at.y / at.z + center[1]].map(f64::floor);
    let off =
        [(pixel[0] + 0.5 - center[0]) / focal[0] - at.x / at.z, (pixel[1] + 0.5 - center[1]) / focal[1] - at.y / at.z];
    let image = view.load_covered().expect("the picture");
    let texel = image.texels[pixel[1] as usize * 160 + pixel[0] as usize];
    for axis in 0..2 {
        // Near the axis of the lens a pixel of the pinhole picture is one of the fisheye picture.
        let source = expected[axis] / 16.0 + off[axis] * focal[axis] - 0.5;
        let found = f64::from(texel[axis]);
        assert!((found - source).abs() <= 1.0, "axis {axis}: sampled at {source}, not {found}");
    }
    assert!(!image.has_gaps, "every pixel has a source");
    let notes = test.notes.join("; ");
    assert!(
        notes.contains("pictures of fisheye lenses, up to 12") && notes.contains("pinhole pictures of 98"),
        "{notes}"
    );
}

#[test]
fn cameras_without_frames_and_frames_without_a_camera_are_noted() {
    let folder = rig();
    std::fs::remove_dir_all(folder.path().join("camera_0003")).expect("the folder is there");
    picture(&folder, "camera_0009/0.png", [9, 9, 9]);
    let train = open(&folder, Split::Train);
    assert_eq!(names(&train.views), ["camera_0002_0", "camera_0002_3"], "the camera that is left");
    let notes = train.notes.join("; ");
    for part in ["left out: camera_0003", "left out: camera_0009/"] {
        assert!(notes.contains(part), "{part:?} is not in: {notes}");
    }
}

#[test]
fn perspective_lenses_are_read_and_others_refused() {
    let folder = rig();
    let text = std::fs::read_to_string(folder.path().join("models.json")).expect("the file is there");
    let whole: Value = serde_json::from_str(&text).expect("JSON");
    let changed = |pointer: &str, value: Value| {
        folder.write_json("models.json", &with(whole.clone(), pointer, value));
    };
    changed("/1/projection_type", json!("perspective"));
    assert_eq!(open(&folder, Split::Test).views.len(), 2, "a lens without distortion");
    for (pointer, value, part) in [
        ("/1/projection_type", json!("equirectangular"), "frame 1: camera_model is \"equirectangular\""),
        ("/1/radial_distortion", json!([0, 0, 0, 0, 0.1]), "frame 1: radial_distortion is not 0"),
        ("/1/radial_distortion", json!([-9]), "folds the picture"),
        ("/1/orientation", json!([1e300, 0, 0]), "frame 1: the camera matrix"),
        ("/1/position", json!([0, 0]), "frame 1: invalid length 2"),
        ("/1/width", json!(-1), "frame 1: pictures of -1x30"),
        ("/1/focal_length", json!(0), "the lens cannot be used"),
        ("/1/name", json!(3), "frame 1: invalid type"),
        ("/1/name", json!("camera_0003"), "two of its cameras are named camera_0003"),
    ] {
        changed(pointer, value);
        refused(&folder, part);
    }
    folder.write("models.json", "[{");
    refused(&folder, "models.json: not a valid camera file");
    folder.write("models.json", "{\"providers\": []}");
    refused(&folder, "nothing else that a dataset folder holds");
}
