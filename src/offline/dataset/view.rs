//! One training view and its image.
//!
//! In: a camera at a time with the path of a picture. Out: a [`CoveredImage`] of the size of the camera, which can be
//! laid over any background. Over black it equals the image that the `dataloader` mode of the original evaluates
//! against (section 5.3 of the 4DGS model). The in-memory mode of the original multiplies transparent images by alpha
//! twice and is not reproduced.

use std::path::{Path, PathBuf};

use glam::{UVec2, Vec3};
use image::{DynamicImage, GrayImage, RgbaImage};

use super::cameras::distortion::Undistortion;
use super::cameras::resample;
use super::formats::files::require_files;
use super::formats::video;
use super::{DatasetError, MAX_SIDE};
use crate::offline::picture_file;
use crate::view::{Camera, Picture};

/// Largest ratio of the width and of the height of an image to the size in the camera file. Larger images are accepted
/// because camera files made for reduced images are used with the original images; the image is scaled to the size of
/// the camera.
const LARGER: u32 = 4;

/// A camera at one time, and the path of the image taken there.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingView {
    /// Name for output files: the stem of the image path, without folders; unique within its camera file (a repeated
    /// stem has the index of the frame appended, `-17`).
    pub name: String,
    /// The camera, at the size to render.
    pub camera: Camera,
    /// Timestamp, in the capture's unit.
    pub time: f32,
    /// Size of the image according to the camera file, or else to the first image, pixels. An image with a side of more
    /// than four times this length is not decoded, and an image of another aspect ratio is refused.
    pub original: UVec2,
    /// Path of the image, which may not exist.
    pub image: PathBuf,
    /// Path of the coverage as an 8-bit gray image, by which the image has been multiplied already unless the
    /// [`correction`](Self::correction) does that; `None` if the view has none.
    pub mask: Option<PathBuf>,
    /// Changes of the image when it is loaded.
    pub correction: Correction,
}

/// Changes of an image when it is loaded: the distortion of its lens is undone, and it is multiplied by its mask.
/// Default: nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Correction {
    pub(super) undistortion: Option<Undistortion>,
    pub(super) masks: bool,
}

/// The image of a training view before it is resized: colors times alpha, and coverage. Its distortion is undone.
#[derive(Debug, Clone)]
struct Whole {
    colors: Channels<3>,
    coverage: Channels<1>,
}

/// Interleaved bytes of so many channels.
#[derive(Debug, Clone)]
struct Channels<const N: usize> {
    bytes: Vec<u8>,
    size: UVec2,
}

/// The image of a training view and its coverage, at its camera's size.
#[derive(Debug, Clone, PartialEq)]
pub struct CoveredImage {
    /// Size, pixels.
    pub size: UVec2,
    /// RGB times coverage, and coverage: one byte each.
    pub texels: Vec<[u8; 4]>,
    /// Whether a pixel is not fully covered.
    pub has_gaps: bool,
}

impl CoveredImage {
    /// Returns the image over a background (RGB, 0 to 1). Values are at most 1, also where compression has made an
    /// image brighter than its mask.
    pub fn over(&self, background: Vec3) -> Picture {
        let over = |texel: &[u8; 4]| (unit_rgb(texel) + (1.0 - unit(texel[3])) * background).min(Vec3::ONE);
        Picture { size: self.size, pixels: self.texels.iter().map(over).collect() }
    }
}

impl TrainingView {
    /// Loads the image and its coverage. A view with a mask has the mask as coverage, and its image has been multiplied
    /// by the mask already, unless the correction multiplies the image's alpha by the mask. Without a mask the coverage
    /// is the alpha of the image, which is 1 everywhere if the image has none. Colors times alpha are truncated to 8
    /// bits, distortion is undone, and the result is resampled to the size of the camera (the bicubic filter of
    /// Pillow), as in the `dataloader` mode of the original over black.
    ///
    /// # Errors
    /// [`DatasetError::MissingImages`] if the image or the mask is not on disk, [`DatasetError::Image`] if one cannot
    /// be decoded, is truncated or is far larger than [`original`](Self::original), or [`DatasetError::Decoded`] if it
    /// is a frame that was decoded from a video, [`DatasetError::Size`] if the size of the camera is out of range.
    pub fn load_covered(&self) -> Result<CoveredImage, DatasetError> {
        let size = self.camera.size;
        check_size(size)?;
        Ok(self.load_whole()?.resized(size))
    }

    /// Loads the image and its coverage at each of these sizes, pixels, and decodes it once: each is what
    /// [`load_covered`](Self::load_covered) returns for a camera of that size.
    ///
    /// # Errors
    /// Those of [`load_covered`](Self::load_covered).
    pub(crate) fn load_sizes(&self, sizes: &[UVec2]) -> Result<Vec<CoveredImage>, DatasetError> {
        sizes.iter().try_for_each(|&size| check_size(size))?;
        let whole = self.load_whole()?;
        Ok(sizes.iter().map(|&size| whole.clone().resized(size)).collect())
    }

