//! EXR pictures in the colors that datasets have.
//!
//! In: linear light, multiplied by alpha, in single precision. Out: sRGB-encoded colors, not multiplied by alpha, with 8 bits.

use crate::view::srgb;
use glam::{Vec3, Vec4};
use image::{DynamicImage, Rgba, RgbaImage};

/// Encodes the colors. Light above 1 becomes white; what is not a number becomes 0.
pub(super) fn displayed(image: DynamicImage) -> DynamicImage {
    let linear = image.into_rgba32f();
    let pixel = |x: u32, y: u32| {
        let light = Vec4::from_array(linear.get_pixel(x, y).0.map(|value| if value.is_nan() { 0.0 } else { value }));
        let alpha = light.w.clamp(0.0, 1.0);
        let straight = if alpha > 0.0 { light.truncate() / alpha } else { Vec3::ZERO };
        let color = srgb::encode(straight.clamp(Vec3::ZERO, Vec3::ONE));
        Rgba(color.extend(alpha).to_array().map(|value| (255.0 * value).round() as u8))
    };
    DynamicImage::ImageRgba8(RgbaImage::from_fn(linear.width(), linear.height(), pixel))
}
