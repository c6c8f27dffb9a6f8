//! `footage`.
//!
//! In: pictures of a bright square that moves through a room, drawn here as five standing cameras see it. Out: proof
//! that plates, masks, points and a dataset are made from them, that nothing is made twice, and that no other folder is
//! written to.

use crate::support::command::{arguments, folder, gs4d};
use crate::support::folders::{contents, names};
use bevy_gs4d::internal::offline::dataset::PointCloud;
use bevy_gs4d::scene::Origin;
use bevy_gs4d::view::Camera;
use glam::{UVec2, Vec2, Vec3};
use image::{Rgb, RgbImage};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

const SIZE: UVec2 = UVec2::new(128, 96);
/// Horizontal field of view, radians.
const FOV: f32 = 0.9;
/// Half of the side of the square, pixels.
const HALF: f32 = 5.0;
const FRAMES: usize = 6;

/// Returns a camera on a circle around the room.
fn camera(index: usize) -> Camera {
    let angle = 1.2 * index as f32 + 0.3;
    let eye = Vec3::new(3.0 * angle.cos(), 3.0 * angle.sin(), 0.6 + 0.1 * index as f32);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, FOV, SIZE)
}

/// Returns the focal length, pixels.
fn focal() -> f32 {
    SIZE.x as f32 / 2.0 / (FOV / 2.0).tan()
}

/// Returns the place of the square in a frame.
fn place(frame: usize) -> Vec3 {
    Vec3::new(0.1, -0.2, -0.65 + 0.26 * frame as f32)
}

/// Returns the pixel of a place.
fn pixel(camera: &Camera, place: Vec3) -> Vec2 {
    let at = camera.world_to_camera.transform_point3(place);
    focal() * at.truncate() / at.z + SIZE.as_vec2() / 2.0
}

/// Returns the picture of a camera in a frame: a gray room with noise that stands still, and the square.
fn picture(index: usize, frame: usize) -> RgbImage {
    let middle = pixel(&camera(index), place(frame));
    RgbImage::from_fn(SIZE.x, SIZE.y, |x, y| {
        let offset = (Vec2::new(x as f32, y as f32) + 0.5 - middle).abs();
        if offset.max_element() <= HALF {
            return Rgb([250, 230, 40]);
        }
        let hash = (x + 131 * y + 7919 * index as u32).wrapping_mul(2_654_435_761) >> 28;
        Rgb([90 + hash as u8; 3])
    })
}

/// Writes a file of cameras, as of `PanopticSports`.
fn write_meta(folder: &Path, file: &str, cameras: &[usize]) {
    let k =
        |_: &usize| json!([[focal(), 0.0, SIZE.x as f32 / 2.0], [0.0, focal(), SIZE.y as f32 / 2.0], [0.0, 0.0, 1.0]]);
    let w2c = |index: &usize| {
        let pose = camera(*index).world_to_camera;
        json!((0..4).map(|row| pose.row(row).to_array()).collect::<Vec<_>>())
    };
    let moments = |of: &dyn Fn(&usize) -> Value| vec![cameras.iter().map(of).collect::<Vec<_>>(); FRAMES];
    let images = |frame: usize| cameras.iter().map(|index| format!("{index}/{frame:06}.png")).collect::<Vec<_>>();
    let meta = json!({
        "w": SIZE.x, "h": SIZE.y, "k": moments(&k), "w2c": moments(&w2c),
        "fn": (0..FRAMES).map(images).collect::<Vec<_>>(), "cam_id": moments(&|index| json!(index)),
    });
    fs::write(folder.join(file), meta.to_string()).expect("the folder can be written to");
}

/// Writes the pictures of cameras.
fn write_pictures(folder: &Path, cameras: &[usize]) {
    for index in cameras {
        let folder = folder.join(index.to_string());
        fs::create_dir_all(&folder).expect("the folder can be made");
        for frame in 0..FRAMES {
            let path = folder.join(format!("{frame:06}.png"));
            picture(*index, frame).save(path).expect("the folder can be written to");
        }
    }
}

/// Writes the footage of four cameras, and of one for the test.
fn write(folder: &Path) {
    write_pictures(&folder.join("ims"), &[0, 1, 2, 3, 4]);
    write_meta(folder, "train_meta.json", &[1, 2, 3, 4]);
    write_meta(folder, "test_meta.json", &[0]);
}

