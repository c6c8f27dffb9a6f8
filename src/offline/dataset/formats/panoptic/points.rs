//! The points of `PanopticSports`: `init_pt_cld.npz`.
//!
//! In: an archive with the array `data` of places, colors and whether a point is of a person, and the origin of the
//! views. Out: the points with their colors. The unpacked size is limited by the [`Budget`] of the archive.

use crate::codec::budget::{Budget, UnpackError};
use crate::codec::npy::Array;
use crate::codec::text::printable;
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::cloud_point::CloudPoint;
use crate::offline::dataset::formats::{limited, npy};
use crate::scene::Origin;
use glam::DVec3;
use std::io::Cursor;
use std::path::Path;
use zip::ZipArchive;

/// Most bytes of an archive: 19 million points.
const MAX_BYTES: u64 = 1 << 30;
/// The array.
const ARRAY: &str = "data.npy";
/// Numbers of a point: place, color, and whether it is of a person.
const COLUMNS: usize = 7;
/// The remedy for an array of another type or compression.
const SAVE: &str = "save it with numpy.savez(\"init_pt_cld.npz\", data=data.astype(\"<f8\"))";
/// The largest color that is one from 0 to 1: larger ones are of 255.
const BRIGHTEST: f64 = 1.5;

/// Reads an archive.
///
/// # Errors
/// A file that is no such archive, or is damaged.
pub(crate) fn points(path: &Path, origin: &Origin) -> Result<Vec<CloudPoint>, DatasetError> {
    let unusable = |reason: String| DatasetError::Unusable { path: path.to_owned(), reason };
    let bytes = limited::bytes(path, MAX_BYTES, "file of points")?;
    let rows = npy::rows::<COLUMNS>(&array(&bytes).map_err(unusable)?, ARRAY).map_err(unusable)?;
    let colors = rows.iter().flat_map(|row| &row[3..6]).filter(|value| value.is_finite());
    let scale = if colors.copied().fold(0.0, f64::max) > BRIGHTEST { 255.0 } else { 1.0 };
    let share = |value: f64| if value.is_finite() { (value / scale).clamp(0.0, 1.0) } else { 0.0 };
    let point = |&[x, y, z, red, green, blue, _]: &[f64; COLUMNS]| {
        let color = DVec3::from([red, green, blue].map(share)).as_vec3();
        CloudPoint::counted_from(origin, [x, y, z], Some(color), None)
    };
    Ok(rows.iter().map(point).collect())
}

/// Unpacks the array, or returns the fault of the archive.
fn array(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut zip = ZipArchive::new(Cursor::new(bytes))
        .map_err(|error| format!("its zip archive is damaged ({error}): copy the file again"))?;
    let entry = zip.by_name(ARRAY).map_err(|_| {
        "its array data, of x, y, z, red, green, blue and segment, is missing or damaged: copy the file again"
            .to_owned()
    })?;
    let length = entry.size();
    let unpacked = Budget::of(bytes.len() as u64).unpack_stated(entry, length).map_err(|error| match error {
        UnpackError::OverBudget(over) => format!("its array data {over}: {SAVE}"),
        error => format!("its array data {error}"),
    })?;
    let fault = match Array::read(&unpacked).map(|array| array.kind) {
        Some("<f8" | "<f4" | ">f8" | ">f4") => None,
        Some(kind) => Some(format!("the values of its array data are of the type {}: {SAVE}", printable(kind))),
        None => Some("its array data is not whole: copy the file again".to_owned()),
    };
    fault.map_or(Ok(unpacked), Err)
}
