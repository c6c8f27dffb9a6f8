//! Datasets far from 0: coordinates of maps, and seconds since 1970.
//!
//! In: small datasets made here, of cameras on a circle around a place of a map. Out: proof that the views and points
//! of all splits are relative to one origin without a loss of digits, that the origin can be given, and that datasets
//! near 0 have none.

use super::Folder;
use super::formats::{PINHOLE, nerfstudio, open, times};
use bevy_gs4d::internal::offline::dataset::PointCloud;
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use bevy_gs4d::scene::Origin;
use glam::{DMat4, DQuat, DVec3};
use serde_json::{Value, json};

/// A place in coordinates of UTM.
const PLACE: DVec3 = DVec3::new(500_000.0, 5_400_000.0, 300.0);
/// A time in seconds since 1970.
const EPOCH: f64 = 1_700_000_000.0;

/// Returns the place of a camera, three units from [`PLACE`].
fn place(index: usize) -> DVec3 {
    let (sin, cos) = (0.5 * index as f64).sin_cos();
    PLACE + DVec3::new(3.0 * cos, 3.0 * sin, 0.5)
}

/// Returns the camera-to-world matrix of a camera that looks at [`PLACE`], with OpenCV axes.
fn to_world(index: usize) -> DMat4 {
    let forward = (PLACE - place(index)).normalize();
    let right = forward.cross(DVec3::Z).normalize();
    let down = forward.cross(right);
    DMat4::from_cols(right.extend(0.0), down.extend(0.0), forward.extend(0.0), place(index).extend(1.0))
}

/// Returns the camera position of a view, relative to the origin of its dataset.
fn center(view: &TrainingView) -> DVec3 {
    view.camera.world_to_camera.inverse().w_axis.truncate().as_dvec3()
}

#[track_caller]
fn assert_places(views: &[TrainingView], origin: Origin) {
    for view in views {
        let index = view.name[1..].parse().expect("views are named by the numbers of their cameras");
        let off = center(view).distance(place(index) - DVec3::from(origin.place));
        assert!(off < 1e-5, "{}: {off} units off", view.name);
    }
}

/// Writes a COLMAP model of twelve cameras, and a point.
fn colmap(folder: &Folder) {
    let mut images = String::new();
    for index in 0..12 {
        let to_camera = to_world(index).inverse();
        let ([x, y, z, w], at) = (DQuat::from_mat4(&to_camera).to_array(), to_camera.w_axis);
        images += &format!("{} {w} {x} {y} {z} {} {} {} 7 i{index:02}.png\n\n", index + 1, at.x, at.y, at.z);
    }
    folder.write("sparse/0/cameras.txt", format!("7 {PINHOLE}\n"));
    folder.write("sparse/0/images.txt", images);
    folder.write("sparse/0/points3D.txt", "1 500000.25 5400000.5 300.125 10 20 30 0.5\n");
}

/// Writes a split of the Blender form with these cameras, a quarter of a second after each other.
fn blender(folder: &Folder, split: Split, cameras: std::ops::Range<usize>) {
    let frame = |index: usize| {
        let flipped = to_world(index) * DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0));
        let rows = flipped.transpose().to_cols_array_2d();
        let time = EPOCH + 0.25 * (index + 1) as f64;
        json!({ "file_path": format!("i{index:02}"), "transform_matrix": rows, "time": time })
    };
    let frames: Vec<Value> = cameras.map(frame).collect();
    folder.write_json(split.file_name(), &json!({ "camera_angle_x": 0.7, "w": 40, "h": 30, "frames": frames }));
}

