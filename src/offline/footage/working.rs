//! The pictures that footage is worked with: smaller than those that were filmed, and decoded at full size once.
//!
//! In: a folder, the key of the images, the views with the sizes at which their pictures are wanted. Out:
//! [`WorkingPictures`], which returns the picture of a view: the stored one, or else that of the image, which is then
//! stored at all of its sizes. Both are the same to the bit. The folder is removed when nobody needs it any more.

use crate::offline::dataset::{CoveredImage, DatasetError, TrainingView};
use crate::offline::picture_file;
use crate::offline::store::results::Key;
use crate::offline::work::{FileError, temporary_file};
use glam::UVec2;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, Rgb, RgbImage};
use std::collections::HashMap;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Reduced pictures, in a folder.
#[derive(Debug)]
pub(crate) struct WorkingPictures {
    folder: PathBuf,
    /// The key of the contents of all images.
    key: Key,
    /// The sizes at which the picture of an image is stored, pixels, without repetitions.
    sizes: HashMap<PathBuf, Vec<UVec2>>,
}

impl WorkingPictures {
    /// Pictures in a folder, which need not exist. `key` is that of all images: pictures that were stored with another
    /// key are not used. `wanted` are the views whose pictures are stored, with sizes, pixels, of which those that are
    /// smaller than the image are stored.
    pub(crate) fn new<'a, const N: usize>(
        folder: PathBuf,
        key: Key,
        wanted: impl Iterator<Item = (&'a TrainingView, [UVec2; N])>,
    ) -> Self {
        let mut sizes: HashMap<PathBuf, Vec<UVec2>> = HashMap::new();
        for (view, all) in wanted {
            let stored = sizes.entry(view.image.clone()).or_default();
            for size in all {
                if size.max_element() < view.original.max_element() && !stored.contains(&size) {
                    stored.push(size);
                }
            }
        }
        Self { folder, key, sizes }
    }

    /// Returns the picture of a view: undistorted, over black, at the size of the camera. Reads the stored one, or
    /// decodes the image and stores its picture at all of its sizes. A picture that cannot be stored is decoded again
    /// the next time.
    ///
    /// # Errors
    /// Those of [`TrainingView::load_covered`].
    pub(crate) fn picture(&self, view: &TrainingView) -> Result<RgbImage, DatasetError> {
        let size = view.camera.size;
        let sizes = self.sizes.get(&view.image).map(Vec::as_slice).unwrap_or_default();
        let Some(asked) = sizes.iter().position(|stored| *stored == size) else {
            return Ok(over_black(&view.load_covered()?));
        };
        if let Some(picture) = stored(&self.path(view, size), size) {
            return Ok(picture);
        }
        let mut pictures: Vec<RgbImage> = view.load_sizes(sizes)?.iter().map(over_black).collect();
        for (size, picture) in sizes.iter().zip(&pictures) {
            let _ = self.store(self.path(view, *size), picture);
        }
        Ok(pictures.swap_remove(asked))
    }

    /// Removes the stored pictures.
    ///
    /// # Errors
    /// A folder that cannot be removed.
    pub(crate) fn remove(self) -> Result<(), FileError> {
        match fs::remove_dir_all(&self.folder) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(FileError::at(&self.folder, error)),
            _ => Ok(()),
        }
    }

    /// Returns the path of the picture of a view at a size. It depends on everything that the picture does.
    fn path(&self, view: &TrainingView, size: UVec2) -> PathBuf {
        let TrainingView { original, image, mask, correction, .. } = view;
        let key = self.key.and(&format!("{image:?} {mask:?} {original} {correction:?} {size}"));
        self.folder.join(format!("{key}.png"))
    }

    /// Stores a picture, whole or not at all; `None` if that fails. It is not forced to the disk: what a loss of power
    /// damages is decoded again.
    fn store(&self, path: PathBuf, picture: &RgbImage) -> Option<()> {
        let mut bytes = Vec::new();
        let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive);
        picture.write_with_encoder(encoder).ok()?;
        fs::create_dir_all(&self.folder).ok()?;
        let mut part = temporary_file::create(path.clone()).ok()?;
        part.file.write_all(&bytes).ok()?;
        temporary_file::replace(vec![(part, path)]).ok()
    }
}

/// Reads a stored picture; `None` if it is not there or damaged.
fn stored(path: &Path, size: UVec2) -> Option<RgbImage> {
    match picture_file::open(path, size) {
        Ok(DynamicImage::ImageRgb8(picture)) if UVec2::from(picture.dimensions()) == size => Some(picture),
        _ => None,
    }
}

