//! Points to begin a training with.
//!
//! In: a file of points: PLY (`x`, `y`, `z`, optionally `red`, `green`, `blue`, `time`, `vx`, `vy`, `vz` and
//! `standing`), COLMAP's `points3D.bin` and `points3D.txt`, `points.npy` of Nerfies, or `init_pt_cld.npz` of
//! `PanopticSports`; the origin of the views. Out: a [`PointCloud`]. Points whose place or time is not finite are left
//! out; velocities that are not finite or beyond all measure are none. A count in a file is used only if the file has
//! as many bytes.

pub use super::cloud_point::CloudPoint;

use crate::codec::import::ply::is_ply;
use crate::codec::import::ply::read::vertices;
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::formats::{colmap, nerfies, panoptic};
use crate::scene::Origin;
use glam::Vec3;
use std::fs;
use std::path::Path;

/// Velocity above which a point has none: in meters and seconds three times that of light.
const MOST_SPEED: f32 = 1e9;

/// Points, possibly none.
#[derive(Debug, Clone, PartialEq)]
pub struct PointCloud(pub Vec<CloudPoint>);

impl PointCloud {
    /// Reads a file, whose places and times are counted from an origin in its coordinates.
    ///
    /// # Errors
    /// A file that cannot be read, that is damaged or of another kind.
    pub fn load(path: &Path, origin: &Origin) -> Result<Self, DatasetError> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let mut points = match extension.to_str() {
            Some("bin") => colmap::binary_points(path, origin)?,
            Some("txt") => colmap::text_points(path, origin)?,
            Some("npy") => nerfies::points(path, origin)?,
            Some("npz") => panoptic::points(path, origin)?,
            _ => ply(path, origin)?,
        };
        points.retain(|point| point.position.is_finite() && point.time.is_none_or(f32::is_finite));
        Ok(Self(points))
    }
}

/// Reads a PLY file.
fn ply(path: &Path, origin: &Origin) -> Result<Vec<CloudPoint>, DatasetError> {
    let bytes = fs::read(path).map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })?;
    if !is_ply(&bytes) {
        let known = "PLY, points3D.bin and points3D.txt of COLMAP, points.npy of Nerfies and init_pt_cld.npz of \
                     PanopticSports";
        return Err(unusable(path, &format!("it is no file of points: {known} are read")));
    }
    let faulty = |error: crate::codec::import::ImportError| unusable(path, &error.to_string());
    let table = vertices(&bytes).map_err(faulty)?;
    let places = table.all(["x", "y", "z"]).map_err(faulty)?;
    let colors = table.all(["red", "green", "blue"]).ok();
    let (time, standing) = (table.column("time"), table.column("standing"));
    let velocities = table.all(["vx", "vy", "vz"]).ok();
    let point = |index: usize| {
        let color = colors.map(|columns| color(columns.map(|column| column.share(index))));
        // A point that stands has no time, whatever its row says.
        let stands = standing.is_some_and(|column| column.f64(index) > 0.0);
        let time = time.filter(|_| !stands).map(|column| column.f64(index));
        let velocity = velocities.map_or(Vec3::ZERO, |columns| Vec3::from(columns.map(|column| column.f32(index))));
        let point = CloudPoint::counted_from(origin, places.map(|column| column.f64(index)), color, time);
        let is_possible = velocity.is_finite() && velocity.abs().max_element() <= MOST_SPEED;
        CloudPoint { velocity: if is_possible { velocity } else { Vec3::ZERO }, ..point }
    };
    Ok((0..table.len()).map(point).collect())
}

/// Returns a color of these shares, each of which is finite.
fn color(shares: [f32; 3]) -> Vec3 {
    Vec3::from(shares.map(|share| if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }))
}

fn unusable(path: &Path, reason: &str) -> DatasetError {
    DatasetError::Unusable { path: path.to_owned(), reason: reason.to_owned() }
}
