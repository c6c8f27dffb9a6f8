//! Pictures on disk: the only place where PNG, JPEG and EXR files are decoded.
//!
//! In: a path, and the largest size that the picture may have. Out: the picture, or a [`PictureError`] that names the
//! file, the reason and the remedy.
//!
//! The size is compared before decoding, with the expected one and with the `Budget` of the file, so that a small
//! file cannot take much time and memory. Of a PNG the decoder gets only the chunks that change pixels (`png`); of an
//! EXR all channels count (`exr_size`). A JPEG must be complete, which its decoder does not check (`jpeg`).

mod exr;
mod exr_size;
mod huffman;
mod jpeg;
mod png;

use crate::codec::budget::Budget;
use glam::UVec2;
use image::error::DecodingError;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};

/// Most pixels of a picture that is decoded, for any expected size.
const MAX_PIXELS: u64 = 1 << 27;

/// Most bytes of a file that is read.
const MAX_BYTES: u64 = 1 << 30;

/// The reason why a picture was not decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {reason}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// The file is not a picture, or it is damaged.
    #[error("{}: not a readable PNG, JPEG or EXR image: {}", .path.display(), .reason.to_string().trim_end())]
    Format {
        /// The file.
        path: PathBuf,
        /// The error of the decoder.
        reason: ImageError,
    },
    /// The file ends before the picture does.
    #[error("{}: not a whole JPEG image: {reason}", .path.display())]
    Incomplete {
        /// The file.
        path: PathBuf,
        /// The missing data, and the remedy.
        reason: &'static str,
    },
    /// The picture is larger than expected.
    #[error(
        "{}: {} x {} pixels, and at most {} x {} are expected here: scale it, or correct the size in the camera file",
        .path.display(), .size.x, .size.y, .largest.x, .largest.y
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Width and height of the picture, pixels.
        size: UVec2,
        /// The largest width and height accepted.
        largest: UVec2,
    },
    /// The picture would take more memory than a picture of so few bytes may take.
    #[error(
        "{}: the picture, {} x {} pixels, {reason}: scale it, or save it uncompressed",
        .path.display(), .size.x, .size.y
    )]
    TooMuch {
        /// The file.
        path: PathBuf,
        /// Width and height of the picture, pixels.
        size: UVec2,
        /// The memory it takes, and the limit.
        reason: String,
    },
    /// The picture, or its file, is larger than the limit for all pictures.
    #[error(
        "{}: a picture of more than {MAX_PIXELS} pixels or {MAX_BYTES} bytes is not decoded: scale it",
        .path.display()
    )]
    FarTooLarge {
        /// The file.
        path: PathBuf,
    },
}

/// Returns width and height of a picture, pixels, from its header.
///
/// # Errors
/// A file that cannot be read or is not a picture, a picture whose width or height is larger than that of `largest`.
pub fn size(path: &Path, largest: UVec2) -> Result<UVec2, PictureError> {
    let (bytes, _) = read(path)?;
    checked_size(path, &decoder(path, reader(path, &bytes)?)?, largest)
}

/// Returns whether a picture has a channel of transparency, from its header.
///
/// # Errors
/// A file that cannot be read or is not a picture.
pub fn has_alpha(path: &Path) -> Result<bool, PictureError> {
    let (bytes, _) = read(path)?;
    Ok(decoder(path, reader(path, &bytes)?)?.color_type().has_alpha())
}

/// Decodes a picture. Linear light (EXR) becomes sRGB-encoded colors. The contents of the file determine its format,
/// not its name.
///
/// # Errors
/// As [`size`], and a picture that is damaged or not complete.
pub fn open(path: &Path, largest: UVec2) -> Result<DynamicImage, PictureError> {
    let failed = |reason| unreadable(path, reason);
    let (bytes, length) = read(path)?;
    let reader = reader(path, &bytes)?;
    let format = reader.format();
    let decoder = decoder(path, reader)?;
    let size = checked_size(path, &decoder, largest)?;
    if format == Some(ImageFormat::Jpeg) {
        jpeg::check(&bytes).map_err(|reason| PictureError::Incomplete { path: path.to_owned(), reason })?;
    }
    if format == Some(ImageFormat::Png) && !png::has_whole_palette(&bytes) {
        let error = DecodingError::new(ImageFormat::Png.into(), "its palette has an incomplete color");
        return Err(failed(ImageError::Decoding(error)));
    }
    let channels = if format == Some(ImageFormat::OpenExr) { exr_size::unpacked(&bytes) } else { 0 };
    let taken = Budget::of(length).take(decoder.total_bytes().max(channels));
    taken.map_err(|over| PictureError::TooMuch { path: path.to_owned(), size, reason: over.to_string() })?;
    Limits::default().reserve(decoder.total_bytes()).map_err(failed)?;
    let image = DynamicImage::from_decoder(decoder).map_err(failed)?;
    Ok(if format == Some(ImageFormat::OpenExr) { exr::displayed(image) } else { image })
}

/// Reads a file of limited length. Returns the bytes that the decoder needs, and the length of the file.
fn read(path: &Path) -> Result<(Vec<u8>, u64), PictureError> {
    let mut bytes = Vec::new();
    let file = File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes));
    let length = bytes.len() as u64;
    match file {
        Ok(_) if length > MAX_BYTES => Err(PictureError::FarTooLarge { path: path.to_owned() }),
        Ok(_) => {
            png::remove_others(&mut bytes);
            Ok((bytes, length))
        }
        Err(reason) => Err(PictureError::Read { path: path.to_owned(), reason }),
    }
}

fn reader<'a>(path: &Path, bytes: &'a [u8]) -> Result<ImageReader<Cursor<&'a [u8]>>, PictureError> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    reader.map_err(|reason| PictureError::Read { path: path.to_owned(), reason })
}

fn decoder<'a>(path: &Path, reader: ImageReader<Cursor<&'a [u8]>>) -> Result<impl ImageDecoder + 'a, PictureError> {
    reader.into_decoder().map_err(|reason| unreadable(path, reason))
}

fn unreadable(path: &Path, reason: ImageError) -> PictureError {
    PictureError::Format { path: path.to_owned(), reason: exr::in_words(reason) }
}

fn checked_size(path: &Path, decoder: &impl ImageDecoder, largest: UVec2) -> Result<UVec2, PictureError> {
    let size = UVec2::from(decoder.dimensions());
    if size.cmpgt(largest).any() {
        return Err(PictureError::TooLarge { path: path.to_owned(), size, largest });
    }
    if u64::from(size.x) * u64::from(size.y) > MAX_PIXELS {
        return Err(PictureError::FarTooLarge { path: path.to_owned() });
    }
    Ok(size)
}
