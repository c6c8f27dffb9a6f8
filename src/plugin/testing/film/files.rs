//! The files of a filmed dataset.
//!
//! In: pictures with their camera poses and times; places of points. Out: PNG files in `train`, `val` and `test`, a
//! camera file `transforms_*.json` in the Blender form for each split that has a picture, and `points.json` if there
//! are points.

use super::error::FilmError;
use super::hold_out::Split;
use super::points::Tracks;
use super::writer::Writer;
use crate::codec::CodecError;
use crate::plugin::testing::TestingError;
use crate::plugin::testing::readback::HalfPicture;
use bevy::transform::components::Transform;
use glam::{UVec2, Vec3};
use serde::Serialize;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// A dataset that is being written.
pub(super) struct Files<'a> {
    folder: &'a Path,
    writer: Writer,
    head: Head,
    tracks: Tracks,
    frames: [Vec<Frame>; Split::ALL.len()],
}

/// The entries of a whole camera file. With `fl_x`, `fl_y`, `cx` and `cy` it would describe an intrinsics camera, which
/// the original rasterizes by a placeholder instead of its field of view.
#[derive(Debug, Clone, Serialize)]
struct Head {
    /// Horizontal field of view in radians.
    camera_angle_x: f64,
    w: u32,
    h: u32,
    /// Seconds of the times 0 and 1.
    seconds: [f32; 2],
}

impl Head {
    /// Returns the time of a moment in seconds: from 0, the first time of the film, to 1, its last.
    fn time(&self, seconds: f32) -> f64 {
        let [first, last] = self.seconds.map(f64::from);
        if last > first { (f64::from(seconds) - first) / (last - first) } else { 0.0 }
    }
}

/// The entries of the file of points.
#[derive(Serialize)]
struct PointFile<'a> {
    /// Seconds of the times 0 and 1.
    seconds: [f32; 2],
    #[serde(flatten)]
    tracks: &'a Tracks,
}

#[derive(Serialize)]
struct CameraFile<'a> {
    #[serde(flatten)]
    head: &'a Head,
    frames: &'a [Frame],
}

/// One picture.
#[derive(Debug, Clone, Serialize)]
struct Frame {
    /// The path of the picture without its extension, as in D-NeRF.
    file_path: String,
    /// From 0, the first time of the film, to 1, its last.
    time: f64,
    /// Seconds of the film.
    seconds: f32,
    /// Rows of the camera-to-world matrix in OpenGL axes.
    transform_matrix: [[f32; 4]; 4],
}

impl<'a> Files<'a> {
    /// Begins a dataset in a folder that is empty or does not exist.
    pub(super) fn begin(folder: &'a Path, size: UVec2, fov_y: f32, seconds: [f32; 2]) -> Result<Self, FilmError> {
        match fs::read_dir(folder).map(|mut entries| entries.next().is_some()) {
            Ok(true) => return Err(FilmError::Occupied(folder.to_owned())),
            Ok(false) => {}
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(failed(folder, error)),
        }
        let tangent = (f64::from(fov_y) / 2.0).tan() * f64::from(size.x) / f64::from(size.y);
        let head = Head { camera_angle_x: 2.0 * tangent.atan(), w: size.x, h: size.y, seconds };
        Ok(Self { folder, writer: Writer::begin(), head, tracks: Tracks::default(), frames: Default::default() })
    }

    /// Adds a picture, which another thread writes.
    pub(super) fn add(
        &mut self,
        split: Split,
        [camera, time]: [usize; 2],
        seconds: f32,
        pose: &Transform,
        picture: HalfPicture,
    ) -> Result<(), FilmError> {
        let name = format!("{}/c{camera:04}_t{time:04}", split.name());
        self.writer.add(picture, self.folder.join(format!("{name}.png")))?;
        self.frames[split as usize].push(Frame {
            file_path: format!("./{name}"),
            time: self.head.time(seconds),
            seconds,
            transform_matrix: pose.to_matrix().transpose().to_cols_array_2d(),
        });
        Ok(())
    }

    /// Adds the places of points at a time, each with its name, world space.
    pub(super) fn add_points(&mut self, seconds: f32, places: Vec<(String, Vec3)>) -> Result<(), FilmError> {
        self.tracks.add(self.head.time(seconds), places)
    }

    /// Waits for the pictures and writes the points and the camera files. Returns the numbers of training, validation
    /// and test views.
    pub(super) fn finish(self) -> Result<[usize; 3], FilmError> {
        let Self { folder, writer, head, tracks, frames } = self;
        writer.finish()?;
        if !tracks.is_empty() {
            write(&folder.join("points.json"), &PointFile { seconds: head.seconds, tracks: &tracks })?;
        }
        for split in Split::ALL {
            let frames = &frames[split as usize];
            if !frames.is_empty() {
                let file = CameraFile { head: &head, frames };
                write(&folder.join(format!("transforms_{}.json", split.name())), &file)?;
            }
        }
        Ok([Split::Train, Split::Validation, Split::Test].map(|split| frames[split as usize].len()))
    }
}

/// Writes under a temporary name, and renames the file once it is complete.
fn write(path: &Path, file: &impl Serialize) -> Result<(), FilmError> {
    let partial: PathBuf = path.with_extension("json.part");
    let json = serde_json::to_vec_pretty(file);
    let written = json.map_err(io::Error::other).and_then(|json| fs::write(&partial, json));
    written.and_then(|()| fs::rename(&partial, path)).map_err(|error| {
        // A failure to remove the partial file is ignored: the first error is returned.
        fs::remove_file(&partial).ok();
        failed(path, error)
    })
}

fn failed(path: &Path, error: io::Error) -> FilmError {
    TestingError::Save(CodecError::at(path, error)).into()
}
