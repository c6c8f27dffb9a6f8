//! The dataset of footage, as files.
//!
//! In: footage with poses and times. Out: the pictures, in `images/CAMERA/`: links to those of the footage where lenses
//! do not distort, else undistorted; `transforms.json`, with the cameras, times and splits of all pictures.

use super::output::{Listed, Unfinished, listed};
use super::source::{Shot, Source};
use crate::offline::dataset::{Clock, Correction, CoveredImage, Split, TrainingView};
use crate::offline::footage::FootageError;
use crate::offline::store::results::Key;
use crate::offline::work::{FileError, Progress, proceed, write_beside};
use crate::view::Lens;
use glam::{DMat4, DVec4};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ImageEncoder, ImageResult, Rgb, RgbImage, Rgba, RgbaImage};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

/// The folder of pictures.
const IMAGES: &str = "images";
/// The file of cameras.
const CAMERAS: &str = "transforms.json";
/// Pictures that are written between two reports of progress.
const AT_ONCE: usize = 32;

/// The files of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Written {
    pictures: Vec<Listed>,
    /// The hash of the file of cameras.
    cameras: Vec<u8>,
}

impl Written {
    /// Writes pictures and cameras. `points` is the name of the file of points, if there is one.
    ///
    /// # Errors
    /// A picture that cannot be read or written, an interruption.
    pub(super) fn of(
        source: &Source,
        points: Option<&str>,
        out: &Path,
        progress: &mut dyn Progress,
    ) -> Result<Self, FootageError> {
        let pictures = write_pictures(source, out, progress)?;
        write_cameras(source, out, points)?;
        Ok(Self { pictures, cameras: Key::of_file(&out.join(CAMERAS))?.bytes().to_vec() })
    }

    /// Returns whether all files are in the folder of the dataset.
    pub(super) fn is_in(&self, out: &Path) -> bool {
        let cameras = Key::of_file(&out.join(CAMERAS));
        cameras.is_ok_and(|key| key.bytes() == self.cameras) && listed(&out.join(IMAGES)) == self.pictures
    }
}

/// Writes the pictures. Begins the task "pictures". Returns the list of their files.
fn write_pictures(source: &Source, out: &Path, progress: &mut dyn Progress) -> Result<Vec<Listed>, FootageError> {
    let unfinished = Unfinished::begin(out, IMAGES)?;
    progress.begin("pictures", source.shots.len());
    for some in source.shots.chunks(AT_ONCE) {
        proceed(progress)?;
        some.par_iter().try_for_each(|shot| {
            let path = unfinished.path(&source.cameras[shot.camera], &file_name(shot))?;
            write_picture(&shot.view, &path)
        })?;
        some.iter().for_each(|_| progress.advance());
    }
    progress.finish();
    unfinished.finish()
}

/// Writes the file of cameras.
fn write_cameras(source: &Source, out: &Path, points: Option<&str>) -> Result<(), FootageError> {
    let mut file = Map::new();
    let Clock { unit_seconds, .. } = source.clock;
    if unit_seconds != Clock::default().unit_seconds {
        file.insert("seconds".to_owned(), json!([0.0, unit_seconds]));
    }
    file.extend(points.map(|name| ("ply_file_path".to_owned(), Value::from(name))));
    let frames: Vec<Value> = source.shots.iter().map(|shot| frame(shot, &source.cameras[shot.camera])).collect();
    file.insert("frames".to_owned(), frames.into());
    let text = format!("{:#}\n", Value::from(file));
    Ok(write_beside(&out.join(CAMERAS), |file| file.write_all(text.as_bytes()))?)
}

/// Returns the entry of a picture.
fn frame(shot: &Shot, camera: &str) -> Value {
    let view = &shot.view;
    let mut to_world = view.camera.world_to_camera.as_dmat4().inverse();
    // To OpenGL's axes: the camera's y and z are negated.
    to_world *= DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
    let rows: Vec<[f64; 4]> = (0..4).map(|row| to_world.row(row).to_array()).collect();
    let mut entry = json!({
        "file_path": format!("{IMAGES}/{camera}/{}", file_name(shot)),
        "camera": camera,
        "time": view.time,
        "split": split_name(shot.split),
        "w": view.camera.size.x,
        "h": view.camera.size.y,
        "transform_matrix": rows,
    });
    match view.camera.lens {
        Lens::Intrinsics { focal, center } => {
            entry["fl_x"] = json!(focal.x);
            entry["fl_y"] = json!(focal.y);
            entry["cx"] = json!(center.x);
            entry["cy"] = json!(center.y);
        }
        Lens::Fov { tan } => entry["camera_angle_x"] = json!(2.0 * f64::from(tan.x).atan()),
    }
    entry
}

/// Returns the value of the entry `split`.
fn split_name(split: Split) -> &'static str {
    match split {
        Split::Train => "train",
        Split::Test => "test",
        Split::Val => "val",
    }
}

/// Returns the name of the file of a picture.
fn file_name(shot: &Shot) -> String {
    let extension = shot.view.image.extension().filter(|_| is_kept(&shot.view));
    format!("{}.{}", shot.name, extension.map_or("png".into(), |extension| extension.to_string_lossy()))
}

/// Returns whether the image of a view is its picture as it is.
fn is_kept(view: &TrainingView) -> bool {
    view.correction == Correction::default() && view.mask.is_none() && view.original == view.camera.size
}