    /// Loads the image and its coverage, and undoes the distortion.
    fn load_whole(&self) -> Result<Whole, DatasetError> {
        require_files([Some(&self.image), self.mask.as_ref()].into_iter().flatten())?;
        let mut image = self.decode(&self.image)?.into_rgba8();
        let from = UVec2::new(image.width(), image.height());
        let mut mask = self.mask.as_ref().map(|mask| self.decode(mask).map(DynamicImage::into_luma8)).transpose()?;
        if self.correction.masks
            && let Some(mask) = mask.take()
        {
            multiply_alpha(&mut image, &mask);
        }
        let colors = self.undistorted(premultiplied(&image), from);
        let coverage = match mask {
            Some(mask) => {
                let from = UVec2::new(mask.width(), mask.height());
                self.undistorted(mask.into_raw(), from)
            }
            None => self.undistorted(image.pixels().map(|pixel| pixel.0[3]).collect(), from),
        };
        Ok(Whole { colors, coverage })
    }

    /// Undoes the distortion.
    fn undistorted<const N: usize>(&self, bytes: Vec<u8>, size: UVec2) -> Channels<N> {
        let bytes = match &self.correction.undistortion {
            Some(undistortion) => undistortion.undistort(&bytes, N, size),
            None => bytes,
        };
        Channels { bytes, size }
    }

    /// Decodes the image or the mask.
    fn decode(&self, path: &Path) -> Result<DynamicImage, DatasetError> {
        let largest = self.original.saturating_mul(UVec2::splat(LARGER)).min(UVec2::splat(MAX_SIDE));
        let image = picture_file::open(path, largest).map_err(|reason| match video::decoded_into(path) {
            Some(folder) => DatasetError::Decoded { reason: Box::new(reason), folder: folder.to_owned() },
            None => reason.into(),
        })?;
        let (size, expected) = (UVec2::new(image.width(), image.height()), self.original);
        if has_aspect_of(size, expected) {
            Ok(image)
        } else {
            Err(DatasetError::Aspect { path: path.to_owned(), size, expected })
        }
    }
}

impl Whole {
    /// Resizes the image.
    fn resized(self, size: UVec2) -> CoveredImage {
        let (colors, coverage) = (self.colors.resized(size), self.coverage.resized(size));
        let texels =
            colors.chunks_exact(3).zip(coverage).map(|(color, covered)| [color[0], color[1], color[2], covered]);
        let texels: Vec<[u8; 4]> = texels.collect();
        let has_gaps = texels.iter().any(|texel| texel[3] < u8::MAX);
        CoveredImage { size, texels, has_gaps }
    }
}

impl<const N: usize> Channels<N> {
    fn resized(self, size: UVec2) -> Vec<u8> {
        resample::resize(self.bytes, N, self.size, size)
    }
}

/// Checks that pictures may have this size.
fn check_size(size: UVec2) -> Result<(), DatasetError> {
    if size.min_element() == 0 || size.max_element() > MAX_SIDE { Err(DatasetError::Size { size }) } else { Ok(()) }
}

/// Returns whether one of two sizes, scaled to the width or the height of the other, differs from it by at most one
/// pixel: a scaled picture has rounded sides.
pub(super) fn has_aspect_of(a: UVec2, b: UVec2) -> bool {
    let [ax, ay, bx, by] = [a.x, a.y, b.x, b.y].map(u64::from);
    // Scaled to the width of a, the height of b differs by |ax · by − ay · bx| / bx; the other three cases follow by
    // exchange.
    (ax * by).abs_diff(ay * bx) <= ax.max(ay).max(bx).max(by)
}

/// Multiplies alpha by a mask, which is sampled at the nearest pixel if it has another size.
fn multiply_alpha(image: &mut RgbaImage, mask: &GrayImage) {
    let (from, to) = ([image.width(), image.height()].map(u64::from), [mask.width(), mask.height()].map(u64::from));
    for (x, y, pixel) in image.enumerate_pixels_mut() {
        let near = |at: u32, axis: usize| ((2 * u64::from(at) + 1) * to[axis] / (2 * from[axis])) as u32;
        let covered = u32::from(mask.get_pixel(near(x, 0), near(y, 1)).0[0]);
        pixel.0[3] = ((u32::from(pixel.0[3]) * covered + 127) / 255) as u8;
    }
}

/// Multiplies RGB by alpha in double precision, and truncates to 8 bits.
fn premultiplied(image: &RgbaImage) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(image.pixels().len() * 3);
    for pixel in image.pixels() {
        let [color @ .., alpha] = pixel.0;
        let covered = f64::from(alpha) / 255.0;
        bytes.extend(color.map(|value| (f64::from(value) / 255.0 * covered * 255.0) as u8));
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
