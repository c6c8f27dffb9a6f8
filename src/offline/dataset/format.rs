//! The formats of dataset folders.
//!
//! In: a folder. Out: its format, by the files in it, and the reader of its views. `FORMATS` lists the formats; the first one that fits is used.

use super::undivided::Undivided;
use super::video::Videos;
use super::{CameraOptions, DatasetError, Split, colmap, n3v, nerfstudio};
use glam::UVec2;
use std::path::{Path, PathBuf};

/// A format of folders.
pub(super) struct Format {
    /// Its name, for people.
    pub name: &'static str,
    /// Returns whether a folder has this format.
    is_there: fn(&Path) -> bool,
    /// How it is read.
    pub reader: Reader,
}

/// How a format is read.
pub(super) enum Reader {
    /// A camera file for each split.
    Splits,
    /// All views at once.
    Whole(fn(&Path, &CameraOptions, Videos<'_>) -> Result<Undivided, DatasetError>),
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

/// Returns the files of a folder whose views are in one file: the camera file, and the images, masks and points that exist.
pub(crate) fn inputs(folder: &Path) -> Vec<PathBuf> {
    let Some(Format { reader: Reader::Whole(read), .. }) = of(folder) else { return Vec::new() };
    // Any size serves: paths do not depend on it. Faults of the files are reported when they are read.
    let options = CameraOptions { size: Some(UVec2::ONE), ..CameraOptions::default() };
    let Ok(all) = read(folder, &options, Videos::Leave) else { return Vec::new() };
    let images = all.views.into_iter().flat_map(|view| [Some(view.image), view.mask]);
    images.chain([Some(all.source), all.points]).flatten().collect()
}
