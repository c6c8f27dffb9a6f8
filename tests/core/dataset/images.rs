//! Images of datasets.
//!
//! In: small images written to temporary folders. Out: proof that their values are those of numpy and Pillow, and that
//! missing and damaged images are named.

use std::fs;

use bevy_gs4d::offline::dataset::{
    CameraFile, CameraOptions, Dataset, DatasetError, ImageMode, MAX_SIDE, Split, TrainingView,
};
use bevy_gs4d::view::Camera;
use glam::{UVec2, Vec3};
use image::{GrayImage, RgbaImage};
use serde_json::json;

use super::{Folder, frame, noise, resolution_option, transforms, with};

// The results of numpy and Pillow 9.5 for `rgba_noise(13 * 9, 4)` and, for the mask, for `noise(13 * 9, 5)`, at 6x4.
#[rustfmt::skip]
const IN_MEMORY_BLACK: [u8; 96] = [
    100, 157, 85, 89, 125, 170, 65, 124, 92, 152, 70, 102, 140, 106, 129, 122, 92, 127, 21, 94, 71, 100, 82, 96, 131,
    146, 110, 184, 103, 157, 102, 172, 80, 131, 102, 145, 76, 102, 120, 150, 105, 92, 80, 130, 133, 171, 77, 178, 116,
    90, 81, 157, 171, 134, 127, 140, 120, 98, 139, 150, 106, 111, 136, 165, 136, 65, 60, 97, 95, 107, 91, 109, 76, 15,
    73, 83, 73, 105, 95, 152, 121, 112, 55, 111, 98, 65, 61, 70, 99, 19, 96, 103, 135, 151, 148, 136,
];
#[rustfmt::skip]
const DATALOADER_WHITE: [u8; 72] = [
    204, 225, 199, 207, 233, 183, 200, 225, 185, 219, 199, 212, 199, 214, 174, 198, 218, 221, 170, 178, 152, 179, 219,
    176, 171, 199, 175, 151, 163, 176, 180, 175, 169, 166, 200, 132, 190, 179, 158, 222, 203, 197, 195, 183, 202, 160,
    169, 181, 227, 200, 190, 202, 202, 193, 209, 187, 216, 162, 174, 175, 204, 204, 178, 217, 205, 208, 194, 164, 197,
    208, 206, 207,
];
#[rustfmt::skip]
const MASK: [u8; 24] = [
    128, 141, 134, 113, 139, 111, 136, 106, 90, 94, 131, 78, 143, 131, 95, 131, 141, 104, 113, 136, 94, 141, 88, 102,
];

/// Returns RGBA noise with many pixels fully covered and fully empty.
fn rgba_noise(pixels: usize, state: u32) -> Vec<u8> {
    let mut bytes = noise(pixels * 4, state);
    for alpha in bytes.iter_mut().skip(3).step_by(4) {
        *alpha = match *alpha {
            0..80 => 0,
            177.. => 255,
            other => other,
        };
    }
    bytes
}

/// Returns a view of 13x9 RGBA noise, to be loaded at 6x4.
fn noise_view(folder: &Folder, mask: bool) -> TrainingView {
    let image = RgbaImage::from_raw(13, 9, rgba_noise(13 * 9, 4)).expect("enough bytes");
    image.save(folder.path().join("a.png")).expect("an image");
    let mut json = json!({"camera_angle_x": 0.8, "frames": [frame("./a")]});
    if mask {
        let mask = GrayImage::from_raw(13, 9, noise(13 * 9, 5)).expect("enough bytes");
        mask.save(folder.path().join("m.png")).expect("a mask");
        json = with(json, "/frames/0/mask_path", json!("m.png"));
    }
    let path = folder.write_json("transforms_test.json", &json);
    CameraFile::load(&path, &resolution_option(2)).expect("a valid camera file").remove(0)
}

fn unit(bytes: &[u8]) -> Vec<f32> {
    bytes.iter().map(|&byte| f32::from(byte) / 255.0).collect()
}

