//! Comparing pictures on disk.
//!
//! In: two pictures, or two folders matched by file stem (8-bit, 16-bit or raw float32). Out: the [`Pairs`] of
//! pictures, and PSNR and SSIM of each ([`Pair::compare`]).

use super::MeasureError;
use super::metrics::{ImageMetrics, MetricSet};
use crate::codec::hidden::is_hidden;
use crate::offline::picture_file;
use crate::offline::work::FileError;
use crate::view::Picture;
use glam::{UVec2, Vec3};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Two pictures to compare.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pair {
    /// Name of the pair: the file stem in folders, else the name of the first file with its extension.
    pub name: String,
    /// The first picture.
    pub a: PathBuf,
    /// The second picture.
    pub b: PathBuf,
}

/// The pictures to compare. Default: none.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Pairs {
    /// The pairs, at least one.
    pub both: Vec<Pair>,
    /// File stems that only the first folder has.
    pub only_a: Vec<String>,
    /// File stems that only the second folder has.
    pub only_b: Vec<String>,
}

impl Pairs {
    /// Pairs two files, or the pictures of two folders by file stem. Raw files (`.f32`) in folders are used only if
    /// `raw_size` (pixels) is given, and then take precedence over other pictures of the same stem.
    ///
    /// # Errors
    /// A file and a folder, a folder that cannot be listed or has one stem twice, no pair at all.
    pub fn of(a: &Path, b: &Path, raw_size: Option<UVec2>) -> Result<Self, MeasureError> {
        match (a.is_dir(), b.is_dir()) {
            (true, true) => Self::of_folders(a, b, raw_size.is_some()),
            (false, false) => {
                let name = a.file_name().unwrap_or_default().to_string_lossy().into_owned();
                Ok(Self { both: vec![Pair { name, a: a.to_owned(), b: b.to_owned() }], ..Self::default() })
            }
            (true, false) => Err(not_a_folder(b)),
            (false, true) => Err(not_a_folder(a)),
        }
    }

    /// Returns whether a raw file is one of the pairs.
    pub fn has_raw(&self) -> bool {
        self.both.iter().any(|pair| is_raw(&pair.a) || is_raw(&pair.b))
    }

    fn of_folders(a: &Path, b: &Path, with_raw: bool) -> Result<Self, MeasureError> {
        let (first, mut second) = (pictures(a, with_raw)?, pictures(b, with_raw)?);
        let mut pairs = Self::default();
        for (stem, path) in first {
            let name = stem.to_string_lossy().into_owned();
            match second.remove(&stem) {
                Some(other) => pairs.both.push(Pair { name, a: path, b: other }),
                None => pairs.only_a.push(name),
            }
        }
        pairs.only_b.extend(second.into_keys().map(|stem| stem.to_string_lossy().into_owned()));
        if pairs.both.is_empty() {
            return Err(MeasureError::NoPairs { a: a.to_owned(), b: b.to_owned() });
        }
        Ok(pairs)
    }
}

fn not_a_folder(path: &Path) -> MeasureError {
    FileError::at(path, "is not a folder, but the other one is").into()
}

/// Returns the pictures of a folder by file stem.
fn pictures(folder: &Path, with_raw: bool) -> Result<BTreeMap<OsString, PathBuf>, FileError> {
    let mut found: BTreeMap<OsString, PathBuf> = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(|error| FileError::at(folder, error))? {
        let path = entry.map_err(|error| FileError::at(folder, error))?.path();
        let raw = is_raw(&path);
        let is_wanted = is_picture(&path) || (raw && with_raw);
        let Some(stem) = path.file_stem().filter(|_| is_wanted && !path.file_name().is_some_and(is_hidden)) else {
            continue;
        };
        match found.get(stem) {
            Some(other) if is_raw(other) == raw => {
                let message = format!("has the same name before the extension as {}", other.display());
                return Err(FileError::at(&path, message));
            }
            Some(_) if !raw => {}
            _ => drop(found.insert(stem.to_owned(), path)),
        }
    }
    Ok(found)
}

impl Pair {
    /// Compares both pictures by PSNR and SSIM. Raw pictures have `raw_size` pixels and are not clamped if both are
    /// raw; all other pictures are clamped to 0..1.
    ///
    /// # Errors
    /// A picture that cannot be read, a raw picture without `raw_size`, pictures of different sizes.
    pub fn compare(&self, raw_size: Option<UVec2>) -> Result<ImageMetrics, MeasureError> {
        let (mut left, mut right) = (load(&self.a, raw_size)?, load(&self.b, raw_size)?);
        if !(is_raw(&self.a) && is_raw(&self.b)) {
            (left, right) = (left.clamped(), right.clamped());
        }
        Ok(ImageMetrics::of(&left, &right, MetricSet::SSIM).map_err(|error| FileError::at(&self.b, error))?)
    }
}

fn load(path: &Path, raw_size: Option<UVec2>) -> Result<Picture, MeasureError> {
    if is_raw(path) {
        return load_raw(path, raw_size);
    }
    let image = picture_file::open(path, UVec2::MAX)?.into_rgb32f();
    let size = UVec2::new(image.width(), image.height());
    Ok(Picture { size, pixels: image.pixels().map(|pixel| Vec3::from(pixel.0)).collect() })
}

fn load_raw(path: &Path, size: Option<UVec2>) -> Result<Picture, MeasureError> {
    let size = size.ok_or_else(|| MeasureError::UnknownSize { path: path.to_owned() })?;
    let expected = u64::from(size.x) * u64::from(size.y) * 12;
    let found = fs::metadata(path).map_err(|error| FileError::at(path, error))?.len();
    if found != expected {
        let message = format!("{found} bytes, but a raw picture of {}x{} has {expected}", size.x, size.y);
        return Err(FileError::at(path, message).into());
    }
    let bytes = fs::read(path).map_err(|error| FileError::at(path, error))?;
    let values: Vec<f32> = bytes.as_chunks().0.iter().map(|&four| f32::from_le_bytes(four)).collect();
    if values.iter().any(|value| !value.is_finite()) {
        return Err(FileError::at(path, "holds a value that is not finite").into());
    }
    Ok(Picture { size, pixels: values.chunks_exact(3).map(Vec3::from_slice).collect() })
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|found| extensions.iter().any(|extension| found.eq_ignore_ascii_case(extension)))
}

fn is_raw(path: &Path) -> bool {
    has_extension(path, &["f32"])
}

fn is_picture(path: &Path) -> bool {
    has_extension(path, &["png", "jpg", "jpeg"])
}
