//! One split of a dataset folder.
//!
//! In: a folder and a split. Out: the [`TrainingView`]s of the split in file order; an error if images are missing.

use super::camera_file::{CameraFile, CameraOptions};
use super::error::DatasetError;
use super::files::require_files;
use super::split::Split;
use super::view::TrainingView;
use std::path::{Path, PathBuf};

/// One split of a dataset folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The folder.
    pub folder: PathBuf,
    /// The split that was read: [`Split::Val`] if the test split of a `lego` folder was requested.
    pub split: Split,
    /// The views of the split in file order, at least one.
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
    /// [`DatasetError::MissingImages`], which names the first few missing files and their number.
    pub fn require_images(&self) -> Result<(), DatasetError> {
        require_images(&self.views)
    }
}

/// Checks that every image and mask of these views is on disk.
///
/// # Errors
/// [`DatasetError::MissingImages`], which names the first few missing files and their number.
pub(crate) fn require_images(views: &[TrainingView]) -> Result<(), DatasetError> {
    require_files(views.iter().flat_map(|view| [Some(&view.image), view.mask.as_ref()]).flatten())
}