#[test]
fn transparent_images_are_multiplied_by_alpha_twice_in_memory() {
    let folder = Folder::new();
    let loaded = noise_view(&folder, false).load_image([0.0; 3], ImageMode::InMemory).expect("an image");
    assert_eq!(loaded.picture.size, UVec2::new(6, 4), "13x9 at resolution 2, halves to even");
    let rgba = unit(&IN_MEMORY_BLACK);
    let colors: Vec<_> = rgba.chunks(4).map(|p| Vec3::new(p[0] * p[3], p[1] * p[3], p[2] * p[3])).collect();
    assert_eq!(loaded.picture.pixels, colors, "Pillow's bytes, times alpha");
    assert_eq!(loaded.alpha, Some(rgba.chunks(4).map(|p| p[3]).collect()), "Pillow's alpha");
}

#[test]
fn dataloader_mode_composites_once() {
    let folder = Folder::new();
    let loaded = noise_view(&folder, false).load_image([1.0; 3], ImageMode::Dataloader).expect("an image");
    let colors: Vec<_> = unit(&DATALOADER_WHITE).chunks(3).map(Vec3::from_slice).collect();
    assert_eq!(loaded.picture.pixels, colors, "over white, Pillow's bytes");
    assert_eq!(loaded.alpha, None, "no alpha");
}

#[test]
fn masks_are_coverage_and_not_multiplied_in() {
    let folder = Folder::new();
    let plain = noise_view(&folder, false).load_image([0.0; 3], ImageMode::InMemory).expect("an image");
    let masked = noise_view(&folder, true).load_image([0.0; 3], ImageMode::InMemory).expect("an image");
    assert_eq!(masked.picture, plain.picture, "the image is already multiplied by its mask");
    assert_eq!(masked.alpha, Some(unit(&MASK)), "the mask, resampled");
}

#[test]
fn opaque_images_of_the_right_size_survive_exactly() {
    let folder = Folder::new();
    folder.write_rgb("a.png", 16, 16);
    let path = folder.write_json("transforms_test.json", &json!({"camera_angle_x": 0.8, "frames": [frame("a")]}));
    let view = CameraFile::load(&path, &CameraOptions::default()).expect("a valid camera file").remove(0);
    let loaded = view.load_image([0.3, 0.6, 0.9], ImageMode::InMemory).expect("an image");
    let colors: Vec<_> = unit(&noise(16 * 16 * 3, 7)).chunks(3).map(Vec3::from_slice).collect();
    assert_eq!(loaded.picture.pixels, colors, "every byte as it was");
    assert_eq!(loaded.alpha, None, "everything covered");
    let oversized =
        TrainingView { camera: Camera { size: UVec2::new(MAX_SIDE + 1, 1), ..view.camera }, ..view.clone() };
    let error = oversized.load_image([0.0; 3], ImageMode::InMemory).expect_err("too wide");
    assert!(matches!(error, DatasetError::Size { .. }), "{error}");
}

#[test]
fn missing_images_are_counted_and_the_first_ones_named() {
    let folder = Folder::new();
    let frames: Vec<_> = (0..10).map(|i| frame(&format!("r_{i:03}"))).collect();
    folder.write_json("transforms_train.json", &with(transforms(), "/frames", json!(frames)));
    folder.write_rgb("r_000.png", 4, 4);
    let dataset = Dataset::open(folder.path(), Split::Train, &CameraOptions::default()).expect("cameras suffice");
    let error = dataset.require_images().expect_err("nine are missing").to_string();
    for part in ["9 of 10", "r_001.png", "and 5 more"] {
        assert!(error.contains(part), "{part} is not in: {error}");
    }
    let error = dataset.views[3].load_image([0.0; 3], ImageMode::InMemory).expect_err("missing").to_string();
    assert!(error.contains("r_003.png"), "{error}");
    for (i, _) in frames.iter().enumerate() {
        folder.write_rgb(&format!("r_{i:03}.png"), 4, 4);
    }
    assert!(dataset.require_images().is_ok(), "all are there now");
}

#[test]
fn damaged_images_are_errors_that_name_them() {
    let folder = Folder::new();
    let view = noise_view(&folder, true);
    let bytes = fs::read(&view.image).expect("the image");
    for damaged in [&bytes[..bytes.len() / 2], &bytes[..20], b"", b"GIF89a"] {
        folder.write("a.png", damaged);
        let error = view.load_image([0.0; 3], ImageMode::InMemory).expect_err("damaged");
        assert!(matches!(error, DatasetError::Image { .. }) && error.to_string().contains("a.png"), "{error}");
    }
}
