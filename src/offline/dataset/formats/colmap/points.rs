//! The points of a model: `points3D.bin` and `points3D.txt`.
//!
//! In: a file, the origin of the views. Out: its points with their colors, without the images that show them.

use super::text::{at, contents, is_entry};
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::cloud_point::CloudPoint;
use crate::offline::dataset::formats::stream::Stream;
use crate::scene::Origin;
use glam::Vec3;
use std::path::Path;

/// Bytes of an entry of the track of a point: the number of an image, and of a point in it.
const TRACKED: u64 = 8;

/// Reads a binary file.
///
/// # Errors
/// A file that cannot be read, or ends too early.
pub(crate) fn binary_points(path: &Path, origin: &Origin) -> Result<Vec<CloudPoint>, DatasetError> {
    let mut stream = Stream::open(path)?;
    let mut points = Vec::new();
    for _ in 0..stream.u64()? {
        let _id = stream.u64()?;
        let (place, color) = (stream.f64s::<3>()?, stream.u8s::<3>()?);
        let [_error] = stream.f64s::<1>()?;
        let tracked = stream.u64()?;
        stream.skip(tracked, TRACKED)?;
        points.push(point(place, color, origin));
    }
    Ok(points)
}

/// Reads a text file: lines of `ID X Y Z R G B ERROR TRACK...`.
///
/// # Errors
/// A file that cannot be read; a line that is no point.
pub(crate) fn text_points(path: &Path, origin: &Origin) -> Result<Vec<CloudPoint>, DatasetError> {
    let text = contents(path)?;
    let lines = text.lines().enumerate().filter(|(_, line)| is_entry(line));
    lines.map(|(number, line)| of_line(line, origin).map_err(|reason| at(path, number, reason))).collect()
}

fn of_line(line: &str, origin: &Origin) -> Result<CloudPoint, String> {
    let form = || "must be ID X Y Z R G B ERROR and a track: write the model again with COLMAP".to_owned();
    let mut words = line.split_whitespace().skip(1);
    let mut place = [0.0f64; 3];
    for value in &mut place {
        *value = words.next().and_then(|word| word.parse().ok()).ok_or_else(form)?;
    }
    let mut color = [0u8; 3];
    for value in &mut color {
        *value = words.next().and_then(|word| word.parse().ok()).ok_or_else(form)?;
    }
    Ok(point(place, color, origin))
}

fn point(place: [f64; 3], color: [u8; 3], origin: &Origin) -> CloudPoint {
    let color = Vec3::from(color.map(f32::from)) / 255.0;
    CloudPoint::counted_from(origin, place, Some(color), None)
}
