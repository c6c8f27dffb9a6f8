//! Training views: the cameras, times and images that a capture is trained on and compared with.
//!
//! In: a folder or a single camera file. Out: [`TrainingView`]s in file order, and their images with coverage ([`CoveredImage`]).
//!
//! | form | file | cameras |
//! |---|---|---|
//! | Blender (D-NeRF) | `transforms_{train,test,val}.json` with `camera_angle_x` | FoV cameras |
//! | converted N3V | the same with `fl_x`, `fl_y`, `cx`, `cy`, for the file or per frame | intrinsics cameras |
//! | golden views | `golden*.json`, a list `views` | FoV cameras always |
//!
//! All of them are pinhole cameras: entries that describe a distorted lens are refused by name, since distortion is not undone, and so are
//! golden views whose principal point is not the center, and images of another aspect ratio than the camera.
//!
//! Cameras can be read without any image on disk; [`Dataset::require_images`] reports missing images early.

mod camera_file;
mod error;
mod lens;
mod resample;
pub mod selection;
pub mod validation;
mod view;

use std::path::{Path, PathBuf};

pub use camera_file::{CameraFile, CameraOptions};
pub use error::{DatasetError, FrameProblem};
pub use view::{CoveredImage, TrainingView};

/// The longest side of a picture that is accepted, in pixels.
pub const MAX_SIDE: u32 = 16_384;

/// How many missing images an error names.
const MISSING_LISTED: usize = 4;

/// A subset of the views of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Split {
    /// The views that a capture is trained on.
    Train,
    /// The views that it is evaluated on.
    Test,
    /// D-NeRF's third split; the test set of its `lego` scene.
    Val,
}

impl Split {
    /// Every split.
    pub const ALL: [Self; 3] = [Self::Train, Self::Test, Self::Val];

    /// Returns the name of the split's camera file.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Train => "transforms_train.json",
            Self::Test => "transforms_test.json",
            Self::Val => "transforms_val.json",
        }
    }

    /// Returns the split that the original uses in its place: folders whose name ends in `lego` are evaluated on `val`.
    pub(super) fn resolved(self, folder: &Path) -> Self {
        let lego = folder.file_name().is_some_and(|name| name.as_encoded_bytes().ends_with(b"lego"));
        if self == Self::Test && lego { Self::Val } else { self }
    }
}

/// One split of a dataset folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The folder.
    pub folder: PathBuf,
    /// The split that was read: [`Split::Val`] if the test split of a `lego` folder was requested.
    pub split: Split,
    /// Its views in file order, at least one.
    pub views: Vec<TrainingView>,
}

impl Dataset {
    /// Reads the cameras of one split.
    ///
    /// # Errors
    /// [`DatasetError`] if the split's file is missing or unusable. Missing images are not an error here.
    pub fn open(folder: &Path, split: Split, options: &CameraOptions) -> Result<Self, DatasetError> {
        let split = split.resolved(folder);
        let path = folder.join(split.file_name());
        if !path.is_file() {
            return Err(DatasetError::NotADataset { folder: folder.to_owned(), file: split.file_name() });
        }
        Ok(Self { folder: folder.to_owned(), split, views: CameraFile::load(&path, options)? })
    }

    /// Checks that every image and mask is on disk.
    ///
    /// # Errors
    /// [`DatasetError::MissingImages`], naming the first few and how many.
    pub fn require_images(&self) -> Result<(), DatasetError> {
        require_images(&self.views)
    }
}

/// Checks that every image and mask of these views is on disk.
///
/// # Errors
/// [`DatasetError::MissingImages`], naming the first few and how many.
pub fn require_images(views: &[TrainingView]) -> Result<(), DatasetError> {
    require_files(views.iter().flat_map(|view| [Some(&view.image), view.mask.as_ref()]).flatten())
}

/// Checks that all files exist; the error names the first few that do not.
fn require_files<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Result<(), DatasetError> {
    let (mut first, mut missing, mut total) = (Vec::new(), 0, 0);
    for file in files {
        total += 1;
        if !file.is_file() {
            missing += 1;
            if first.len() < MISSING_LISTED {
                first.push(file.clone());
            }
        }
    }
    if missing == 0 { Ok(()) } else { Err(DatasetError::MissingImages { first, missing, total }) }
}
