//! Lossless WebP textures.
//!
//! In: a texel for each Gaussian. Out: the bytes of a WebP file.

use image_webp::{ColorType, EncoderParams, WebPEncoder};
use std::io;

/// Sides are multiples of this, as players upload them.
const SIDE: usize = 4;

/// Returns the width and height of the texture of `count` Gaussians, nearly a square.
fn size(count: usize) -> (usize, usize) {
    let width = ((count as f64).sqrt().ceil() as usize).next_multiple_of(SIDE).max(SIDE);
    (width, count.div_ceil(width).next_multiple_of(SIDE).max(SIDE))
}

/// Encodes a texel for each Gaussian; the texels after them are 0.
///
/// # Errors
/// More Gaussians than a picture has pixels.
pub(super) fn encode(texels: &[[u8; 4]]) -> io::Result<Vec<u8>> {
    let (width, height) = size(texels.len());
    encode_sized(texels, width, height)
}

/// Encodes texels as a picture of this size.
///
/// # Errors
/// A size that no picture has.
pub(super) fn encode_sized(texels: &[[u8; 4]], width: usize, height: usize) -> io::Result<Vec<u8>> {
    let is_opaque = texels.iter().all(|texel| texel[3] == u8::MAX);
    let channels = if is_opaque { 3 } else { 4 };
    let mut pixels: Vec<u8> = texels.iter().flat_map(|texel| &texel[..channels]).copied().collect();
    pixels.resize(width * height * channels, 0);
    let color = if is_opaque { ColorType::Rgb8 } else { ColorType::Rgba8 };
    let encoded = |predicts: bool| -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = WebPEncoder::new(&mut bytes);
        let mut params = EncoderParams::default();
        params.use_predictor_transform = predicts;
        encoder.set_params(params);
        let size = [width, height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        encoder.encode(&pixels, size[0], size[1], color).map_err(io::Error::other)?;
        Ok(bytes)
    };
    // Prediction helps high bytes and harms codes.
    let (with, without) = (encoded(true)?, encoded(false)?);
    Ok(if with.len() < without.len() { with } else { without })
}
