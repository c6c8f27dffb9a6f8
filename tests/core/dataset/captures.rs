//! The datasets of trained captures.
//!
//! In: the folder named by `GS4D_DATA`; skipped without it. Out: proof that their cameras and images match the
//! original.

use std::path::{Path, PathBuf};

use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions, CoveredImage, Dataset, Split};
use bevy_gs4d::view::Lens;
use glam::{UVec2, Vec3};

use super::resolution_option;
use crate::support::data::data;

fn capture(name: &str) -> Option<PathBuf> {
    Some(data()?.join(name))
}

/// Checks that every golden view has the camera that the transforms file gives for the same image.
fn assert_golden_cameras(folder: &Path, golden: &str, options: &CameraOptions) {
    let views = Dataset::open(folder, Split::Test, options).expect("a dataset").views;
    let golden = CameraFile::load(&folder.join(golden), &CameraOptions::default()).expect("golden views");
    for view in &golden {
        let same = views.iter().find(|other| other.name == view.name).expect("the same image in the test split");
        assert_eq!((view.time, view.camera.size), (same.time, same.camera.size), "{}", view.name);
        let (a, b) = (view.camera.world_to_camera, same.camera.world_to_camera);
        assert!(a.abs_diff_eq(b, 1e-5), "{}: {a} and {b}", view.name);
        let (Lens::Fov { tan: a }, Lens::Fov { tan: b }) = (view.camera.lens, same.camera.lens) else {
            panic!("{}: both are FoV cameras", view.name);
        };
        assert!(a.abs_diff_eq(b, 1e-6), "{}: {a} and {b}", view.name);
    }
}

/// Returns the mean of the colors over black and the mean coverage, 0 to 1.
fn means(image: &CoveredImage) -> (f64, f64) {
    let colors = image.over(Vec3::ZERO).pixels.iter().map(|p| p.as_dvec3().element_sum()).sum::<f64>();
    let covered = image.texels.iter().map(|texel| f64::from(texel[3]) / 255.0).sum::<f64>();
    let count = image.texels.len() as f64;
    (colors / (3.0 * count), covered / count)
}

#[test]
fn toybox_test_split_is_read() {
    let Some(folder) = capture("toybox") else { return };
    let dataset = Dataset::open(&folder, Split::Test, &CameraOptions::default()).expect("a dataset");
    assert_eq!(dataset.views.len(), 60, "two cameras of thirty frames");
    assert_eq!((dataset.views[0].name.as_str(), dataset.views[0].time), ("c04_f00", 0.0), "the first frame");
    assert!(dataset.views.iter().all(|view| view.camera.size == UVec2::splat(400)), "every view has 400x400 pixels");
    assert!(dataset.require_images().is_ok(), "every image and mask exists");
    for golden in ["golden_vanilla.json", "golden_4dgs1k.json", "golden_45k.json"] {
        assert_golden_cameras(&folder, golden, &CameraOptions::default());
    }
    let image = dataset.views[0].load_covered().expect("an image");
    let (mean, covered) = means(&image);
    // JPEG decoders differ in the last bit.
    assert!((mean - 0.2664869526).abs() < 1e-3, "{mean}");
    assert!((covered - 99.3727625 / 255.0).abs() < 1e-6, "{covered}");
}

#[test]
fn standup_at_resolution_two_matches_the_original() {
    let Some(folder) = capture("standup") else { return };
    let options = resolution_option(2);
    let dataset = Dataset::open(&folder, Split::Test, &options).expect("a dataset");
    assert!(dataset.views.iter().all(|view| view.camera.size == UVec2::splat(400)), "half of 800 pixels");
    assert_golden_cameras(&folder, "standup_golden.json", &options);
    let image = dataset.views[0].load_covered().expect("an image");
    // Computed with numpy and Pillow.
    let pixel = image.over(Vec3::ZERO).pixel(200, 200);
    assert!(pixel.abs_diff_eq(Vec3::new(0.6431373, 0.28235295, 0.22352941), 1e-6), "{pixel}");
    let (mean, covered) = means(&image);
    assert!((mean - 0.02670343954248366).abs() < 1e-8, "{mean}");
    assert!((covered - 0.06513357848631277).abs() < 1e-8, "{covered}");
}

#[test]
fn standup_training_cameras_need_no_training_images() {
    let Some(folder) = capture("standup") else { return };
    let dataset = Dataset::open(&folder, Split::Train, &resolution_option(2)).expect("cameras");
    assert_eq!(dataset.views.len(), 150, "every training camera");
    assert_eq!(dataset.views[0].camera.size, UVec2::splat(400), "the size comes from the test images");
    let error = dataset.require_images().expect_err("the training images do not exist").to_string();
    assert!(error.contains("150 of 150"), "{error}");
}
