//! Points of a moment by the matches of its pictures.
//!
//! In: pictures of one moment by cameras whose poses and lenses are known, without distortion. Out: colored points with
//! the time of the moment, in the world space of the cameras; none if the pictures have too little in common.

use super::error::ColmapError;
use super::matches::{Care, Moment, name_of};
use super::program::{Program, Setting, Step};
use crate::offline::dataset::cloud_point::CloudPoint;
use crate::offline::dataset::formats::colmap::binary_points;
use crate::offline::work::Progress;
use crate::scene::Origin;
use crate::view::{Camera, Lens};
use glam::{DMat3, DQuat};
use image::RgbImage;
use std::env;
use std::fmt::Write;
use std::fs;
use std::io;
use std::path::Path;

/// Start of the names of folders of temporary files.
const PREFIX: &str = "gs4d-colmap-";
/// The lens of pictures without distortion.
const LENS: &str = "PINHOLE";
/// Number of cameras from which a point must be seen by three of them.
const MANY: usize = 6;
/// Points that two cameras see are kept.
const OF_TWO: &[Setting<'static>] = &[(&["Mapper.tri_ignore_two_view_tracks"], "0")];
/// What the program says where there is no point: it fails.
const NO_POINTS: &str = "bundle_adjuster";

/// Returns the points that the pictures of a moment show. Begins no task.
///
/// # Errors
/// The program fails; a folder of temporary files that cannot be written to; the interruption of the work.
pub(crate) fn triangulated(
    program: &Program,
    pictures: &[(Camera, RgbImage)],
    time: f32,
    progress: &dyn Progress,
) -> Result<Vec<CloudPoint>, ColmapError> {
    if pictures.len() < 2 {
        return Ok(Vec::new());
    }
    let scratch = |reason| ColmapError::Scratch { path: env::temp_dir(), reason };
    let folder = tempfile::Builder::new().prefix(PREFIX).tempdir().map_err(scratch)?;
    let moment = Moment::in_folder(folder.path().to_owned());
    for (index, (_, picture)) in pictures.iter().enumerate() {
        let path = moment.place(index, "png")?;
        picture.save(&path).map_err(|error| ColmapError::Scratch { path, reason: io::Error::other(error) })?;
    }
    let order = moment.matched(program, LENS, Care::Usual, progress)?;
    let (known, output) = (moment.new_folder("known")?, moment.new_folder("points")?);
    let cameras: Vec<Camera> = pictures.iter().map(|(camera, _)| *camera).collect();
    write_model(&known, &cameras, &order)?;
    let paths = [
        ("database_path", moment.database.as_path()),
        ("image_path", moment.images.as_path()),
        ("input_path", known.as_path()),
        ("output_path", output.as_path()),
    ];
    let settings = if pictures.len() < MANY { OF_TWO } else { &[] };
    match moment.run(program, &Step { name: "point_triangulator", paths: &paths, settings }, progress) {
        Err(ColmapError::Step { said, .. }) if said.contains(NO_POINTS) => return Ok(Vec::new()),
        Err(other) => return Err(other),
        Ok(_) => {}
    }
    let mut points = binary_points(&output.join("points3D.bin"), &Origin::default())?;
    points.retain(|point| point.position.is_finite());
    points.iter_mut().for_each(|point| point.time = Some(time));
    Ok(points)
}

/// Writes the model of known cameras, whose pictures were added to the database in this order.
fn write_model(folder: &Path, cameras: &[Camera], order: &[usize]) -> Result<(), ColmapError> {
    let (lenses, poses) = (lenses(cameras), poses(cameras, order));
    for (name, text) in [("cameras.txt", lenses), ("images.txt", poses), ("points3D.txt", String::new())] {
        let path = folder.join(name);
        fs::write(&path, text).map_err(|reason| ColmapError::Scratch { path, reason })?;
    }
    Ok(())
}

/// Returns lines of `ID PINHOLE WIDTH HEIGHT FX FY CX CY`: lenses are numbered by the names of cameras, from 1.
fn lenses(cameras: &[Camera]) -> String {
    let mut text = String::new();
    for (index, camera) in cameras.iter().enumerate() {
        let size = camera.size.as_vec2();
        let (focal, center) = match camera.lens {
            Lens::Fov { tan } => (size / (2.0 * tan), size / 2.0),
            Lens::Intrinsics { focal, center } => (focal, center),
        };
        let ([width, height], number) = (camera.size.to_array(), index + 1);
        let [fx, fy, cx, cy] = [focal.x, focal.y, center.x, center.y];
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{number} {LENS} {width} {height} {fx} {fy} {cx} {cy}");
    }
    text
}

/// Returns lines of `ID QW QX QY QZ TX TY TZ LENS NAME`, each with an empty line after it. Pictures whose number is not
/// known have the numbers after the others.
fn poses(cameras: &[Camera], order: &[usize]) -> String {
    let others = (0..cameras.len()).filter(|index| !order.contains(index));
    let numbered = order.iter().copied().filter(|&index| index < cameras.len()).chain(others);
    let mut text = String::new();
    for (place, index) in numbered.enumerate() {
        let pose = cameras[index].world_to_camera.as_dmat4();
        let [x, y, z, w] = DQuat::from_mat3(&DMat3::from_mat4(pose)).normalize().to_array();
        let [tx, ty, tz] = pose.w_axis.truncate().to_array();
        let (number, lens, name) = (place + 1, index + 1, name_of(index));
        let _ = writeln!(text, "{number} {w} {x} {y} {z} {tx} {ty} {tz} {lens} {name}\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{UVec2, Vec2, Vec3};

    #[test]
    fn pictures_have_the_numbers_of_the_database_and_the_lenses_of_their_cameras() {
        let size = UVec2::new(640, 480);
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, Vec3::Y, 0.8, size);
        let lens = Lens::Intrinsics { focal: Vec2::new(500.0, 510.0), center: Vec2::new(320.0, 240.5) };
        let cameras = [camera, Camera { lens, ..camera }];
        let text = poses(&cameras, &[1, 0]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "a line for each picture, and one for its points: {text}");
        assert!(lines[0].starts_with("1 ") && lines[0].ends_with(" 2 000001/picture.png"), "the first: {}", lines[0]);
        assert!(lines[2].starts_with("2 ") && lines[2].ends_with(" 1 000000/picture.png"), "then: {}", lines[2]);
        let numbers: Vec<f64> = lines[0].split(' ').filter_map(|word| word.parse().ok()).collect();
        assert_eq!(numbers[5..8], [0.0, 0.0, 4.0], "the translation: {}", lines[0]);
        let text = lenses(&cameras);
        assert!(text.ends_with("2 PINHOLE 640 480 500 510 320 240.5\n"), "a lens with intrinsics: {text}");
        let focal: f32 = text.split(' ').nth(4).and_then(|word| word.parse().ok()).expect("a focal length");
        assert!((focal - 320.0 / 0.4f32.tan()).abs() < 1e-2, "the focal length of an angle: {focal}");
    }
}
