//! Textures: lossless WebP pictures whose texels are numbers.
//!
//! In: the bytes of WebP files. Out: their texels, red, green, blue and alpha, row by row, with the bytes as stored.
//! The size of a texture is compared with the number of Gaussians before it is decoded, and the number of Gaussians
//! with the [`Budget`] of all textures.

use super::files::Files;
use crate::codec::budget::Budget;
use crate::codec::import::ImportError;
use crate::codec::text::printable;
use image_webp::WebPDecoder;
use rayon::prelude::*;
use std::io::Cursor;

/// Most texels of a texture for each Gaussian, and further ones of every texture: more than the padding of any writer.
const TEXELS: usize = 4;
const PADDING: usize = 1024;
/// Bytes of memory of a Gaussian: its texels in about ten textures, its values with color of degree 3, and the Gaussian
/// as it is drawn. In the file it has about ten bytes.
const GAUSSIAN: u64 = 440;

/// The texels of a texture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Texture {
    pub width: usize,
    /// Red, green, blue, alpha.
    pub texels: Vec<[u8; 4]>,
}

/// A texture as it is stored.
#[derive(Debug)]
pub(super) struct Encoded {
    name: String,
    bytes: Vec<u8>,
}

impl Encoded {
    /// Reads a texture.
    ///
    /// # Errors
    /// As [`Files::read`].
    pub(super) fn read(files: &mut Files, name: &str) -> Result<Self, ImportError> {
        Ok(Self { name: printable(name), bytes: files.read(name)? })
    }

    /// Decodes a texture with a texel for each of `count` Gaussians; the texels after them are left out.
    ///
    /// # Errors
    /// A size that does not fit the count; a picture that is damaged or not lossless WebP.
    pub(super) fn decode(&self, count: usize) -> Result<Texture, ImportError> {
        let most = count.saturating_mul(TEXELS).saturating_add(PADDING);
        let mut texture = self.decode_if(|width, height| {
            let fits = width.checked_mul(height).is_some_and(|texels| (count..=most).contains(&texels));
            fits.then_some(()).ok_or_else(|| format!("does not fit {count} Gaussians"))
        })?;
        texture.texels.truncate(count);
        Ok(texture)
    }

    /// Decodes a texture whose size `fits` accepts.
    ///
    /// # Errors
    /// A size that is not accepted, with the reason given; a picture that is damaged or not lossless WebP.
    pub(super) fn decode_if(&self, fits: impl Fn(usize, usize) -> Result<(), String>) -> Result<Texture, ImportError> {
        let name = &self.name;
        let damaged = |reason: &str| ImportError::damaged(format!("its texture {name} {reason}"));
        let unreadable =
            |error: image_webp::DecodingError| damaged(&format!("is damaged: {error}; copy the file again"));
        let mut decoder = WebPDecoder::new(Cursor::new(&self.bytes[..])).map_err(unreadable)?;
        if decoder.is_animated() || decoder.is_lossy() {
            return Err(damaged(
                "is not a still lossless WebP picture, so its numbers are lost; export the capture again",
            ));
        }
        let (width, height) = decoder.dimensions();
        let (width, height) = (width as usize, height as usize);
        fits(width, height).map_err(|reason| damaged(&format!("of {width} × {height} texels {reason}")))?;
        let too_large = || damaged("is too large");
        let mut texels = vec![[0, 0, 0, u8::MAX]; width.checked_mul(height).ok_or_else(too_large)?];
        if decoder.has_alpha() {
            decoder.read_image(texels.as_flattened_mut()).map_err(unreadable)?;
        } else {
            let mut colors = vec![[0; 3]; texels.len()];
            decoder.read_image(colors.as_flattened_mut()).map_err(unreadable)?;
            for (texel, [red, green, blue]) in texels.iter_mut().zip(colors) {
                *texel = [red, green, blue, u8::MAX];
            }
        }
        Ok(Texture { width, texels })
    }
}

/// Reads textures.
///
/// # Errors
/// As [`Files::read`].
pub(super) fn read<'n>(
    files: &mut Files,
    names: impl IntoIterator<Item = &'n str>,
) -> Result<Vec<Encoded>, ImportError> {
    let names: Vec<&str> = names.into_iter().collect();
    files.announce(names.iter().copied())?;
    names.into_iter().map(|name| Encoded::read(files, name)).collect()
}

