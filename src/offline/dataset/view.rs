//! One training view and its image.
//!
//! In: a camera at a time with the path of a PNG or JPEG. Out: float RGB of the camera's size, equal to what the original trains on
//! and evaluates against (section 5.3 of the 4DGS model).

use std::path::{Path, PathBuf};

use glam::{UVec2, Vec3};
use image::{DynamicImage, RgbaImage};

use super::{DatasetError, MAX_SIDE, require_files, resample};
use crate::offline::picture_file;
use crate::view::{Camera, Picture};

/// How many times as wide and as high as the camera file says an image may be: it is scaled to the camera's size, and
/// camera files made for smaller images are used with the originals.
const LARGER: u32 = 4;

/// A camera at one time, and the path of the image taken there.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingView {
    /// Name for output files: the stem of the image path, without folders; unique within its camera file (a repeated stem has the
    /// index of the frame appended, `-17`).
    pub name: String,
    /// The camera, at the size to render.
    pub camera: Camera,
    /// Timestamp, in the capture's unit.
    pub time: f32,
    /// Size of the image as the camera file, or else the first image, says, pixels. An image with a side of more than four
    /// times that is not decoded, and one of another aspect ratio is not used.
    pub original: UVec2,
    /// Path of the image, which may not exist.
    pub image: PathBuf,
    /// Path of the coverage as an 8-bit grey image, which has been multiplied into the image already; `None` if the
    /// view has none.
    pub mask: Option<PathBuf>,
}

/// Which of the original's two ways of loading images is reproduced. Default: [`InMemory`](Self::InMemory).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum ImageMode {
    /// Its in-memory mode, used for D-NeRF: transparent images keep alpha through resampling and are multiplied by it once more.
    #[default]
    InMemory,
    /// Its `dataloader` mode, used for N3V: composited once, no alpha.
    Dataloader,
}

/// The image of a training view, at its camera's size.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingImage {
    /// RGB, 0 to 1.
    pub picture: Picture,
    /// Coverage per pixel, 0 to 1: the mask if the view has one, else the image's own alpha ([`ImageMode::InMemory`]
    /// only). `None` if everything is covered.
    pub alpha: Option<Vec<f32>>,
}

/// The image of a training view and what it covers, at its camera's size.
#[derive(Debug, Clone, PartialEq)]
pub struct CoveredImage {
    /// Size, pixels.
    pub size: UVec2,
    /// RGB times coverage, and coverage: one byte each.
    pub texels: Vec<[u8; 4]>,
    /// Whether a pixel is not covered.
    pub has_gaps: bool,
}

impl CoveredImage {
    /// Returns the image over a background (RGB, 0 to 1).
    pub fn over(&self, background: Vec3) -> Picture {
        let over = |texel: &[u8; 4]| unit_rgb(texel) + (1.0 - unit(texel[3])) * background;
        Picture { size: self.size, pixels: self.texels.iter().map(over).collect() }
    }
}

impl TrainingView {
    /// Loads the image over black, as the original's `dataloader` mode does, and its coverage: the mask if the view has one, else the image's
    /// own alpha.
    ///
    /// # Errors
    /// As [`load_image`](Self::load_image).
    pub fn load_covered(&self) -> Result<CoveredImage, DatasetError> {
        let size = self.camera.size;
        if size.min_element() == 0 || size.max_element() > MAX_SIDE {
            return Err(DatasetError::Size { size });
        }
        require_files([Some(&self.image), self.mask.as_ref()].into_iter().flatten())?;
        let image = self.decode(&self.image)?.into_rgba8();
        let from = UVec2::new(image.width(), image.height());
        let colors = resample::resize(composited(&image, [0.0; 3], false), 3, from, size);
        let coverage = match &self.mask {
            Some(mask) => {
                let mask = self.decode(mask)?.into_luma8();
                let from = UVec2::new(mask.width(), mask.height());
                resample::resize(mask.into_raw(), 1, from, size)
            }
            None => resample::resize(image.pixels().map(|pixel| pixel.0[3]).collect(), 1, from, size),
        };
        let texels =
            colors.chunks_exact(3).zip(coverage).map(|(color, covered)| [color[0], color[1], color[2], covered]);
        let texels: Vec<[u8; 4]> = texels.collect();
        let has_gaps = texels.iter().any(|texel| texel[3] < u8::MAX);
        Ok(CoveredImage { size, texels, has_gaps })
    }

