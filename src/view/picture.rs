//! Pictures in floating point: training images and rendered views.
//!
//! In and out: RGB values in the blend space (sRGB-encoded), usually 0 to 1; 8-bit RGB images or raw float32 bytes.

use glam::{UVec2, Vec3};

/// An RGB picture, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: UVec2,
    /// `width × height` pixels, row by row. Unclamped.
    pub pixels: Vec<Vec3>,
}

impl Picture {
    /// Returns a picture of one color.
    pub fn filled(size: UVec2, color: Vec3) -> Self {
        Self { size, pixels: vec![color; size.x as usize * size.y as usize] }
    }

    /// Returns the pixel at column `x`, row `y`.
    ///
    /// # Panics
    /// If `y * width + x` is beyond the last pixel.
    pub fn pixel(&self, x: u32, y: u32) -> Vec3 {
        self.pixels[y as usize * self.size.x as usize + x as usize]
    }

    /// Returns the picture with every value clamped to 0..1, as the original evaluates it.
    pub fn clamped(&self) -> Self {
        Self { size: self.size, pixels: self.pixels.iter().map(|p| p.clamp(Vec3::ZERO, Vec3::ONE)).collect() }
    }

    /// Converts to 8-bit RGB: clamped to 0..1, times 255, rounded.
    pub fn to_rgb8(&self) -> image::RgbImage {
        let bytes = self.pixels.iter().flat_map(|p| p.to_array()).map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
        image::RgbImage::from_raw(self.size.x, self.size.y, bytes.collect()).unwrap_or_default()
    }

    /// Converts from 8-bit RGB: divided by 255.
    pub fn from_rgb8(image: &image::RgbImage) -> Self {
        let pixels = image.pixels().map(|p| Vec3::from(p.0.map(f32::from)) / 255.0).collect();
        Self { size: UVec2::new(image.width(), image.height()), pixels }
    }

    /// Returns the raw form: height × width × 3 little-endian float32, unclamped.
    pub fn to_raw(&self) -> Vec<u8> {
        self.pixels.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect()
    }
}