/// Decodes the textures of `count` Gaussians, in the order given.
///
/// # Errors
/// As [`Encoded::decode`].
pub(super) fn decode(encoded: &[Encoded], count: usize) -> Result<Vec<Texture>, ImportError> {
    let all: Vec<_> = encoded.par_iter().map(|encoded| encoded.decode(count)).collect();
    // Collected in order, so that the error is that of the first damaged texture.
    all.into_iter().collect()
}

/// Checks that textures of so few bytes may have `count` Gaussians.
///
/// # Errors
/// A count that no textures of this size have.
pub(super) fn check_count<'e>(
    count: u64,
    encoded: impl IntoIterator<Item = &'e Encoded>,
) -> Result<usize, ImportError> {
    let bytes: u64 = encoded.into_iter().map(|encoded| encoded.bytes.len() as u64).sum();
    let damaged = |reason: &str| {
        ImportError::damaged(format!(
            "meta.json states {count} Gaussians, but the textures have only {bytes} bytes; copy the file again{reason}"
        ))
    };
    let taken = Budget::of(bytes).take(count.saturating_mul(GAUSSIAN));
    taken.map_err(|over| damaged(&format!(" (the set of Gaussians {over})")))?;
    usize::try_from(count).ok().filter(|&count| u32::try_from(count).is_ok()).ok_or_else(|| damaged(""))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image_webp::{ColorType, WebPEncoder};

    fn encoded(pixels: &[u8], width: u32, height: u32, color: ColorType) -> Encoded {
        let mut bytes = Vec::new();
        WebPEncoder::new(&mut bytes).encode(pixels, width, height, color).expect("a picture is encoded");
        Encoded { name: "a.webp".to_owned(), bytes }
    }

    #[test]
    fn texels_are_returned_bit_for_bit() {
        let pixels: Vec<u8> = (0..8 * 4 * 4).map(|i| (i * 37 % 256) as u8).collect();
        let texture = encoded(&pixels, 8, 4, ColorType::Rgba8).decode(32).expect("intact");
        assert_eq!(texture.texels.as_flattened(), pixels, "also where alpha is 0");
        let texture = encoded(&pixels[..96], 8, 4, ColorType::Rgb8).decode(32).expect("intact");
        let colors: Vec<u8> = texture.texels.iter().flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
        assert_eq!(colors, pixels[..96], "without alpha");
        assert!(texture.texels.iter().all(|texel| texel[3] == 255), "a picture without alpha is opaque");
    }

    #[test]
    fn a_texture_whose_size_does_not_fit_the_count_is_refused() {
        let texture = encoded(&[7; 64 * 64 * 3], 64, 64, ColorType::Rgb8);
        assert_eq!(texture.decode(4000).map(|texture| texture.texels.len()).ok(), Some(4000), "the rest is padding");
        for count in [4097, 10, 0] {
            let message = texture.decode(count).expect_err("does not fit").to_string();
            assert!(message.contains("a.webp of 64 × 64 texels"), "the message names texture and size: {message}");
        }
    }

    #[test]
    fn a_damaged_texture_is_refused() {
        let mut texture = encoded(&[7; 64 * 64 * 3], 64, 64, ColorType::Rgb8);
        texture.bytes.truncate(30);
        assert!(texture.decode(4096).is_err(), "cut");
        texture.bytes = b"no picture".to_vec();
        assert!(texture.decode(4096).is_err(), "not a picture");
    }

    #[test]
    fn more_gaussians_than_the_bytes_of_textures_can_have_are_refused() {
        let texture = encoded(&[7; 64 * 64 * 3], 64, 64, ColorType::Rgb8);
        assert_eq!(check_count(4096, [&texture]).ok(), Some(4096), "a plausible count");
        for count in [1 << 40, 1 << 20] {
            let message = check_count(count, [&texture]).expect_err("too many").to_string();
            let is_complete = message.contains(&format!("{count} Gaussians")) && message.contains("may take");
            assert!(is_complete, "the message has the count and the limit: {message}");
        }
    }
}