/// Writes the picture of a view: a link to its image, or a copy where there are no links; else the picture as PNG,
/// undistorted, with its coverage as alpha.
fn write_picture(view: &TrainingView, path: &Path) -> Result<(), FootageError> {
    if is_kept(view) {
        // A link of a link would depend on the place of the footage.
        let image = view.image.canonicalize().map_err(|error| FileError::at(&view.image, error))?;
        let linked = fs::hard_link(&image, path).or_else(|_| fs::copy(&image, path).map(drop));
        return Ok(linked.map_err(|error| FileError::at(path, error))?);
    }
    let covered = view.load_covered()?;
    let file = File::create(path).map_err(|error| FileError::at(path, error))?;
    let mut writer = BufWriter::new(file);
    encode(&covered, &mut writer).map_err(|error| FileError::at(path, error))?;
    Ok(writer.flush().map_err(|error| FileError::at(path, error))?)
}

/// Writes a picture as PNG. Colors are those before the multiplication by coverage.
fn encode(covered: &CoveredImage, writer: &mut BufWriter<File>) -> ImageResult<()> {
    let encoder = PngEncoder::new_with_quality(writer, CompressionType::Fast, FilterType::Adaptive);
    let (width, height) = covered.size.into();
    if !covered.has_gaps {
        let mut picture = RgbImage::new(width, height);
        for (pixel, &[red, green, blue, _]) in picture.pixels_mut().zip(&covered.texels) {
            *pixel = Rgb([red, green, blue]);
        }
        return encoder.write_image(&picture, width, height, image::ExtendedColorType::Rgb8);
    }
    let mut picture = RgbaImage::new(width, height);
    for (pixel, &[red, green, blue, alpha]) in picture.pixels_mut().zip(&covered.texels) {
        let coverage = u32::from(alpha.max(1));
        let whole = |value: u8| ((u32::from(value) * 255 + coverage / 2) / coverage).min(255) as u8;
        *pixel = Rgba([whole(red), whole(green), whole(blue), alpha]);
    }
    encoder.write_image(&picture, width, height, image::ExtendedColorType::Rgba8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::dataset::{CameraOptions, Dataset};
    use crate::offline::work::NoProgress;
    use crate::view::Camera;
    use glam::{UVec2, Vec2, Vec3};

    /// Returns footage of three cameras at two times; the first camera is for the test.
    fn source(folder: &Path) -> Source {
        let shot = |index: usize| {
            let (camera, time) = (index / 2, (index % 2) as f32);
            let size = UVec2::new(8, 6);
            let eye = Vec3::new(camera as f32 + 1.0, 2.0, 3.0);
            let mut at = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, size);
            if camera > 0 {
                at.lens = Lens::Intrinsics { focal: Vec2::new(9.0, 8.5), center: Vec2::new(4.25, 3.0) };
            }
            let image = folder.join(format!("{index}.png"));
            let picture = RgbImage::from_pixel(8, 6, Rgb([index as u8, 100, 200]));
            picture.save(&image).expect("the folder can be written to");
            let split = if camera == 0 { Split::Test } else { Split::Train };
            let (original, correction) = (size, Correction::default());
            let view =
                TrainingView { name: index.to_string(), camera: at, time, original, image, mask: None, correction };
            Shot { view, split, camera, name: format!("{:03}", index % 2) }
        };
        let cameras = ["left", "middle", "right"].map(str::to_owned).into();
        let clock = Clock { unit_seconds: 2.5, is_numbered: false };
        Source { cameras, shots: (0..6).map(shot).collect(), clock, points: None }
    }

    #[test]
    fn the_dataset_has_the_cameras_times_and_splits_of_the_footage() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("out");
        fs::create_dir(&out).expect("the folder can be made");
        let source = source(folder.path());
        let written = Written::of(&source, None, &out, &mut NoProgress).expect("the pictures can be linked");
        assert_eq!(written.pictures.len(), 6, "a file for each picture");
        assert!(written.is_in(&out), "all are there");
        for (split, count) in [(Split::Train, 4), (Split::Test, 2)] {
            let read = Dataset::open(&out, split, &CameraOptions::default()).expect("the dataset can be read");
            assert_eq!((read.views.len(), read.clock), (count, source.clock), "views of {split:?}, and their clock");
            let expected = source.shots.iter().filter(|shot| shot.split == split);
            for (found, Shot { view, .. }) in read.views.iter().zip(expected) {
                let (camera, pose) = (found.camera, found.camera.world_to_camera);
                assert!(pose.abs_diff_eq(view.camera.world_to_camera, 1e-5), "the pose of {}", view.name);
                assert_eq!((camera.size, found.time), (view.camera.size, view.time), "size and time of {}", view.name);
                assert_eq!(
                    std::mem::discriminant(&camera.lens),
                    std::mem::discriminant(&view.camera.lens),
                    "the kind of the lens of {}",
                    view.name
                );
                let pictures = [found, view].map(|view| view.load_covered().expect("the image can be read"));
                assert_eq!(pictures[0], pictures[1], "the picture of {}", view.name);
            }
        }
    }

    #[test]
    fn coverage_is_written_as_alpha() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.png");
        let texels = vec![[100, 50, 0, 200], [0, 0, 0, 0], [255, 255, 255, 255]];
        let covered = CoveredImage { size: UVec2::new(3, 1), texels, has_gaps: true };
        let mut writer = BufWriter::new(File::create(&path).expect("the folder can be written to"));
        encode(&covered, &mut writer).expect("the picture can be written");
        drop(writer);
        let read = image::open(&path).expect("the picture can be read").into_rgba8();
        let pixels: Vec<[u8; 4]> = read.pixels().map(|pixel| pixel.0).collect();
        assert_eq!(pixels, [[128, 64, 0, 200], [0, 0, 0, 0], [255; 4]], "colors before the multiplication");
    }
}