#[test]
fn footage_becomes_a_dataset_once() {
    let folder = folder();
    let [footage, out] = ["room", "dataset"].map(|name| folder.path().join(name));
    write(&footage);
    let before = contents(&footage);
    let make = || gs4d(&arguments!["footage", &footage, "-o", &out, "--json"]).json();
    let made = make();
    assert_eq!(made["cameras"], json!(["1", "2", "3", "4", "0"]), "the names of the folders of pictures: {made}");
    assert_eq!((&made["frames"], &made["test_frames"], &made["moments"]), (&24.into(), &6.into(), &6.into()), "all");
    assert!(made["points"].as_u64().is_some_and(|points| points > 0), "points are found: {made}");
    assert!(made["verdict"].is_object(), "a verdict: {made}");
    assert_eq!(contents(&footage), before, "the footage is as it was");
    let there = names(&out);
    for name in ["images", "motion", "plates", "points3d.ply", "transforms.json", "verdict.json"] {
        assert!(there.iter().any(|found| found == name), "{name} is not in {there:?}");
    }

    let written = contents(&out);
    let (linked, picture) = (&written[&out.join("images/3/000004.png")], &before[&footage.join("ims/3/000004.png")]);
    assert_eq!(linked, picture, "the same picture");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!(info["splits"][0]["views"], 24, "views to train on: {info}");
    assert_eq!(info["splits"][1]["views"], 6, "views for the test: {info}");
    assert_eq!(info["missing"], json!([]), "nothing is missing");

    let again = make();
    let stages = again["stages"].as_array().expect("stages");
    assert!(!stages.is_empty() && stages.iter().all(|stage| stage["skipped"] == true), "all are done: {again}");
    let facts = |made: &Value| ["frames", "points", "masks", "verdict", "offsets"].map(|name| made[name].clone());
    assert_eq!(facts(&again), facts(&made), "the same report");
    assert_eq!(contents(&out), written, "the same files");
    fs::remove_file(out.join("motion/2/000001.png")).expect("the mask is there");
    make();
    assert_eq!(contents(&out), written, "a result that is gone is made again");

    let without = gs4d(&arguments!["footage", &footage, "-o", &out, "--no-points", "--json"]).json();
    assert_eq!(without["points"], 0, "no points are looked for");
    assert!(!out.join("points3d.ply").exists(), "those of the run before are gone");
    make();
    assert_eq!(contents(&out), written, "they are found again");
}

#[test]
fn masks_and_points_are_where_something_moves() {
    let folder = folder();
    let [footage, out] = ["room", "dataset"].map(|name| folder.path().join(name));
    write(&footage);
    gs4d(&arguments!["footage", &footage, "-o", &out]).text();
    let gray = |name: String| image::open(out.join(&name)).expect(&name).into_luma8();
    for index in 1..5 {
        let plate = gray(format!("plates/{index}.png"));
        for frame in 0..FRAMES {
            let at = pixel(&camera(index), place(frame)).as_uvec2();
            assert!(plate.get_pixel(at.x, at.y).0[0] < 130, "camera {index}: the plate does not have the square");
            let mask = gray(format!("motion/{index}/{frame:06}.png"));
            assert!(mask.get_pixel(at.x, at.y).0[0] > 127, "camera {index}, frame {frame}: the square moves");
            let white = mask.pixels().filter(|pixel| pixel.0[0] > 127).count() as f32;
            let square = 4.0 * HALF * HALF;
            assert!((0.6..3.5).contains(&(white / square)), "camera {index}, frame {frame}: {white} pixels move");
        }
    }
    assert!(!out.join("motion/0").exists(), "nothing is made of the pictures for the test");
    let points = PointCloud::load(&out.join("points3d.ply"), &Origin::default()).expect("the points can be read").0;
    let moving: Vec<_> = points.iter().filter_map(|point| Some((point, point.time?))).collect();
    let at = |time: f32| place((time * (FRAMES - 1) as f32).round() as usize);
    let near = moving.iter().filter(|(point, time)| point.position.distance(at(*time)) < 0.35).count();
    assert!(near > 20, "{near} of {} points are where the square is", points.len());
    let yellow = |color: Vec3| color.x > 0.7 && color.z < 0.5;
    let colored = moving.iter().filter(|(point, _)| point.color.is_some_and(yellow)).count();
    assert!(colored > 10, "{colored} of {} points have its color", points.len());
}

