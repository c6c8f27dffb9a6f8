//! Pictures that would fill the memory.
//!
//! In: small files made here that state many times their size, or hold it packed. Out: proof that they are refused
//! before they are decoded, with their claim and the limit, and that compressed chunks of a PNG other than its pixels
//! are ignored.

use bevy_gs4d::offline::picture_file::{PictureError, open, size};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::UVec2;
use image::codecs::openexr::OpenExrEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, RgbImage};
use std::fs;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use tempfile::TempDir;

/// Bytes of the signature and the header of a PNG.
const HEADER: usize = 33;

fn png() -> (RgbImage, Vec<u8>) {
    let image = RgbImage::from_fn(7, 5, |x, y| image::Rgb([x as u8 * 9, y as u8 * 20, 77]));
    let mut bytes = Vec::new();
    image.write_with_encoder(PngEncoder::new(&mut bytes)).expect("it can be encoded");
    (image, bytes)
}

/// Returns a chunk of a PNG.
fn chunk(kind: &[u8; 4], contents: &[u8]) -> Vec<u8> {
    let named = [&kind[..], contents].concat();
    let checksum = crc32fast::hash(&named).to_be_bytes();
    [&(contents.len() as u32).to_be_bytes()[..], &named, &checksum].concat()
}

fn written(folder: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("the folder can be written to");
    path
}

#[test]
fn color_profiles_and_texts_of_a_png_change_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (image, plain) = png();
    let mut zeros = ZlibEncoder::new(Vec::new(), Compression::fast());
    zeros.write_all(&vec![0; 4 << 20]).expect("memory");
    let zeros = zeros.finish().expect("memory");
    for (kind, start) in [(b"iCCP", &b"p\0\0"[..]), (b"zTXt", &b"a\0\0"[..]), (b"iTXt", &b"a\0\x01\0\0\0"[..])] {
        let other = chunk(kind, &[start, &zeros].concat());
        let bytes = [&plain[..HEADER], &other, &plain[HEADER..]].concat();
        let path = written(&folder, "a.png", &bytes);
        assert_eq!(size(&path, UVec2::splat(9)).expect("a picture"), UVec2::new(7, 5), "its size");
        let found = open(&path, UVec2::splat(9)).expect("a picture").into_rgb8();
        assert!(found == image, "its pixels are those without the chunk");
    }
}

#[test]
fn a_png_that_claims_more_pixels_than_its_bytes_can_hold_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, mut bytes) = png();
    bytes[16..20].copy_from_slice(&8000_u32.to_be_bytes());
    bytes[20..24].copy_from_slice(&8001_u32.to_be_bytes());
    let checksum = crc32fast::hash(&bytes[12..29]).to_be_bytes();
    bytes[29..HEADER].copy_from_slice(&checksum);
    let error = open(&written(&folder, "a.png", &bytes), UVec2::splat(9000)).expect_err("192 MB of a few bytes");
    assert!(matches!(error, PictureError::TooMuch { .. }), "{error}");
    let limit = ((128 << 20) + 64 * bytes.len()).to_string();
    for part in ["a.png", "8000 x 8001", "192024000 bytes", &limit] {
        assert!(error.to_string().contains(part), "{part:?} is not in: {error}");
    }
}

#[test]
fn the_size_of_an_exr_is_limited_by_its_data_window() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut bytes = Vec::new();
    OpenExrEncoder::new(Cursor::new(&mut bytes))
        .write_image(&[0; 6 * 4 * 12], 6, 4, ExtendedColorType::Rgb32F)
        .expect("it can be encoded");
    let whole = open(&written(&folder, "a.exr", &bytes), UVec2::splat(9)).expect("a picture");
    assert_eq!((whole.width(), whole.height()), (6, 4), "the file is read before the change");
    let attribute = b"dataWindow\0box2i\0\x10\0\0\0";
    let at = bytes.windows(attribute.len()).position(|window| window == attribute).expect("the window of the data");
    let last = at + attribute.len() + 8;
    bytes[last..last + 4].copy_from_slice(&49_999_i32.to_le_bytes());
    bytes[last + 4..last + 8].copy_from_slice(&39_999_i32.to_le_bytes());
    let error = open(&written(&folder, "a.exr", &bytes), UVec2::splat(9)).expect_err("24 GB of a few bytes");
    let is_refused = matches!(error, PictureError::TooMuch { .. } | PictureError::Format { .. });
    assert!(is_refused && error.to_string().contains("a.exr"), "{error}");
}
