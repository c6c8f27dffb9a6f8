//! One split of a dataset folder.
//!
//! In: a folder and a split. Out: the [`TrainingView`]s of the split in file order; an error if images are missing.

use super::camera_file::CameraFile;
use super::camera_options::{CameraOptions, check_size};
use super::clock::Clock;
use super::division::divide;
use super::error::DatasetError;
use super::files::require_files;
use super::format::{self, Format, Reader};
use super::point_cloud::BESIDE;
use super::split::Split;
use super::video::Videos;
use super::view::TrainingView;
use crate::offline::{NoProgress, Progress};
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
    /// File of points to begin training with, if the dataset names or has one. It may not exist.
    pub points: Option<PathBuf>,
    /// What the times of the views mean.
    pub(crate) clock: Clock,
}

impl Dataset {
    /// Reads the cameras of one split of a folder of any format. The frames of videos are decoded once, by the program `ffmpeg`.
    ///
    /// # Errors
    /// [`DatasetError`] if the folder has no such split, or its files are unusable. Missing images are not an error here.
    pub fn open(folder: &Path, split: Split, options: &CameraOptions) -> Result<Self, DatasetError> {
        Self::open_telling(folder, split, options, &mut NoProgress)
    }

    /// Reads as [`open`](Self::open). Begins the task "decoding" for each video that is decoded.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub(crate) fn open_telling(
        folder: &Path,
        split: Split,
        options: &CameraOptions,
        progress: &mut dyn Progress,
    ) -> Result<Self, DatasetError> {
        Self::open_as(folder, split, options, Videos::Decode(progress))
    }

    /// Reads as [`open`](Self::open), but decodes no video: a video is the image of the only view of its camera.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub(crate) fn look(folder: &Path, split: Split, options: &CameraOptions) -> Result<Self, DatasetError> {
        Self::open_as(folder, split, options, Videos::Leave)
    }

    fn open_as(folder: &Path, split: Split, options: &CameraOptions, videos: Videos<'_>) -> Result<Self, DatasetError> {
        options.size.map_or(Ok(()), check_size)?;
        let Format { reader, .. } = format::of(folder).ok_or_else(|| not_a_dataset(folder, split))?;
        match reader {
            Reader::Splits => Self::open_split(folder, split, options),
            Reader::Whole(read) => {
                let all = read(folder, options, videos)?;
                let points = all.points.clone();
                let clock = all.clock;
                Ok(Self { folder: folder.to_owned(), split, views: divide(split, options, all)?, points, clock })
            }
        }
    }

    /// Reads one split from its own camera file.
    fn open_split(folder: &Path, split: Split, options: &CameraOptions) -> Result<Self, DatasetError> {
        let split = split.resolved(folder);
        let path = folder.join(split.file_name());
        if !path.is_file() {
            return Err(DatasetError::NoSplit { folder: folder.to_owned(), file: split.file_name() });
        }
        let points = Some(folder.join(BESIDE)).filter(|points| points.is_file());
        let file = CameraFile::read(&path)?;
        let (views, clock) = (file.views(options)?, file.clock());
        Ok(Self { folder: folder.to_owned(), split, views, points, clock })
    }

    /// Returns whether a folder has views of a split.
    pub(crate) fn has(folder: &Path, split: Split) -> bool {
        match format::of(folder).map(|format| &format.reader) {
            Some(Reader::Splits) => folder.join(split.file_name()).is_file(),
            Some(Reader::Whole(_)) => Self::look(folder, split, &CameraOptions::default()).is_ok(),
            None => false,
        }
    }

    /// Returns the name of the format of a folder; `None` if it has none.
    pub(crate) fn format(folder: &Path) -> Option<&'static str> {
        format::of(folder).map(|format| format.name)
    }

    /// Checks that every image and mask is on disk.
    ///
    /// # Errors
    /// [`DatasetError::MissingImages`], which names the first few missing files and their number.
    pub fn require_images(&self) -> Result<(), DatasetError> {
        require_images(&self.views)
    }
}

/// Returns the error of a folder of no format.
pub(super) fn not_a_dataset(folder: &Path, split: Split) -> DatasetError {
    DatasetError::NotADataset { folder: folder.to_owned(), file: split.file_name(), formats: format::names() }
}

/// Checks that every image and mask of these views is on disk.
///
/// # Errors
/// [`DatasetError::MissingImages`], which names the first few missing files and their number.
pub(crate) fn require_images(views: &[TrainingView]) -> Result<(), DatasetError> {
    require_files(views.iter().flat_map(|view| [Some(&view.image), view.mask.as_ref()]).flatten())
}