#[test]
fn cameras_on_a_map_have_an_origin_among_them() {
    let folder = Folder::new();
    colmap(&folder);
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    let origin = train.origin;
    let from = DVec3::from(origin.place);
    assert!(from.distance(PLACE) < 3.0 && from == from.round(), "whole units among the cameras: {from}");
    assert_eq!((test.origin, origin.time), (origin, 0.0), "the splits have one origin, and times are near 0");
    assert_eq!((train.views.len(), test.views.len()), (10, 2), "every camera");
    assert_places(&train.views, origin);
    assert_places(&test.views, origin);
    let note = format!("{}, {}, {}", from.x, from.y, from.z);
    assert!(train.notes.iter().any(|found| found.contains(&note)), "{note} is not in: {:?}", train.notes);
    let path = train.points.expect("the model has points");
    let PointCloud(points) = PointCloud::load(&path, &origin).expect("a file of points");
    let point = points[0].position.as_dvec3() + from;
    assert_eq!(point, DVec3::new(500_000.25, 5_400_000.5, 300.125), "points have the origin of the cameras");
}

#[test]
fn an_origin_that_is_given_is_used() {
    let folder = Folder::new();
    colmap(&folder);
    let given = Origin { place: [499_990.0, 5_400_010.0, 295.5], time: 5.0 };
    let options = CameraOptions { origin: Some(given), ..CameraOptions::default() };
    let found = Dataset::open(folder.path(), Split::Train, &options).expect("a valid dataset");
    assert_eq!(found.origin, given, "the origin of the capture that the views are for");
    assert_places(&found.views, given);
    assert_eq!(times(&found.views), [-5.0; 10], "times are counted from it, too");
    assert!(found.notes.is_empty(), "nothing is assumed: {:?}", found.notes);
}

#[test]
fn the_splits_of_a_folder_have_the_origin_of_the_training_split() {
    let folder = Folder::new();
    blender(&folder, Split::Train, 0..12);
    blender(&folder, Split::Test, 40..41);
    blender(&folder, Split::Val, 50..53);
    let train = open(&folder, Split::Train);
    assert_eq!(train.origin.time, EPOCH, "the first time, rounded down");
    assert_eq!(times(&train.views)[..3], [0.25, 0.5, 0.75], "every digit of the times is kept");
    for (split, first) in [(Split::Train, 0.25), (Split::Test, 10.25), (Split::Val, 12.75)] {
        let found = open(&folder, split);
        assert_eq!(found.origin, train.origin, "{split:?}: one origin");
        assert_eq!(found.views[0].time, first, "{split:?}: the first time");
        assert_places(&found.views, train.origin);
        assert_eq!(found.notes.len(), 2, "{split:?}: places and times are said: {:?}", found.notes);
    }
    let still = CameraOptions { is_static: true, ..CameraOptions::default() };
    let still = Dataset::open(folder.path(), Split::Test, &still).expect("a valid dataset");
    assert_eq!((still.origin.place, still.origin.time), (train.origin.place, 0.0), "a scene at rest has no times");
}

#[test]
fn intervals_are_counted_from_the_origin() {
    let folder = Folder::new();
    blender(&folder, Split::Train, 0..12);
    let within = |interval| {
        let options = CameraOptions { time_interval: Some(interval), ..CameraOptions::default() };
        Dataset::open(folder.path(), Split::Train, &options).map(|dataset| times(&dataset.views))
    };
    assert_eq!(within([1.0, 2.0]).expect("views"), [1.0, 1.25, 1.5, 1.75, 2.0], "both ends included");
    let error = within([100.0, 200.0]).expect_err("no view is left").to_string();
    for part in ["0.25 to 3", "counted from the time 1700000000 of the dataset"] {
        assert!(error.contains(part), "{part:?} is not in: {error}");
    }
}

#[test]
fn datasets_near_0_have_no_origin() {
    let folder = Folder::new();
    let mut json = nerfstudio(9);
    for (index, frame) in json["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
        frame["time"] = json!(index);
    }
    folder.write_json("transforms.json", &json);
    let found = open(&folder, Split::Train);
    assert_eq!((found.origin, found.notes), (Origin::default(), vec![]), "the coordinates of the files");
    assert_eq!(times(&found.views), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], "the times of the file");
}
