//! Pictures.
//!
//! In: small PNG, JPEG and EXR files of several kinds, and raw pictures. Out: files whose chunks and segments have
//! right lengths and checksums, with wrong sizes, tables and pixels; each is read as image and mask, in every way that
//! training images are read.

use super::{Outcome, Reader};
use crate::change::jpeg::Segment;
use crate::change::png::Chunk;
use crate::change::{bytes, jpeg, numbers, png};
use crate::support::random::Random;
use bevy_gs4d::internal::offline::measure::Pair;
use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions, TrainingView};
use bevy_gs4d::offline::measure::ImageMetrics;
use bevy_gs4d::view::{Camera, Picture};
use glam::{Mat4, UVec2, Vec3};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::openexr::OpenExrEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, RgbImage};
use serde_json::json;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Size that pictures are scaled to; the seeds have other sizes.
const SIZE: UVec2 = UVec2::new(12, 9);

/// The reader of training images.
pub struct Pictures {
    folder: TempDir,
    png: Vec<Vec<Chunk>>,
    jpeg: Vec<Vec<Segment>>,
    exr: Vec<Vec<u8>>,
}

impl Pictures {
    /// Makes seeds of every color type and depth, and a camera file that takes their size from the picture.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut random = Random::new(7);
        // The camera expects squares: sizes that differ by one pixel are accepted.
        let kinds = [(2, 8), (6, 8), (0, 8), (3, 8), (4, 8), (0, 16), (2, 16), (0, 1), (3, 2)];
        let png = Vec::from(kinds.map(|(color, depth)| png::picture(10, 9, color, depth, &mut random)));
        let jpeg = [(16, 16), (17, 16)].map(|(width, height)| {
            let pixels = (0..width * height * 3).map(|_| random.bits() as u8).collect();
            let picture = RgbImage::from_raw(width, height, pixels).expect("as many bytes as pixels need");
            let mut file = Vec::new();
            JpegEncoder::new_with_quality(&mut file, 80).encode_image(&picture).expect("memory can be written to");
            jpeg::segments(&file)
        });
        let exr = [(10, 9), (20, 19)].map(|(width, height)| {
            let pixels: Vec<u8> = (0..width * height * 3).map(|_| random.bits() as u8).collect();
            let picture = RgbImage::from_raw(width, height, pixels).expect("as many bytes as pixels need");
            let light = DynamicImage::ImageRgb8(picture).into_rgba32f();
            let mut file = std::io::Cursor::new(Vec::new());
            let encoder = OpenExrEncoder::new(&mut file);
            encoder
                .write_image(bytemuck::cast_slice(&light), width, height, ExtendedColorType::Rgba32F)
                .expect("memory can be written to");
            file.into_inner()
        });
        let pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]];
        let frame = json!({ "file_path": "picture.png", "transform_matrix": pose });
        let cameras = json!({ "camera_angle_x": 0.7, "frames": [frame] });
        fs::write(folder.path().join("cameras.json"), cameras.to_string()).expect("the folder can be written to");
        Self { folder, png, jpeg: Vec::from(jpeg), exr: Vec::from(exr) }
    }
}

impl Reader for Pictures {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut file = if random.one_in(4) {
            let (mut file, other) = (random.pick(&self.exr).clone(), random.pick(&self.exr));
            bytes::change(&mut file, other, random);
            file
        } else if random.one_in(2) {
            let (mut chunks, other) = (random.pick(&self.png).clone(), random.pick(&self.png));
            png::change(&mut chunks, other, random);
            png::file(&chunks)
        } else {
            let (mut segments, other) = (random.pick(&self.jpeg).clone(), random.pick(&self.jpeg));
            jpeg::change(&mut segments, other, random);
            jpeg::file(&segments)
        };
        if random.one_in(8) {
            bytes::change(&mut file, &png::file(random.pick::<Vec<_>>(&self.png)), random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let path = self.folder.path().join("picture.png");
        fs::write(&path, bytes).expect("the folder can be written to");
        let camera = Camera { world_to_camera: Mat4::IDENTITY, size: SIZE, lens: Camera::fov_lens(0.7, SIZE) };
        let name = "picture".to_owned();
        let view = TrainingView {
            name,
            camera,
            time: 0.0,
            original: UVec2::splat(128),
            image: path.clone(),
            mask: Some(path),
            correction: Default::default(),
        };
        let covered = view.load_covered();
        let cameras = self.folder.path().join("cameras.json");
        let sized = CameraFile::load(&cameras, &CameraOptions::default());
        let image = match (covered, sized) {
            (Ok(image), Ok(_)) => image,
            (Err(error), _) => return Ok(Outcome::Refused(error.to_string())),
            (_, Err(error)) => return Err(format!("is read although its size is not: {error}")),
        };
        let pictures = [Vec3::ZERO, Vec3::new(0.2, 0.5, 1.0)].map(|background| image.over(background));
        pictures.iter().try_for_each(check).map(|()| Outcome::Accepted)
    }
}

/// Checks the size and the values of a picture.
fn check(picture: &Picture) -> Result<(), String> {
    let within = |pixel: &Vec3| pixel.min_element() >= 0.0 && pixel.max_element() <= 1.0 + 1e-6;
    if picture.size != SIZE || picture.pixels.len() != (SIZE.x * SIZE.y) as usize {
        return Err(format!("has a picture of {} pixels, not {SIZE}", picture.size));
    }
    match picture.pixels.iter().find(|pixel| !within(pixel)) {
        Some(pixel) => Err(format!("has a pixel {pixel}")),
        None => Ok(()),
    }
}

/// The reader of raw pictures.
pub struct RawPictures {
    folder: TempDir,
}

impl RawPictures {
    /// Makes the reference picture of the comparisons.
    pub fn new() -> Self {
        let raw = Self { folder: tempfile::tempdir().expect("a temporary folder") };
        let picture = Picture::filled(SIZE, Vec3::new(0.2, 0.5, 0.9));
        fs::write(raw.file("one.f32"), picture.to_raw()).expect("the folder can be written to");
        raw
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

impl Reader for RawPictures {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut picture = Picture::filled(SIZE, Vec3::new(0.2, 0.4, 1.5));
        for _ in 0..random.below(4) {
            let at = random.below(picture.pixels.len());
            picture.pixels[at][random.below(3)] = numbers::float(random);
        }
        let mut file = picture.to_raw();
        if random.one_in(4) {
            bytes::change(&mut file, &[0; 64], random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let (a, b) = (self.file("one.f32"), self.file("other.f32"));
        fs::write(&b, bytes).expect("the folder can be written to");
        let pair = Pair { name: "raw".to_owned(), a, b };
        let is_finite = |metrics: &ImageMetrics| {
            [Some(metrics.psnr), Some(metrics.psnr_pooled), metrics.ssim].into_iter().flatten().all(f64::is_finite)
        };
        match pair.compare(Some(SIZE)) {
            Ok(metrics) if !is_finite(&metrics) => Err(format!("is compared as {metrics:?}")),
            Ok(_) => Ok(Outcome::Accepted),
            Err(error) => Ok(Outcome::Refused(error.to_string())),
        }
    }
}
