//! Datasets that other programs have written.
//!
//! In: `tests/golden/datasets/`: COLMAP models by pycolmap, others by NumPy, and what pycolmap and OpenCV find in them.
//! Its `make.py` describes them. Out: proof that every reader finds the same poses, sizes, times and points, and undoes
//! every distortion as they do.
//!
//! A point of the world lies behind the middle of a pixel of the pinhole camera. The images are stripes, from which
//! follows where that pixel was sampled in the distorted image: there the other program sees the point.

use bevy_gs4d::internal::offline::dataset::{CloudPoint, PointCloud};
use bevy_gs4d::offline::dataset::{CameraOptions, CoveredImage, Dataset, Split, TrainingView};
use bevy_gs4d::scene::Origin;
use bevy_gs4d::view::Lens;
use glam::{DVec2, UVec2, Vec2, Vec3, Vec3Swizzles};
use serde::Deserialize;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Largest distance of a pixel, pixels.
const PIXELS: f64 = 0.02;
/// Largest error of a position.
const POSITION: f32 = 1e-4;
/// Largest error of a smooth image, of 255: of rounding. Half a pixel would be 14.
const SMOOTH: u8 = 1;

/// What other programs find in a dataset.
#[derive(Deserialize)]
struct Expected {
    /// Sorted by name.
    views: Vec<ExpectedView>,
    /// Places and colors.
    #[serde(default)]
    cloud: Vec<(Vec3, [u8; 3])>,
}

#[derive(Deserialize)]
struct ExpectedView {
    name: String,
    time: f32,
    size: UVec2,
    position: Vec3,
    /// The lens of the pinhole camera.
    focal: Vec2,
    center: Vec2,
    /// Points of the world, and their pixels in the distorted image.
    points: Vec<(Vec3, DVec2)>,
    /// The undistorted image, if the image is smooth.
    undistorted: Option<PathBuf>,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/datasets")
}

fn expected(name: &str) -> Expected {
    let text = std::fs::read_to_string(folder().join("expected.json")).expect("the file of expected values");
    let mut sets: HashMap<String, Expected> = serde_json::from_str(&text).expect("values of every dataset");
    sets.remove(name).expect("the dataset is one of them")
}

fn open(name: &str, split: Split) -> Dataset {
    Dataset::open(&folder().join(name), split, &CameraOptions::default()).expect("a valid dataset")
}

/// Returns the views of both splits, sorted by name.
fn views(name: &str) -> Vec<TrainingView> {
    let splits = [Split::Train, Split::Test].map(|split| open(name, split).views);
    let mut views = splits.concat();
    views.sort_by(|a, b| a.name.cmp(&b.name));
    views
}

/// Checks that the views of a dataset are the expected ones, and that all their images are on disk.
fn check(name: &str, expected: &[ExpectedView]) {
    let views = views(name);
    let names: Vec<_> = views.iter().map(|view| &view.name).collect();
    assert_eq!(names, expected.iter().map(|view| &view.name).collect::<Vec<_>>(), "{name}: the names of all views");
    for (view, expected) in views.iter().zip(expected) {
        check_view(view, expected);
    }
}

fn check_view(view: &TrainingView, expected: &ExpectedView) {
    let name = &view.name;
    assert_eq!((view.original, view.camera.size), (expected.size, expected.size), "{name}: the size");
    assert!((view.time - expected.time).abs() < 1e-6, "{name}: the time is {}, not {}", expected.time, view.time);
    let position = view.camera.world_to_camera.inverse().w_axis.truncate();
    assert!(
        position.abs_diff_eq(expected.position, POSITION),
        "{name}: the camera is at {}, not {position}",
        expected.position
    );
    let Lens::Intrinsics { focal, center } = view.camera.lens else { panic!("{name}: an intrinsics camera") };
    assert!(focal.abs_diff_eq(expected.focal, 1e-2), "{name}: the focal lengths are {}, not {focal}", expected.focal);
    assert!(center.abs_diff_eq(expected.center, 1e-4), "{name}: the center is {}, not {center}", expected.center);

    let image = view.load_covered().expect("the image is on disk");
    assert_eq!((image.size, image.has_gaps), (expected.size, false), "{name}: every pixel has a source");
    assert_eq!(expected.points.len(), 8, "{name}: points");
    for &(point, distorted) in &expected.points {
        let at = view.camera.world_to_camera.transform_point3(point);
        assert!(at.z > 1.0, "{name}: {point} is in front of the camera: {at}");
        let seen = focal * at.xy() / at.z + center;
        let pixel = seen.floor();
        let off = (seen - pixel - 0.5).abs().max_element();
        assert!(off < 0.01, "{name}: {point} is behind the middle of a pixel, not at {seen}");
        if expected.undistorted.is_none() {
            check_source(name, &image, pixel.as_uvec2(), distorted);
        }
    }
    if let Some(path) = &expected.undistorted {
        check_smooth(name, &image, path);
    }
}

