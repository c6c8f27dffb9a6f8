//! Images of datasets.
//!
//! In: small images written to temporary folders. Out: proof that their values match numpy and Pillow, and that missing
//! and damaged images are named.

use std::fs;

use bevy_gs4d::offline::dataset::{
    CameraFile, CameraOptions, CoveredImage, Dataset, DatasetError, MAX_SIDE, Split, TrainingView,
};
use bevy_gs4d::offline::picture_file::PictureError;
use bevy_gs4d::view::Camera;
use glam::{UVec2, Vec3};
use image::{GrayImage, Rgba32FImage, RgbaImage};
use serde_json::json;

use super::{Folder, frame, noise, resolution_option, transforms, with};

// The results of numpy and Pillow for `rgba_noise(13 * 9, 4)` and, for the mask, for `noise(13 * 9, 5)`, at 6x4.
#[rustfmt::skip]
const OVER_BLACK: [u8; 72] = [
    38, 59, 32, 74, 102, 51, 48, 72, 32, 86, 66, 78, 38, 52, 13, 39, 59, 63, 99, 107, 81, 96, 136, 93, 60, 89, 65,
    47, 59, 71, 55, 50, 45, 94, 128, 60, 92, 80, 60, 108, 89, 82, 92, 78, 96, 71, 80, 92, 69, 41, 32, 57, 56, 48,
    38, 17, 45, 59, 71, 72, 62, 60, 34, 32, 20, 22, 44, 11, 44, 89, 86, 88,
];
#[rustfmt::skip]
const COVERAGE: [u8; 24] = [
    89, 124, 102, 122, 94, 96, 184, 172, 145, 150, 130, 178, 157, 140, 150, 165, 97, 109, 83, 152, 111, 70, 103,
    136,
];
#[rustfmt::skip]
const OVER_WHITE: [u8; 72] = [
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

/// Returns the colors of an image, 3 bytes a pixel, and its coverage.
fn bytes(image: &CoveredImage) -> (Vec<u8>, Vec<u8>) {
    let colors = image.texels.iter().flat_map(|texel| texel[..3].to_vec());
    (colors.collect(), image.texels.iter().map(|texel| texel[3]).collect())
}

#[test]
fn transparent_images_are_multiplied_by_alpha_once() {
    let folder = Folder::new();
    let image = noise_view(&folder, false).load_covered().expect("an image");
    assert_eq!(image.size, UVec2::new(6, 4), "13x9 at resolution 2, halves to even");
    assert_eq!(
        bytes(&image),
        (OVER_BLACK.to_vec(), COVERAGE.to_vec()),
        "the bytes of Pillow over black, and the alpha of Pillow"
    );
    assert!(image.has_gaps, "some pixels are not covered");
    let over_black: Vec<_> = unit(&OVER_BLACK).chunks(3).map(Vec3::from_slice).collect();
    assert_eq!(image.over(Vec3::ZERO).pixels, over_black, "the composite over black has the same bytes");
    let over_white: Vec<_> = unit(&OVER_WHITE).chunks(3).map(Vec3::from_slice).collect();
    let found = image.over(Vec3::ONE).pixels;
    // The bicubic filter overshoots on noise; the image is clipped where the composite is not.
    let farthest = found.iter().zip(&over_white).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
    assert!(
        farthest < 5.5 / 255.0,
        "at most 5.5 steps from an image composited over white before resampling: {farthest}"
    );
    let mean = found.iter().zip(&over_white).map(|(a, b)| (*a - *b).element_sum()).sum::<f32>() / 72.0;
    assert!(mean.abs() < 1.0 / 255.0, "the mean differs by rounding: {mean}");
}

#[test]
fn masks_are_returned_as_coverage_and_not_multiplied() {
    let folder = Folder::new();
    let masked = noise_view(&folder, true).load_covered().expect("an image");
    assert_eq!(bytes(&masked), (OVER_BLACK.to_vec(), MASK.to_vec()), "the unchanged image, and the resampled mask");
    let background = Vec3::new(0.2, 0.4, 0.6);
    let (color, covered) = (unit(&OVER_BLACK[..3]), unit(&MASK[..1]));
    let expected = Vec3::from_slice(&color) + (1.0 - covered[0]) * background;
    let found = masked.over(background).pixel(0, 0);
    assert!(
        found.abs_diff_eq(expected, 1e-6),
        "the background is visible where the mask is empty: {found} and {expected}"
    );
}

#[test]
fn an_image_that_is_brighter_than_its_mask_is_clamped() {
    let image = CoveredImage { size: UVec2::ONE, texels: vec![[140, 100, 0, 128]], has_gaps: true };
    let found = image.over(Vec3::ONE).pixel(0, 0);
    assert_eq!(found.x, 1.0, "140 + 127 of 255 is at most 1");
    assert!((found.y - 227.0 / 255.0).abs() < 1e-6, "100 + 127 of 255: {found}");
}

#[test]
fn opaque_images_of_the_right_size_are_unchanged() {
    let folder = Folder::new();
    folder.write_rgb("a.png", 16, 16);
    let path = folder.write_json("transforms_test.json", &json!({"camera_angle_x": 0.8, "frames": [frame("a")]}));
    let view = CameraFile::load(&path, &CameraOptions::default()).expect("a valid camera file").remove(0);
    let loaded = view.load_covered().expect("an image");
    let colors: Vec<_> = unit(&noise(16 * 16 * 3, 7)).chunks(3).map(Vec3::from_slice).collect();
    assert_eq!(loaded.over(Vec3::new(0.3, 0.6, 0.9)).pixels, colors, "every byte is unchanged over any background");
    assert!(!loaded.has_gaps, "every pixel is covered");
    let oversized =
        TrainingView { camera: Camera { size: UVec2::new(MAX_SIDE + 1, 1), ..view.camera }, ..view.clone() };
    let error = oversized.load_covered().expect_err("too wide");
    assert!(matches!(error, DatasetError::Size { .. }), "{error}");
}

#[test]
fn missing_images_are_counted_and_the_first_ones_named() {
    let folder = Folder::new();
    let frames: Vec<_> = (0..10).map(|i| frame(&format!("r_{i:03}"))).collect();
    folder.write_json("transforms_train.json", &with(transforms(), "/frames", json!(frames)));
    folder.write_rgb("r_000.png", 4, 4);
    let dataset = Dataset::open(folder.path(), Split::Train, &CameraOptions::default()).expect("cameras suffice");
    let error = dataset.require_images().expect_err("nine images are missing").to_string();
    for part in ["9 of 10", "r_001.png", "and 5 more"] {
        assert!(error.contains(part), "{part} is not in: {error}");
    }
    let error = dataset.views[3].load_covered().expect_err("missing").to_string();
    assert!(error.contains("r_003.png"), "{error}");
    for (i, _) in frames.iter().enumerate() {
        folder.write_rgb(&format!("r_{i:03}.png"), 4, 4);
    }
    assert!(dataset.require_images().is_ok(), "no image is missing");
}

#[test]
fn damaged_images_are_errors_that_name_them() {
    let folder = Folder::new();
    let view = noise_view(&folder, true);
    let bytes = fs::read(&view.image).expect("the image");
    for damaged in [&bytes[..bytes.len() / 2], &bytes[..20], b"", b"GIF89a"] {
        folder.write("a.png", damaged);
        let error = view.load_covered().expect_err("damaged");
        assert!(matches!(error, DatasetError::Image { .. }) && error.to_string().contains("a.png"), "{error}");
    }
}

/// Returns the only view of a camera file whose pictures are `size` wide and high, with an image of that name.
fn view_of(folder: &Folder, image: &str, size: u32) -> TrainingView {
    let json = json!({"camera_angle_x": 0.8, "w": size, "h": size, "frames": [frame(image)]});
    let path = folder.write_json("transforms_test.json", &json);
    CameraFile::load(&path, &CameraOptions::default()).expect("a valid camera file").remove(0)
}

#[test]
fn linear_light_of_exr_images_becomes_srgb_colors() {
    let folder = Folder::new();
    // Linear light multiplied by alpha: one half; one half behind a coverage of one half; brighter than white; a
    // negative value and NaN.
    let texels = [[0.5, 0.5, 0.5, 1.0], [0.25, 0.25, 0.25, 0.5], [4.0, 1.0, 0.0, 1.0], [-1.0, f32::NAN, 0.002, 1.0]];
    let image = Rgba32FImage::from_raw(2, 2, texels.concat()).expect("four texels");
    image.save(folder.path().join("a.exr")).expect("the folder can be written to");
    let loaded = view_of(&folder, "a.exr", 2).load_covered().expect("a valid image");
    // Alpha of 128 of 255 is multiplied into the color, and the product truncated: 188 * 128 / 255.
    let expected = [[188, 188, 188, 255], [94, 94, 94, 128], [255, 255, 0, 255], [0, 0, 7, 255]];
    assert_eq!(loaded.texels, expected, "sRGB-encoded, within 0 and 1");
}

#[test]
fn truncated_jpegs_are_refused() {
    let folder = Folder::new();
    folder.write_rgb("a.jpg", 40, 40);
    let view = view_of(&folder, "a.jpg", 40);
    assert!(view.load_covered().is_ok(), "the whole image");
    let bytes = fs::read(&view.image).expect("the image");
    for length in [bytes.len() - 2, bytes.len() - 20, bytes.len() / 2] {
        for end in [&[][..], &[0xff, 0xd9]] {
            if length == bytes.len() - 2 && !end.is_empty() {
                continue;
            }
            folder.write("a.jpg", [&bytes[..length], end].concat());
            let error = view.load_covered().expect_err("cut off");
            let incomplete = matches!(error, DatasetError::Image(PictureError::Incomplete { .. }));
            assert!(incomplete && error.to_string().contains("a.jpg"), "{length} bytes, then {end:?}: {error}");
        }
    }
}

#[test]
fn images_far_larger_than_in_the_camera_file_are_not_decoded() {
    let folder = Folder::new();
    let view = view_of(&folder, "a.png", 8);
    folder.write_rgb("a.png", 32, 32);
    assert!(view.load_covered().is_ok(), "an image four times as large is scaled");
    for (width, height) in [(33, 8), (8, 33), (300, 300)] {
        folder.write_rgb("a.png", width, height);
        let error = view.load_covered().expect_err("too large");
        assert!(matches!(error, DatasetError::Image(PictureError::TooLarge { .. })), "{width} x {height}: {error}");
        let message = error.to_string();
        assert!(message.contains("a.png") && message.contains(&width.to_string()), "{message}");
    }
    let halved = TrainingView { camera: Camera { size: UVec2::splat(1), ..view.camera }, ..view };
    folder.write_rgb("a.png", 8, 8);
    assert!(halved.load_covered().is_ok(), "the limit does not depend on the size of the camera");
}

#[test]
fn images_of_another_aspect_ratio_are_refused() {
    let folder = Folder::new();
    let json = json!({"camera_angle_x": 0.8, "w": 40, "h": 30, "frames": [frame("a.png")]});
    let json = with(json, "/frames/0/mask_path", json!("m.png"));
    let path = folder.write_json("transforms_test.json", &json);
    let load = |options: &CameraOptions| CameraFile::load(&path, options).expect("a valid camera file").remove(0);
    let view = load(&CameraOptions::default());
    // Scaled to a side of the other size, the other side differs by at most one pixel.
    let similar = [(40, 30), (80, 60), (80, 61), (79, 60), (41, 30), (40, 29), (20, 15), (13, 10), (13, 9), (160, 116)];
    let different = [(40, 32), (42, 30), (30, 40), (80, 64), (80, 57), (20, 13), (160, 115), (1, 30), (40, 1)];
    let sizes = similar.map(|size| (size, true)).into_iter().chain(different.map(|size| (size, false)));
    for ((width, height), accepted) in sizes {
        for (changed, other) in [("a.png", "m.png"), ("m.png", "a.png")] {
            folder.write_rgb(changed, width, height);
            folder.write_rgb(other, 40, 30);
            let what = format!("{changed} of {width} x {height}");
            let Err(error) = view.load_covered() else {
                assert!(accepted, "{what} must be refused");
                continue;
            };
            assert!(!accepted && matches!(error, DatasetError::Aspect { .. }), "{what}: {error}");
            for part in [changed, &format!("{width} x {height}"), "40 x 30", "crop"] {
                assert!(error.to_string().contains(part), "{what}: {part:?} is not in: {error}");
            }
        }
    }
    // A requested size may have another aspect ratio: images are checked against the camera file.
    folder.write_rgb("a.png", 80, 60);
    folder.write_rgb("m.png", 40, 30);
    let square = load(&CameraOptions { size: Some(UVec2::splat(16)), ..CameraOptions::default() });
    let loaded = square.load_covered().expect("an image of the right aspect ratio");
    assert_eq!(loaded.size, UVec2::splat(16), "the requested size");
}

#[test]
fn masks_have_the_limits_of_images() {
    let folder = Folder::new();
    folder.write_rgb("a.png", 8, 8);
    folder.write_rgb("m.jpg", 40, 40);
    let with_mask = with(transforms(), "/frames/0/mask_path", json!("m.jpg"));
    let with_mask = with(with(with_mask, "/w", json!(8)), "/h", json!(8));
    let path = folder.write_json("transforms_test.json", &with_mask);
    let view = CameraFile::load(&path, &CameraOptions::default()).expect("a valid camera file").remove(0);
    let message = view.load_covered().expect_err("too large").to_string();
    assert!(message.contains("m.jpg") && message.contains("40 x 40"), "{message}");
}

/// Returns a PNG of one pixel whose header gives `side` for width and height.
fn claiming(folder: &Folder, side: u32) -> Vec<u8> {
    folder.write_rgb("one.png", 1, 1);
    let mut bytes = fs::read(folder.path().join("one.png")).expect("the image");
    // The chunk of the header follows the signature: length, name, width, height, five bytes, checksum.
    bytes[16..20].copy_from_slice(&side.to_be_bytes());
    bytes[20..24].copy_from_slice(&side.to_be_bytes());
    let checksum = crc32fast::hash(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    bytes
}

#[test]
fn the_size_in_a_camera_file_is_limited() {
    let folder = Folder::new();
    folder.write("a.png", claiming(&folder, MAX_SIDE));
    let error = view_of(&folder, "a.png", MAX_SIDE).load_covered().expect_err("too much");
    assert!(matches!(error, DatasetError::Image(PictureError::FarTooLarge { .. })), "{error}");
    let without_size = json!({"camera_angle_x": 0.8, "frames": [frame("a.png")]});
    let path = folder.write_json("transforms_test.json", &without_size);
    let error = CameraFile::load(&path, &CameraOptions::default()).expect_err("the size is unknown");
    assert!(matches!(error, DatasetError::Image(_)) && error.to_string().contains("a.png"), "{error}");
}
