//! Cameras that stand still, whose pictures have been found.
//!
//! In: cameras with their poses, lenses and pictures. Out: the views of all of them, camera by camera. `footage` finds
//! the pictures of cameras by names.

use super::masks;
use super::numbered::{is_video, number, times};
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::lens::OriginalLens;
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::{CameraOptions, DatasetError, FrameProblem, Split};
use glam::{DMat4, UVec2};
use std::collections::HashSet;
use std::iter::repeat_n;
use std::path::{Path, PathBuf};

/// A picture of a camera.
pub(crate) struct Shot {
    pub image: PathBuf,
    /// Seconds.
    pub time: f64,
}

/// A camera that stands still.
pub(crate) struct Standing {
    /// Its name, with which the names of its views begin; empty if the names of its pictures are enough.
    pub name: String,
    /// Its place in the file of cameras, from 0.
    pub index: usize,
    pub shots: Vec<Shot>,
    /// Size of the original pictures, pixels.
    pub size: UVec2,
    pub world_to_camera: DMat4,
    pub lens: OriginalLens,
    pub distortion: Distortion,
}

/// Returns the frames of all cameras with their times, 30 a second: the first number of all cameras is time 0. A video
/// that is not decoded is the only frame of its camera.
pub(crate) fn timed(cameras: Vec<Vec<PathBuf>>) -> Vec<Vec<Shot>> {
    let decoded = cameras.iter().flatten().filter(|frame| !is_video(frame));
    let first = decoded.filter_map(|frame| number(frame)).min().unwrap_or(0);
    let shots = |frames: Vec<PathBuf>| {
        let is_undecoded = frames.iter().any(|frame| is_video(frame));
        let times = if is_undecoded { vec![0.0; frames.len()] } else { times(&frames, first) };
        frames.into_iter().zip(times).map(|(image, time)| Shot { image, time }).collect::<Vec<Shot>>()
    };
    cameras.into_iter().map(shots).collect()
}

/// Returns the split of each view of the cameras.
pub(crate) fn splits(cameras: &[Standing], is_test: impl Fn(&Standing) -> bool) -> Vec<Option<Split>> {
    let split = |camera: &Standing| if is_test(camera) { Split::Test } else { Split::Train };
    cameras.iter().flat_map(|camera| repeat_n(Some(split(camera)), camera.shots.len())).collect()
}

/// Returns the views of the cameras, camera by camera.
///
/// # Errors
/// A camera that cannot be used, by its place in the file of cameras, which is `source`.
pub(crate) fn views(
    folder: &Path,
    source: &Path,
    cameras: Vec<Standing>,
    options: &CameraOptions,
) -> Result<Placed, DatasetError> {
    let (mut names, mut unplaced) = (HashSet::new(), Vec::new());
    for Standing { name: camera, index, shots, size, world_to_camera, lens, distortion } in cameras {
        let failed = move |problem| DatasetError::Frame { path: source.to_owned(), frame: index, problem };
        for Shot { image, time } in shots {
            let file = image.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let label = if camera.is_empty() { file.to_owned() } else { format!("{camera}_{file}") };
            let name = output_name(&label, unplaced.len(), &mut names)
                .ok_or_else(|| failed(FrameProblem::FileName(label.clone())))?;
            let mask = masks::beside(folder, &Path::new(&camera).join(file));
            let mask = mask.map(|path| Mask { path, applied: false });
            let frame = Frame { name, image, mask, time, world_to_camera, lens, distortion };
            unplaced.push(Unplaced { frame, original: size, failed });
        }
    }
    place(unplaced, options, true)
}