#[test]
fn given_masks_offsets_and_test_cameras_are_used() {
    let folder = folder();
    let [footage, out, masks] = ["room", "dataset", "given"].map(|name| folder.path().join(name));
    write(&footage);
    fs::create_dir_all(masks.join("1")).expect("the folder can be made");
    let mut mask = image::GrayImage::new(SIZE.x, SIZE.y);
    mask.put_pixel(3, 4, image::Luma([255]));
    mask.save(masks.join("1/000002.png")).expect("the folder can be written to");
    let line = arguments!["footage", &footage, "-o", &out, "--masks", &masks, "--offset", "2=0.1", "--json"];
    let made = gs4d(&[&line[..], &arguments!["--test", "3"]].concat()).json();
    assert_eq!(made["offsets"]["2"], json!(0.1), "the offset: {made}");
    assert_eq!((&made["frames"], &made["test_frames"]), (&24.into(), &6.into()), "one camera for the test: {made}");
    let mask = image::open(out.join("motion/1/000002.png")).expect("the mask").into_luma8();
    assert_eq!(mask.pixels().filter(|pixel| pixel.0[0] > 127).count(), 1, "the mask that was given");
    let file = fs::read_to_string(out.join("transforms.json")).expect("the file of cameras");
    let file: Value = serde_json::from_str(&file).expect("JSON");
    let times = |camera: &str| -> Vec<f64> {
        let frames = file["frames"].as_array().expect("frames").iter().filter(|frame| frame["camera"] == camera);
        frames.filter_map(|frame| frame["time"].as_f64()).collect()
    };
    let shares = |first: u32| -> Vec<f64> { (0..6).map(|frame| f64::from(frame + first) / 8.0).collect() };
    for (camera, first) in [("1", 3), ("2", 0)] {
        let found = times(camera);
        let is_near = found.iter().zip(shares(first)).all(|(found, expected)| (found - expected).abs() < 1e-6);
        assert!(found.len() == 6 && is_near, "camera {camera}, three frames of nine earlier: {found:?}");
    }
    let seconds = file["seconds"][1].as_f64().expect("the seconds of all frames");
    assert!((seconds - 8.0 / 30.0).abs() < 1e-6, "nine moments at 30 a second: {seconds}");
}

#[test]
fn folders_of_somebody_else_are_not_written_to() {
    let folder = folder();
    let [footage, out] = ["room", "dataset"].map(|name| folder.path().join(name));
    write(&footage);
    fs::create_dir(&out).expect("the folder can be made");
    fs::write(out.join("letter.txt"), b"dear").expect("the folder can be written to");
    gs4d(&arguments!["footage", &footage, "-o", &out]).must_fail("name a new folder");
    assert_eq!(names(&out), ["letter.txt"], "nothing is written");
    gs4d(&arguments!["footage", &footage, "-o", footage.join("dataset")]).must_fail("room/dataset");
    let new = folder.path().join("new");
    gs4d(&arguments!["footage", &footage, "-o", &new, "--offset", "9=1"]).must_fail("no camera 9: the cameras are 1,");
    gs4d(&arguments!["footage", &footage, "-o", &new, "--test", "0,1,2,3,4"]).must_fail("--test");
    gs4d(&arguments!["footage", &footage, "-o", &new, "--masks", folder.path()]).must_fail("1/000000.png");
    gs4d(&arguments!["footage", &out, "-o", &new]).must_fail("folders of frames");
    for option in ["--smallest", "--agreeing"] {
        gs4d(&arguments!["footage", &footage, "-o", &new, option, "-1"]).must_fail("expected a number from 0 to 1");
    }
}

#[test]
fn info_names_the_command_for_footage() {
    let folder = folder();
    write_pictures(folder.path(), &[1, 2]);
    let text = gs4d(&arguments!["info", folder.path()]).text();
    assert!(text.contains("gs4d footage"), "the command: {text}");
    let json = gs4d(&arguments!["info", folder.path(), "--json"]).json();
    assert_eq!(json["footage"].as_array().map(Vec::len), Some(2), "a folder of frames for each camera: {json}");
}