/// Returns an image over black.
fn over_black(covered: &CoveredImage) -> RgbImage {
    let mut picture = RgbImage::new(covered.size.x, covered.size.y);
    for (pixel, &[red, green, blue, _]) in picture.pixels_mut().zip(&covered.texels) {
        *pixel = Rgb([red, green, blue]);
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Camera;
    use glam::Vec3;
    use image::{Rgba, RgbaImage};
    use std::iter::empty;
    use tempfile::TempDir;

    const SIZE: UVec2 = UVec2::new(90, 60);
    const WANTED: [UVec2; 2] = [UVec2::new(45, 30), UVec2::new(20, 13)];

    /// Writes an image with gaps. Returns its view, and the folder for its pictures in a temporary one.
    fn image() -> (TempDir, TrainingView, PathBuf) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let image = folder.path().join("image.png");
        let noise = |x: u32, y: u32| ((x * 7919 + y * 104_729).wrapping_mul(2_654_435_761) >> 16).to_le_bytes();
        let pixel = |x: u32, y: u32| Rgba([noise(x, y)[0], x as u8, noise(x, y)[1], 255 - y as u8]);
        RgbaImage::from_fn(SIZE.x, SIZE.y, pixel).save(&image).expect("the folder can be written to");
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, SIZE);
        let (name, correction) = ("image".to_owned(), Default::default());
        let view = TrainingView { name, camera, time: 0.0, original: SIZE, image, mask: None, correction };
        let pictures = folder.path().join("pictures");
        (folder, view, pictures)
    }

    /// Returns the view at another size.
    fn at(view: &TrainingView, size: UVec2) -> TrainingView {
        TrainingView { camera: Camera { size, ..view.camera }, ..view.clone() }
    }

    /// Returns the picture of the image, which is not stored.
    fn decoded(view: &TrainingView, size: UVec2) -> RgbImage {
        let none = WorkingPictures::new(PathBuf::new(), Key::of(b""), empty::<(&TrainingView, [UVec2; 0])>());
        none.picture(&at(view, size)).expect("the image can be read")
    }

    #[test]
    fn an_image_is_decoded_once_and_its_pictures_are_the_same_to_the_bit() {
        let (_folder, view, pictures) = image();
        let expected = WANTED.map(|size| decoded(&view, size));
        let wanted = || [(&view, WANTED)].into_iter();
        let working = WorkingPictures::new(pictures.clone(), Key::of(b"images"), wanted());
        let first = working.picture(&at(&view, WANTED[1])).expect("the image can be read");
        assert_eq!(first, expected[1], "the picture that is stored");
        fs::remove_file(&view.image).expect("the image is there");
        let found = WANTED.map(|size| working.picture(&at(&view, size)).expect("it is stored"));
        assert_eq!(found, expected, "the stored pictures of both sizes");
        let other = WorkingPictures::new(pictures.clone(), Key::of(b"other images"), wanted());
        assert!(other.picture(&at(&view, WANTED[0])).is_err(), "images that have changed are decoded");
        let masked = TrainingView { mask: Some("mask.png".into()), ..at(&view, WANTED[0]) };
        assert!(working.picture(&masked).is_err(), "a view with a mask has another picture");
        working.remove().expect("the folder can be removed");
        assert!(!pictures.exists(), "nothing is left");
        other.remove().expect("there is no folder");
    }

    #[test]
    fn damaged_pictures_are_decoded_again() {
        let (_folder, view, pictures) = image();
        let working = WorkingPictures::new(pictures.clone(), Key::of(b"images"), [(&view, WANTED)].into_iter());
        let read = || working.picture(&at(&view, WANTED[0])).expect("the image can be read");
        let expected = read();
        let paths: Vec<PathBuf> =
            fs::read_dir(&pictures).expect("the folder").flatten().map(|entry| entry.path()).collect();
        assert_eq!(paths.len(), 2, "a file for each size, and no temporary one");
        for path in &paths {
            let bytes = fs::read(path).expect("the picture is there");
            fs::write(path, &bytes[..bytes.len() / 2]).expect("the folder can be written to");
        }
        assert_eq!(read(), expected, "the picture of the image");
        fs::remove_file(&view.image).expect("the image is there");
        assert_eq!(read(), expected, "it is stored again");
    }

    #[test]
    fn pictures_that_are_not_reduced_are_read_from_the_image() {
        let (_folder, view, pictures) = image();
        let working = WorkingPictures::new(pictures.clone(), Key::of(b"images"), [(&view, [SIZE; 2])].into_iter());
        let found = working.picture(&view).expect("the image can be read");
        assert_eq!(found, decoded(&view, SIZE), "the picture of the image");
        assert!(!pictures.exists(), "nothing is stored");
    }

    #[test]
    fn work_goes_on_where_nothing_can_be_stored() {
        let (_folder, view, pictures) = image();
        fs::write(&pictures, b"no folder").expect("the folder can be written to");
        let working = WorkingPictures::new(pictures, Key::of(b"images"), [(&view, WANTED)].into_iter());
        let found = working.picture(&at(&view, WANTED[0])).expect("the image can be read");
        assert_eq!(found, decoded(&view, WANTED[0]), "the picture of the image");
    }
}