/// Checks in an image of stripes that a pixel was sampled at a place of the distorted image.
fn check_source(name: &str, image: &CoveredImage, pixel: UVec2, distorted: DVec2) {
    let [red, green, blue, _] = image.texels[(pixel.y * image.size.x + pixel.x) as usize].map(f64::from);
    let DVec2 { x, y } = distorted - 0.5;
    // Even columns and rows have the value 28, odd ones 228.
    let stripe = |at: f64| 28.0 + 200.0 * (1.0 - (at.rem_euclid(2.0) - 1.0).abs());
    let close = |found: f64, expected: f64| (found - expected).abs() <= 200.0 * PIXELS + 0.5;
    let is_there =
        close(red, stripe(x)) && close(green, stripe(y)) && (blue - (3.0 * x + 2.0 * y)).abs() <= 5.0 * PIXELS + 0.5;
    assert!(
        is_there,
        "{name}: pixel {pixel} is sampled at {distorted}, so that its color is about {} {} {}, \
         not {red} {green} {blue}",
        stripe(x),
        stripe(y),
        3.0 * x + 2.0 * y
    );
}

fn check_smooth(name: &str, image: &CoveredImage, path: &Path) {
    let expected = image::open(folder().join(path)).expect("the undistorted image").into_rgb8();
    assert_eq!(UVec2::from(expected.dimensions()), image.size, "{name}: the size of the undistorted image");
    for ((x, y, expected), found) in expected.enumerate_pixels().zip(&image.texels) {
        let off = expected.0.iter().zip(found).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(off <= Some(SMOOTH), "{name}: pixel {x} {y} is {:?}, not {found:?}", expected.0);
    }
}

#[test]
fn colmap_cameras_project_as_pycolmap_does() {
    let Expected { views, .. } = expected("colmap");
    assert_eq!(views.len(), 21, "nineteen images, of which one has two more frames");
    check("colmap_binary", &views);
}

#[test]
fn text_models_have_the_cameras_of_binary_models() {
    let (text, binary) = (views("colmap_text"), views("colmap_binary"));
    assert_eq!(text.len(), 19, "images without frames on disk are views of their own");
    for view in text {
        let same = binary.iter().find(|other| other.name == view.name).expect("the binary model has this image");
        let image = view.image.strip_prefix(folder().join("colmap_text")).expect("inside the folder");
        assert_eq!(same.image, folder().join("colmap_binary").join(image), "{}: the path of the image", view.name);
        assert_eq!(TrainingView { image: view.image.clone(), ..same.clone() }, view, "{}: all else", view.name);
    }
}

#[test]
fn colmap_points_are_those_of_pycolmap() {
    let Expected { cloud, .. } = expected("colmap");
    assert_eq!(cloud.len(), 12, "points");
    for name in ["colmap_binary", "colmap_text"] {
        let path = open(name, Split::Train).points.expect("the model has points");
        let PointCloud(found) = PointCloud::load(&path, &Origin::default()).expect("a valid file of points");
        let point = |&(position, color): &(Vec3, [u8; 3])| CloudPoint {
            position,
            color: Some(Vec3::from(color.map(f32::from)) / 255.0),
            time: None,
            velocity: Vec3::ZERO,
        };
        assert_eq!(found, cloud.iter().map(point).collect::<Vec<_>>(), "{name}: places and colors");
    }
}

#[test]
fn nerfstudio_cameras_project_and_are_undistorted_as_in_opencv() {
    for name in ["nerfstudio_opencv", "nerfstudio_fisheye"] {
        let Expected { views, .. } = expected(name);
        assert_eq!(views.iter().filter(|view| view.undistorted.is_some()).count(), 1, "{name}: a smooth image");
        check(name, &views);
    }
}

#[test]
fn n3v_cameras_project_as_in_the_loader_of_llff() {
    let Expected { views, .. } = expected("n3v");
    assert_eq!(views.len(), 6, "two frames of three cameras");
    check("n3v", &views);
}
