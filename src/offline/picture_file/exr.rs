//! EXR pictures in the colors of datasets.
//!
//! In: linear light, premultiplied by alpha, in single precision; or an error of the decoder. Out: sRGB-encoded colors
//! of 8 bits, not premultiplied; or a sentence with the fault and the remedy.

use crate::view::srgb;
use glam::{Vec3, Vec4};
use image::error::{DecodingError, ImageFormatHint};
use image::{DynamicImage, ImageError, ImageFormat, Rgba, RgbaImage};
use std::error::Error;

/// The decoder's message about a picture without the channels R, G and B, or with lists of values for each pixel.
const NO_RGB: &str = "image does not contain non-deep rgb channels";
/// The decoder's message about a file that ends too early.
const CUT: &str = "invalid: reference to missing bytes";

/// Returns an error of the EXR decoder with a [`sentence`] in place of its message. Other errors are unchanged.
pub(super) fn in_words(error: ImageError) -> ImageError {
    let hint = ImageFormatHint::Exact(ImageFormat::OpenExr);
    let said = match &error {
        ImageError::Decoding(decoding) if decoding.format_hint() == hint => decoding.source().map(ToString::to_string),
        _ => None,
    };
    said.map_or(error, |said| ImageError::Decoding(DecodingError::new(hint, sentence(&said))))
}

/// Returns the fault and the remedy for a message of the decoder.
fn sentence(said: &str) -> String {
    if said == NO_RGB {
        return "it has no channels R, G and B with one value for each pixel (it may be gray, of depths, or \"deep\"): \
                save it as RGB or RGBA"
            .to_owned();
    }
    if said == CUT {
        return "it ends too early: copy it again".to_owned();
    }
    match (said.strip_prefix("not supported: "), said.strip_prefix("invalid: ")) {
        (Some(part), _) => {
            format!("it needs what the decoder does not have ({part}): save it as RGB or RGBA with the compression ZIP")
        }
        (None, Some(part)) => format!("it is damaged ({part}): copy it again"),
        (None, None) => format!("it cannot be decoded ({said}): copy it again, or save it as PNG"),
    }
}

/// Encodes the colors. Light above 1 becomes white, NaN becomes 0.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_the_decoder_become_sentences() {
        let error = |format: ImageFormat, said: &str| {
            in_words(ImageError::Decoding(DecodingError::new(format.into(), said.to_owned()))).to_string()
        };
        for (said, part) in [
            (NO_RGB, "save it as RGB or RGBA"),
            (CUT, "it ends too early: copy it again"),
            ("invalid: not enough data", "it is damaged (not enough data): copy it again"),
            ("not supported: unknown compression method", "(unknown compression method): save it as"),
            ("cancelled", "(cancelled)"),
        ] {
            let found = error(ImageFormat::OpenExr, said);
            assert!(found.contains(part), "{part:?} is not in: {found}");
        }
        assert!(error(ImageFormat::Png, CUT).ends_with(CUT), "another format");
    }
}
