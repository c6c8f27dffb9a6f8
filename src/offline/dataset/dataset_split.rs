//! One split of a dataset folder.
//!
//! In: a folder and a split. Out: the [`TrainingView`]s of the split in file order; an error if images are missing.

use super::cameras::camera_options::{CameraOptions, check_size};
use super::cameras::clock::Clock;
use super::cameras::origin;
use super::cameras::placing::Placed;
use super::division::divide;
use super::error::DatasetError;
use super::format::{self, Format, Reader};
use super::formats::camera_file::CameraFile;
use super::formats::files::{points_beside, require_files};
use super::formats::video::Videos;
use super::split::Split;
use super::view::TrainingView;
use crate::offline::work::{NoProgress, Progress};
use crate::scene::Origin;
use std::mem::take;
use std::path::{Path, PathBuf};

/// The note about the test views of the scene `lego`.
const LEGO: &str = "its test views are those of transforms_val.json, not of transforms_test.json, as in the original \
                    for folders whose name ends in lego: rename the folder if it is another scene";

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
    /// Assumptions and omissions of reading the folder, a sentence each.
    pub notes: Vec<String>,
    /// The origin of the views in the coordinates of the files, the same for all splits: places and times of views are
    /// counted from it.
    pub origin: Origin,
    /// The meaning of the times of the views.
    pub(crate) clock: Clock,
}

impl Dataset {
    /// Reads the cameras of one split of a folder of any format. The frames of videos are decoded once, by the program
    /// `ffmpeg`.
    ///
    /// # Errors
    /// [`DatasetError`] if the folder has no such split, or its files are unusable. Missing images are not an error
    /// here.
    pub fn open(folder: &Path, split: Split, options: &CameraOptions) -> Result<Self, DatasetError> {
        Self::open_with_progress(folder, split, options, &mut NoProgress)
    }

    /// Reads as [`open`](Self::open), with notes about the videos that are decoded.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub(crate) fn open_with_progress(
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
    pub(crate) fn open_undecoded(folder: &Path, split: Split, options: &CameraOptions) -> Result<Self, DatasetError> {
        Self::open_as(folder, split, options, Videos::Leave)
    }

    fn open_as(folder: &Path, split: Split, options: &CameraOptions, videos: Videos<'_>) -> Result<Self, DatasetError> {
        options.size.map_or(Ok(()), check_size)?;
        // The interval of a scene at rest is that of times that are not used.
        let time_interval = options.time_interval.filter(|_| !options.is_static);
        let mut dataset = Self::read(folder, split, &CameraOptions { time_interval, ..*options }, videos)?;
        if options.is_static {
            dataset.clock = Clock::default();
        }
        if options.origin.is_none() {
            dataset.notes.extend(origin::notes(&dataset.origin));
        }
        Ok(dataset)
    }

    fn read(folder: &Path, split: Split, options: &CameraOptions, videos: Videos<'_>) -> Result<Self, DatasetError> {
        let Format { reader, .. } = format::of(folder).ok_or_else(|| not_a_dataset(folder, split))?;
        match reader {
            Reader::Splits => Self::open_split(folder, split, options),
            Reader::Whole(read) => {
                let mut all = read(folder, options, videos)?;
                let (points, clock, notes, origin) = (all.points.take(), all.clock, take(&mut all.notes), all.origin);
                let (folder, views) = (folder.to_owned(), divide(split, options, all)?);
                Ok(Self { folder, split, views, points, notes, origin, clock })
            }
        }
    }

    /// Reads one split from its own camera file.
    fn open_split(folder: &Path, wanted: Split, options: &CameraOptions) -> Result<Self, DatasetError> {
        let split = wanted.resolved(folder);
        let path = folder.join(split.file_name());
        if !path.is_file() {
            return Err(DatasetError::NoSplit { folder: folder.to_owned(), file: split.file_name() });
        }
        let points = points_beside(folder);
        let file = CameraFile::read(&path)?;
        let origin = options.origin.or(file.common_origin(folder, split, options.is_static)?);
        let Placed { views, origin, mut notes } = file.views(&CameraOptions { origin, ..*options })?;
        notes.extend((split != wanted).then(|| LEGO.to_owned()));
        Ok(Self { folder: folder.to_owned(), split, views, points, notes, origin, clock: file.clock() })
    }

    /// Returns whether a folder has views of a split.
    pub(crate) fn has(folder: &Path, split: Split) -> bool {
        match format::of(folder).map(|format| &format.reader) {
            Some(Reader::Splits) => folder.join(split.file_name()).is_file(),
            Some(Reader::Whole(_)) => Self::open_undecoded(folder, split, &CameraOptions::default()).is_ok(),
            None => false,
        }
    }

    /// Returns the name of the format of a folder; `None` if it has none.
    pub(crate) fn format(folder: &Path) -> Option<&'static str> {
        format::of(folder).map(|format| format.name)
    }

    /// Reports assumptions and omissions, a note each.
    pub(crate) fn note(&self, progress: &mut dyn Progress) {
        self.notes.iter().for_each(|note| progress.note(&format!("note: {}: {note}", self.folder.display())));
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
