//! The cameras of `poses_bounds.npy`, the file of LLFF.
//!
//! In: the file. Out: a camera for each row. The principal point is the center of the picture, since the file has none.

use super::standing::{Shot, Standing};
use super::{limited, npy};
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::lens::{OriginalLens, checked_size};
use crate::offline::dataset::cameras::pose::pose;
use crate::offline::dataset::{DatasetError, FrameProblem};
use glam::{DMat4, DVec2, UVec2};
use std::path::Path;

/// Name of the file.
pub(crate) const POSES: &str = "poses_bounds.npy";
/// Numbers of a row: 3 x 5 for the pose and the lens, the nearest and the farthest depth.
const COLUMNS: usize = 17;
/// Most bytes of the file.
const MAX_BYTES: u64 = 1 << 24;

/// A row of the file.
pub(crate) struct Row {
    world_to_camera: DMat4,
    /// Size of the original picture, pixels.
    size: UVec2,
    lens: OriginalLens,
}

impl Row {
    /// Returns the camera with its name, its place in the file, and its pictures.
    pub(crate) fn with(self, name: String, index: usize, shots: Vec<Shot>) -> Standing {
        let Self { world_to_camera, size, lens } = self;
        Standing { name, index, shots, size, world_to_camera, lens, distortion: Distortion::default() }
    }
}

/// Reads the rows.
///
/// # Errors
/// A file that cannot be read or is no array of rows, a row that is no camera.
pub(crate) fn read(path: &Path) -> Result<Vec<Row>, DatasetError> {
    let unusable = |reason| DatasetError::Unusable { path: path.to_owned(), reason };
    let rows = npy::rows::<COLUMNS>(&limited::bytes(path, MAX_BYTES, "file of poses")?, POSES).map_err(unusable)?;
    let of_values = |(frame, values): (usize, &[f64; COLUMNS])| {
        row(values).map_err(|problem| DatasetError::Frame { path: path.to_owned(), frame, problem })
    };
    rows.iter().enumerate().map(of_values).collect()
}

/// Returns the camera of a row. The columns of the rotation point down, right and backwards; the last one has height,
/// width and focal length.
fn row(values: &[f64; COLUMNS]) -> Result<Row, FrameProblem> {
    let column = |column: usize| [0, 1, 2].map(|row: usize| values[5 * row + column]);
    let [down, right, backwards, position, [height, width, focal]] = [0, 1, 2, 3, 4].map(column);
    let mut rows = [[0.0; 4], [0.0; 4], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
    for (axis, row) in rows.iter_mut().take(3).enumerate() {
        *row = [right[axis], down[axis], -backwards[axis], position[axis]];
    }
    let size = checked_size(width, height)?;
    let lens = OriginalLens::Intrinsics { focal: DVec2::splat(focal), center: size.as_dvec2() / 2.0 };
    Ok(Row { world_to_camera: pose(&rows)?.inverse(), size, lens })
}
