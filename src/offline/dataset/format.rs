//! The formats of dataset folders.
//!
//! In: a folder. Out: its format, by the files in it, and its views. `FORMATS` lists the formats; the first one that fits is used.

use super::camera_file::check_size;
use super::division::divide;
use super::{CameraOptions, Dataset, DatasetError, Split, TrainingView, colmap, n3v, nerfstudio};
use glam::UVec2;
use std::path::{Path, PathBuf};

/// A format of folders.
pub(super) struct Format {
    /// Its name, for people.
    pub name: &'static str,
    /// Returns whether a folder has this format.
    is_there: fn(&Path) -> bool,
    reader: Reader,
}

/// How a format is read.
enum Reader {
    /// A camera file for each split.
    Splits,
    /// All views at once.
    Whole(fn(&Path, &CameraOptions, Videos) -> Result<All, DatasetError>),
}

/// What is done with videos whose frames have not been decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Videos {
    /// They are decoded.
    Decode,
    /// Each is the image of one view.
    Leave,
}

/// The views of a folder before they are divided.
pub(super) struct All {
    /// The camera file.
    pub source: PathBuf,
    pub views: Vec<TrainingView>,
    /// The split of each view, where the dataset has them.
    pub splits: Option<Vec<Option<Split>>>,
    /// File of points to begin training with.
    pub points: Option<PathBuf>,
}

/// Every format.
static FORMATS: [Format; 4] = [
    Format {
        name: "Blender (transforms_train.json, transforms_test.json)",
        is_there: |folder| Split::ALL.iter().any(|split| folder.join(split.file_name()).is_file()),
        reader: Reader::Splits,
    },
    Format {
        name: "nerfstudio (transforms.json)",
        is_there: nerfstudio::is_there,
        reader: Reader::Whole(|folder, options, _| nerfstudio::read(folder, options)),
    },
    Format {
        name: "N3V (poses_bounds.npy with camNN.mp4, or frames in camNN)",
        is_there: n3v::is_there,
        reader: Reader::Whole(n3v::read),
    },
    Format {
        name: "COLMAP (sparse/0 with images)",
        is_there: colmap::is_there,
        reader: Reader::Whole(|folder, options, _| colmap::read(folder, options)),
    },
];

/// Returns the names of all formats.
pub(super) fn names() -> String {
    FORMATS.iter().map(|format| format.name).collect::<Vec<_>>().join(", ")
}

/// Returns the format of a folder; `None` if it has none.
pub(super) fn of(folder: &Path) -> Option<&'static Format> {
    FORMATS.iter().find(|format| (format.is_there)(folder))
}

/// Returns whether a folder whose views are in one file has views of a split.
pub(super) fn has(folder: &Path, split: Split) -> bool {
    let format = of(folder).filter(|format| matches!(format.reader, Reader::Whole(_)));
    format.is_some_and(|format| format.open(folder, split, &CameraOptions::default(), Videos::Leave).is_ok())
}

/// Returns the files of a folder whose views are in one file: the camera file, and the images, masks and points that exist.
pub(crate) fn inputs(folder: &Path) -> Vec<PathBuf> {
    let Some(Format { reader: Reader::Whole(read), .. }) = of(folder) else { return Vec::new() };
    // Any size serves: paths do not depend on it. Faults of the files are reported when they are read.
    let options = CameraOptions { size: Some(UVec2::ONE), ..CameraOptions::default() };
    let Ok(all) = read(folder, &options, Videos::Leave) else { return Vec::new() };
    let images = all.views.into_iter().flat_map(|view| [Some(view.image), view.mask]);
    images.chain([Some(all.source), all.points]).flatten().collect()
}

impl Format {
    /// Opens a split of a folder of this format.
    pub(super) fn open(
        &self,
        folder: &Path,
        split: Split,
        options: &CameraOptions,
        videos: Videos,
    ) -> Result<Dataset, DatasetError> {
        match self.reader {
            Reader::Splits => Dataset::open_split(folder, split, options),
            Reader::Whole(read) => {
                options.size.map_or(Ok(()), check_size)?;
                divide(folder, split, options, read(folder, options, videos)?)
            }
        }
    }
}