    /// Loads the image as the original does: composited over `background` (RGB, 0 to 1), truncated to 8 bits, resampled
    /// to the camera's size (Pillow's bicubic), and multiplied by alpha again if `mode` is [`ImageMode::InMemory`]. A
    /// mask is only returned as coverage: the image has been multiplied by it already.
    ///
    /// # Errors
    /// [`DatasetError::MissingImages`] if the image or the mask is not on disk, [`DatasetError::Image`] if one cannot
    /// be decoded, is not whole or is far larger than [`original`](Self::original), [`DatasetError::Aspect`] if one has
    /// another aspect ratio than that, [`DatasetError::Size`] if the size of the camera is out of range.
    pub fn load_image(&self, background: [f32; 3], mode: ImageMode) -> Result<TrainingImage, DatasetError> {
        let size = self.camera.size;
        if size.min_element() == 0 || size.max_element() > MAX_SIDE {
            return Err(DatasetError::Size { size });
        }
        require_files([Some(&self.image), self.mask.as_ref()].into_iter().flatten())?;
        let mut image = resampled(&self.decode(&self.image)?.into_rgba8(), background, mode, size);
        if let Some(mask) = &self.mask {
            let mask = self.decode(mask)?.into_luma8();
            let from = UVec2::new(mask.width(), mask.height());
            image.alpha = Some(resample::resize(mask.into_raw(), 1, from, size).into_iter().map(unit).collect());
        }
        Ok(image)
    }

    /// Decodes the image or the mask.
    fn decode(&self, path: &Path) -> Result<DynamicImage, DatasetError> {
        let largest = self.original.saturating_mul(UVec2::splat(LARGER)).min(UVec2::splat(MAX_SIDE));
        let image = picture_file::open(path, largest)?;
        let (size, expected) = (UVec2::new(image.width(), image.height()), self.original);
        if has_aspect_of(size, expected) {
            Ok(image)
        } else {
            Err(DatasetError::Aspect { path: path.to_owned(), size, expected })
        }
    }
}

/// Returns whether one of two sizes, scaled to the width or the height of the other, differs from it by at most one pixel: a scaled
/// picture has rounded sides.
fn has_aspect_of(a: UVec2, b: UVec2) -> bool {
    let [ax, ay, bx, by] = [a.x, a.y, b.x, b.y].map(u64::from);
    // Scaled to the width of a, the height of b differs by |ax · by − ay · bx| / bx; the other three are alike.
    (ax * by).abs_diff(ay * bx) <= ax.max(ay).max(bx).max(by)
}

fn resampled(image: &RgbaImage, background: [f32; 3], mode: ImageMode, size: UVec2) -> TrainingImage {
    let from = UVec2::new(image.width(), image.height());
    let transparent = mode == ImageMode::InMemory && image.pixels().any(|pixel| pixel.0[3] < u8::MAX);
    let bytes = composited(image, background, transparent);
    if !transparent {
        let pixels = resample::resize(bytes, 3, from, size).chunks_exact(3).map(unit_rgb).collect();
        return TrainingImage { picture: Picture { size, pixels }, alpha: None };
    }
    let bytes = resample::resize_rgba(bytes, from, size);
    let alpha: Vec<f32> = bytes.chunks_exact(4).map(|pixel| unit(pixel[3])).collect();
    let pixels = bytes.chunks_exact(4).zip(&alpha).map(|(pixel, &alpha)| unit_rgb(pixel) * alpha).collect();
    TrainingImage { picture: Picture { size, pixels }, alpha: Some(alpha) }
}

/// Composites RGB over the background in double precision, times 255, truncated; with `keep_alpha`, alpha follows each
/// pixel.
fn composited(image: &RgbaImage, background: [f32; 3], keep_alpha: bool) -> Vec<u8> {
    let channels = if keep_alpha { 4 } else { 3 };
    let mut bytes = Vec::with_capacity(image.pixels().len() * channels);
    for pixel in image.pixels() {
        let [color @ .., alpha] = pixel.0;
        let covered = f64::from(alpha) / 255.0;
        for (value, background) in color.into_iter().zip(background) {
            let over = f64::from(value) / 255.0 * covered + f64::from(background) * (1.0 - covered);
            bytes.push((over * 255.0) as u8);
        }
        if keep_alpha {
            bytes.push(alpha);
        }
    }
    bytes
}

fn unit(byte: u8) -> f32 {
    f32::from(byte) / 255.0
}

/// Returns the first three bytes as RGB, 0 to 1.
fn unit_rgb(bytes: &[u8]) -> Vec3 {
    Vec3::new(unit(bytes[0]), unit(bytes[1]), unit(bytes[2]))
}
