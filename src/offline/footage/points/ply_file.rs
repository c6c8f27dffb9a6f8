//! A PLY file of points with times and velocities.
//!
//! In: points, counted from an origin. Out: a binary file with the properties `x y z time` (double), `vx vy vz`
//! (float), `red green blue standing` (uchar), in the coordinates of the dataset. A point without a time has `standing`
//! 1 and the time in the middle, for programs that do not know `standing`.

use crate::codec::CodecError;
use crate::offline::dataset::point_cloud::CloudPoint;
use crate::offline::work::write_beside;
use crate::scene::Origin;
use std::io::{self, Write};
use std::path::Path;

/// The properties of a point, in order.
const PROPERTIES: [(&str, &str); 11] = [
    ("double", "x"),
    ("double", "y"),
    ("double", "z"),
    ("double", "time"),
    ("float", "vx"),
    ("float", "vy"),
    ("float", "vz"),
    ("uchar", "red"),
    ("uchar", "green"),
    ("uchar", "blue"),
    ("uchar", "standing"),
];
/// The color of points without one.
const GRAY: u8 = 128;

/// Writes points, whole or not at all. `middle` is the time in the middle of the take, counted from the origin.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub(crate) fn write(path: &Path, points: &[CloudPoint], origin: &Origin, middle: f32) -> Result<(), CodecError> {
    write_beside(path, |file| write_to(file, points, origin, middle))
}

fn write_to(file: &mut impl Write, points: &[CloudPoint], origin: &Origin, middle: f32) -> io::Result<()> {
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points.len());
    for (kind, name) in PROPERTIES {
        header += &format!("property {kind} {name}\n");
    }
    file.write_all((header + "end_header\n").as_bytes())?;
    points.iter().try_for_each(|point| file.write_all(&record(point, origin, middle)))
}

/// Returns the bytes of a point.
fn record(point: &CloudPoint, origin: &Origin, middle: f32) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(48);
    for (offset, origin) in point.position.to_array().into_iter().zip(origin.place) {
        bytes.extend((origin + f64::from(offset)).to_le_bytes());
    }
    bytes.extend((origin.time + f64::from(point.time.unwrap_or(middle))).to_le_bytes());
    for speed in point.velocity.to_array() {
        bytes.extend(speed.to_le_bytes());
    }
    let byte = |share: f32| (share.clamp(0.0, 1.0) * 255.0).round() as u8;
    bytes.extend(point.color.map_or([GRAY; 3], |color| color.to_array().map(byte)));
    bytes.push(u8::from(point.time.is_none()));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::dataset::point_cloud::PointCloud;
    use glam::Vec3;

    #[test]
    fn a_file_is_read_back_by_the_dataset() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("points.ply");
        let origin = Origin { place: [500_000.0, -3.0, 0.25], time: 1.7e9 };
        let moving = CloudPoint {
            position: Vec3::new(0.125, 2.0, -1.5),
            color: Some(Vec3::new(1.0, 0.0, 0.2)),
            time: Some(0.5),
            velocity: Vec3::new(1.0, -2.0, 0.5),
        };
        let standing = CloudPoint { time: None, velocity: Vec3::ZERO, ..moving };
        write(&path, &[moving, standing], &origin, 0.75).expect("the folder can be written to");
        let PointCloud(found) = PointCloud::load(&path, &origin).expect("a file that the dataset reads");
        assert_eq!(found.len(), 2, "both points");
        assert_eq!((found[0].position, found[0].time), (moving.position, moving.time), "its place and time");
        let color = found[0].color.expect("the file has colors");
        assert!(color.distance(Vec3::new(1.0, 0.0, 0.2)) < 0.003, "its color: {color}");
        assert_eq!(found[0].velocity, moving.velocity, "its velocity");
        assert_eq!((found[1].time, found[1].velocity), (None, Vec3::ZERO), "a standing point has neither");
    }

    #[test]
    fn velocities_beyond_all_measure_are_read_as_none() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("points.ply");
        let point = |speed: f32| CloudPoint {
            position: Vec3::ONE,
            color: None,
            time: Some(0.5),
            velocity: Vec3::new(0.0, -speed, 1.0),
        };
        write(&path, &[3e8, 1e30, f32::INFINITY].map(point), &Origin::default(), 0.5).expect("a writable folder");
        let PointCloud(found) = PointCloud::load(&path, &Origin::default()).expect("a file that the dataset reads");
        let velocities: Vec<Vec3> = found.iter().map(|point| point.velocity).collect();
        assert_eq!(velocities, [Vec3::new(0.0, -3e8, 1.0), Vec3::ZERO, Vec3::ZERO], "that of light is one");
    }
}
