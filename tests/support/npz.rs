//! Pictures of an `.npz` archive, as NumPy writes it.
//!
//! In: an archive and the name of an array of views × 3 × height × width (float32 or float16). Out: one picture per
//! view.

use super::npy;
use bevy_gs4d::view::Picture;
use glam::{UVec2, Vec3};
use std::path::Path;

/// Reads the pictures.
pub fn pictures(path: &Path, array: &str) -> Vec<Picture> {
    let (header, bytes) = npy::array(path, array);
    assert!(header.contains("'fortran_order': False"), "the array is in C order: {header}");
    let values: Vec<f32> = if header.contains("'<f4'") {
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    } else {
        assert!(header.contains("'<f2'"), "the type is float32 or float16: {header}");
        bytes.chunks_exact(2).map(|b| from_half(u16::from_le_bytes([b[0], b[1]]))).collect()
    };
    let [views, channels, height, width] = shape(&header);
    assert_eq!((channels, values.len()), (3, views * 3 * height * width), "the number of values matches the shape");
    let plane = height * width;
    let picture = |view: &[f32]| Picture {
        size: UVec2::new(width as u32, height as u32),
        pixels: (0..plane).map(|i| Vec3::new(view[i], view[plane + i], view[2 * plane + i])).collect(),
    };
    values.chunks_exact(3 * plane).map(picture).collect()
}

/// Returns the four numbers after `'shape': (`.
fn shape(header: &str) -> [usize; 4] {
    let (_, rest) = header.split_once("'shape': (").expect("the header has a shape");
    let (inside, _) = rest.split_once(')').expect("the shape is closed");
    let numbers: Vec<usize> = inside.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    numbers.try_into().expect("the array has four dimensions")
}

/// Converts from IEEE half precision, except infinities and NaN.
fn from_half(bits: u16) -> f32 {
    let magnitude = match ((bits >> 10) & 0x1f, f32::from(bits & 0x3ff)) {
        (0, fraction) => fraction * (-24.0f32).exp2(),
        (exponent, fraction) => (1.0 + fraction / 1024.0) * (f32::from(exponent) - 15.0).exp2(),
    };
    if bits & 0x8000 == 0 { magnitude } else { -magnitude }
}
