//! The formats of dataset folders.
//!
//! In: a folder. Out: its format, by the files in it, and the reader of its views. `FORMATS` lists the formats; the
//! first one that fits is used.

use super::formats::undivided::Undivided;
use super::formats::video::Videos;
use super::formats::{
    colmap, easyvolcap, immersive, llff, n3v, nerfies, nerfstudio, panoptic, polycam, pose2sim, record3d, technicolor,
    zju,
};
use super::{CameraOptions, DatasetError, Split};
use glam::UVec2;
use std::path::{Path, PathBuf};

/// A format of folders.
pub(super) struct Format {
    /// Its name in messages.
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
static FORMATS: &[Format] = &[
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
        name: "PanopticSports (train_meta.json, test_meta.json with ims)",
        is_there: panoptic::is_there,
        reader: Reader::Whole(|folder, options, _| panoptic::read(folder, options)),
    },
    Format {
        name: "Nerfies, HyperNeRF or DyCheck (dataset.json with camera and rgb)",
        is_there: nerfies::is_there,
        reader: Reader::Whole(|folder, options, _| nerfies::read(folder, options)),
    },
    Format {
        name: "Technicolor (cameras_parameters.txt with NAME_FRAME_CAMERA.png, or frames or a video of each camera)",
        is_there: technicolor::is_there,
        reader: Reader::Whole(technicolor::read),
    },
    Format {
        name: "EasyVolcap, EasyMocap, ENeRF or SelfCap (intri.yml, extri.yml with images/CAMERA or videos/CAMERA.mp4)",
        is_there: easyvolcap::is_there,
        reader: Reader::Whole(easyvolcap::read),
    },
    Format {
        name: "ZJU-MoCap (annots.npy)",
        is_there: zju::is_there,
        reader: Reader::Whole(|folder, options, _| zju::read(folder, options)),
    },
    Format {
        name: "LLFF (poses_bounds.npy with images)",
        is_there: llff::is_there,
        reader: Reader::Whole(|folder, options, _| llff::read(folder, options)),
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
    Format {
        name: "Google Immersive (models.json with a video or frames of each camera)",
        is_there: immersive::is_there,
        reader: Reader::Whole(immersive::read),
    },
    Format {
        name: "Pose2Sim, Anipose or Qualisys (Calib*.toml or *.qca.txt with a video or frames of each camera)",
        is_there: pose2sim::is_there,
        reader: Reader::Whole(pose2sim::read),
    },
    Format {
        name: "Record3D (metadata.json with rgbd or rgb)",
        is_there: record3d::is_there,
        reader: Reader::Whole(|folder, options, _| record3d::read(folder, options)),
    },
    Format {
        name: "Polycam (keyframes/corrected_cameras with corrected_images)",
        is_there: polycam::is_there,
        reader: Reader::Whole(|folder, options, _| polycam::read(folder, options)),
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

/// Returns the files of a folder whose views are in one file: the camera file, and the images, masks and points that
/// exist.
pub(crate) fn inputs(folder: &Path) -> Vec<PathBuf> {
    let Some(Format { reader: Reader::Whole(read), .. }) = of(folder) else { return Vec::new() };
    // Any size serves: paths do not depend on it. Faults of the files are reported when they are read.
    let options = CameraOptions { size: Some(UVec2::ONE), ..CameraOptions::default() };
    let Ok(all) = read(folder, &options, Videos::Leave) else { return Vec::new() };
    let images = all.views.into_iter().flat_map(|view| [Some(view.image), view.mask]);
    images.chain([Some(all.source), all.points]).flatten().collect()
}
