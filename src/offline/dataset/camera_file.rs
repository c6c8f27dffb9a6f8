//! Camera files.
//!
//! In: a `transforms*.json` (Blender form, OpenGL axes) or a `golden*.json` (list `views`, OpenCV axes). Out: [`TrainingView`]s in file
//! order, cameras in OpenCV axes at the size to render.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DMat4, DVec2, DVec4, Mat4, UVec2};
use serde::Deserialize;
use serde_json::Value;

use super::lens::{LensEntries, OriginalLens, check_centered, check_pinhole, checked_size, reduced};
use super::{DatasetError, FrameProblem, MAX_SIDE, Split, TrainingView};
use crate::codec::text::is_obeyed;
use crate::offline::picture_file;
use crate::view::{Camera, RasterFov};

/// Below this share of the product of its columns' lengths, a determinant counts as zero.
const SINGULAR: f64 = 1e-9;

/// How to read a camera file. Default: all `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CameraOptions {
    /// Picture size in pixels, instead of the file's. The field of view stays that of the original pictures on both
    /// axes, so that another aspect ratio gives pixels that are not square. If the original size is unknown, this one
    /// is used for it.
    pub size: Option<UVec2>,
    /// The original's `--resolution`: 1, 2, 3, 4 or 8 divide the size, −1 limits the width to 1600 pixels, any other
    /// number is a target width. It has no effect on golden views or with an explicit `size`.
    pub resolution: Option<i32>,
    /// First and last time, both included: frames outside are dropped.
    pub time_interval: Option<[f32; 2]>,
}

/// A camera file, parsed as JSON but not interpreted.
#[derive(Debug, Clone)]
pub struct CameraFile {
    path: PathBuf,
    form: Form,
    json: Value,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// A list `frames`: the Blender form.
    Transforms,
    /// A list `views`: the original's renders, kept beside a capture. Always FoV cameras.
    Golden,
}

/// One frame of the Blender form, without its lens.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct TransformsFrame {
    file_path: String,
    transform_matrix: [[f64; 4]; 4],
    #[serde(default)]
    time: f64,
    mask_path: Option<String>,
}

/// One golden view. Its principal point is the center.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct GoldenFrame {
    file: String,
    #[serde(default)]
    time: f64,
    width: f64,
    height: f64,
    fl_x: f64,
    fl_y: f64,
    cx: Option<f64>,
    cy: Option<f64>,
    world_to_camera_opencv: [[f64; 4]; 4],
}

/// A frame of either form.
struct Frame {
    file: String,
    mask: Option<String>,
    time: f32,
    world_to_camera: Mat4,
    /// Size of the original picture; `None` if the file does not have it.
    size: Option<UVec2>,
    lens: OriginalLens,
}

impl CameraFile {
    /// Reads the cameras of a file. Images need not be on disk, unless the picture size is found nowhere else.
    ///
    /// The picture size is `options.size`, else `w` and `h` of the frame or the file, else that of the first image found, in this file
    /// or the folder's other splits; the latter two after `options.resolution`.
    ///
    /// # Errors
    /// [`DatasetError`], naming the file, the frame and the reason.
    pub fn load(path: &Path, options: &CameraOptions) -> Result<Vec<TrainingView>, DatasetError> {
        if let Some(size) = options.size.filter(|size| size.min_element() == 0 || size.max_element() > MAX_SIDE) {
            return Err(DatasetError::Size { size });
        }
        Self::read(path)?.views(options)
    }

    /// Returns whether a file has the sizes of its views, on which [`resolution`](CameraOptions::resolution) has no effect.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn ignores_resolution(path: &Path) -> Result<bool, DatasetError> {
        Ok(Self::read(path)?.form == Form::Golden)
    }

    fn read(path: &Path) -> Result<Self, DatasetError> {
        let bytes = fs::read(path).map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })?;
        let json: Value =
            serde_json::from_slice(&bytes).map_err(|reason| DatasetError::Json { path: path.to_owned(), reason })?;
        let has_list = |form: &Form| json.get(form.list_name()).is_some_and(Value::is_array);
        match [Form::Transforms, Form::Golden].into_iter().find(has_list) {
            Some(form) => Ok(Self { path: path.to_owned(), form, json }),
            None => Err(DatasetError::UnknownForm { path: path.to_owned() }),
        }
    }

    fn entries(&self) -> &[Value] {
        self.json.get(self.form.list_name()).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    fn views(&self, options: &CameraOptions) -> Result<Vec<TrainingView>, DatasetError> {
        let frames = self.frames()?;
        let times = || frames.iter().map(|frame| frame.time);
        let (Some(first), Some(last)) = (times().reduce(f32::min), times().reduce(f32::max)) else {
            return Err(DatasetError::NoFrames { path: self.path.clone() });
        };
        let probed = if frames.iter().any(|frame| frame.size.is_none()) { self.probe_size(options)? } else { None };
        let mut names = HashSet::new();
        let mut views = Vec::new();
        for (index, frame) in frames.into_iter().enumerate() {
            let view = self.view(index, frame, probed, options, &mut names)?;
            if options.time_interval.is_none_or(|[start, end]| (start..=end).contains(&view.time)) {
                views.push(view);
            }
        }
        match options.time_interval {
            Some(interval) if views.is_empty() => {
                Err(DatasetError::NoFramesInInterval { path: self.path.clone(), interval, times: [first, last] })
            }
            _ => Ok(views),
        }
    }

    fn frames(&self) -> Result<Vec<Frame>, DatasetError> {
        let shared = LensEntries::deserialize(&self.json)
            .map_err(|reason| DatasetError::Json { path: self.path.clone(), reason })?;
        let parse = |entry| {
            check_pinhole(entry, &self.json)?;
            match self.form {
                Form::Transforms => transforms_frame(entry, &shared),
                Form::Golden => golden_frame(entry),
            }
        };
        self.entries()
            .iter()
            .enumerate()
            .map(|(i, entry)| parse(entry).map_err(|problem| self.frame_error(i, problem)))
            .collect()
    }

    /// Returns the size of the first image on disk; `None` if there is none. An unreadable image is an error only if
    /// nothing else gives the size.
    fn probe_size(&self, options: &CameraOptions) -> Result<Option<UVec2>, DatasetError> {
        let found = self.images().find(|path| path.is_file()).or_else(|| self.sibling_image());
        match found.map(|path| picture_file::size(&path, UVec2::splat(MAX_SIDE))) {
            Some(Err(error)) if options.size.is_none() => Err(error.into()),
            size => Ok(size.and_then(Result::ok)),
        }
    }

    fn sibling_image(&self) -> Option<PathBuf> {
        let siblings = Split::ALL.map(|split| self.folder().join(split.file_name()));
        siblings
            .into_iter()
            .filter(|path| *path != self.path)
            .filter_map(|path| Self::read(&path).ok())
            .find_map(|file| file.images().find(|path| path.is_file()))
    }

    /// Returns the paths of the images that the entries name.
    fn images(&self) -> impl Iterator<Item = PathBuf> {
        let files = self.entries().iter().filter_map(move |entry| entry.get(self.form.file_key())?.as_str());
        files.map(move |file| self.folder().join(with_image_extension(file)))
    }

    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    fn frame_error(&self, frame: usize, problem: FrameProblem) -> DatasetError {
        DatasetError::Frame { path: self.path.clone(), frame, problem }
    }

    fn view(
        &self,
        index: usize,
        frame: Frame,
        probed: Option<UVec2>,
        options: &CameraOptions,
        names: &mut HashSet<String>,
    ) -> Result<TrainingView, DatasetError> {
        let original = frame.size.or(probed).or(options.size);
        let original = original.ok_or_else(|| DatasetError::SizeUnknown { path: self.path.clone() })?;
        let (size, divisor) = match (options.size, self.form) {
            (Some(size), _) => (size, original.as_dvec2() / size.as_dvec2()),
            (None, Form::Golden) => (original, DVec2::ONE),
            (None, Form::Transforms) => {
                let (size, divisor) = reduced(original, options.resolution)?;
                (size, DVec2::splat(divisor))
            }
        };
        let lens = frame.lens.scaled(original, divisor).map_err(|problem| self.frame_error(index, problem))?;
        let file = with_image_extension(&frame.file);
        let unnamed = |path: &str| self.frame_error(index, FrameProblem::FileName(path.to_owned()));
        let name = output_name(&file, index, names).ok_or_else(|| unnamed(&frame.file))?;
        if let Some(mask) = frame.mask.as_deref().filter(|mask| mask.contains(is_obeyed)) {
            return Err(unnamed(mask));
        }
        let camera = Camera { world_to_camera: frame.world_to_camera, size, lens };
        let is_finite = |fov| camera.view(frame.time, fov).is_finite();
        if ![RasterFov::Reference, RasterFov::Corrected].into_iter().all(is_finite) {
            return Err(self.frame_error(index, FrameProblem::Projection(name)));
        }
        Ok(TrainingView {
            name,
            camera,
            time: frame.time,
            original,
            image: self.folder().join(file),
            mask: frame.mask.map(|mask| self.folder().join(with_image_extension(&mask))),
        })
    }
}

impl Form {
    fn list_name(self) -> &'static str {
        match self {
            Self::Transforms => "frames",
            Self::Golden => "views",
        }
    }

    fn file_key(self) -> &'static str {
        match self {
            Self::Transforms => "file_path",
            Self::Golden => "file",
        }
    }
}

fn transforms_frame(entry: &Value, shared: &LensEntries) -> Result<Frame, FrameProblem> {
    let frame = TransformsFrame::deserialize(entry).map_err(FrameProblem::Malformed)?;
    let entries = LensEntries::deserialize(entry).map_err(FrameProblem::Malformed)?.or(shared);
    let mut camera_to_world = pose(&frame.transform_matrix)?;
    // OpenGL axes to OpenCV axes: the camera's y and z are negated.
    camera_to_world.y_axis = -camera_to_world.y_axis;
    camera_to_world.z_axis = -camera_to_world.z_axis;
    Ok(Frame {
        file: frame.file_path,
        mask: frame.mask_path,
        time: finite_time(frame.time)?,
        world_to_camera: single_precision(camera_to_world.inverse())?,
        size: entries.size()?,
        lens: entries.lens()?,
    })
}

fn golden_frame(entry: &Value) -> Result<Frame, FrameProblem> {
    let frame = GoldenFrame::deserialize(entry).map_err(FrameProblem::Malformed)?;
    check_centered("cx", frame.cx, frame.width)?;
    check_centered("cy", frame.cy, frame.height)?;
    let tangents = DVec2::new(frame.width / (2.0 * frame.fl_x), frame.height / (2.0 * frame.fl_y));
    Ok(Frame {
        file: frame.file,
        mask: None,
        time: finite_time(frame.time)?,
        world_to_camera: single_precision(pose(&frame.world_to_camera_opencv)?)?,
        size: Some(checked_size(frame.width, frame.height)?),
        lens: OriginalLens::Tangents(tangents),
    })
}

fn finite_time(time: f64) -> Result<f32, FrameProblem> {
    let narrow = time as f32;
    if narrow.is_finite() { Ok(narrow) } else { Err(FrameProblem::Time(time)) }
}

/// Returns the matrix with these rows, which must be finite, affine and invertible.
fn pose(rows: &[[f64; 4]; 4]) -> Result<DMat4, FrameProblem> {
    let matrix = DMat4::from_cols_array_2d(rows).transpose();
    if !matrix.is_finite() {
        return Err(FrameProblem::Matrix("holds a value that is not finite"));
    }
    if !matrix.row(3).abs_diff_eq(DVec4::W, 1e-6) {
        return Err(FrameProblem::Matrix("must end in the row 0 0 0 1"));
    }
    if is_invertible(matrix) { Ok(matrix) } else { Err(FrameProblem::Matrix("cannot be inverted")) }
}

fn single_precision(matrix: DMat4) -> Result<Mat4, FrameProblem> {
    let narrow = matrix.as_mat4();
    let usable = narrow.is_finite() && is_invertible(narrow.as_dmat4());
    if usable { Ok(narrow) } else { Err(FrameProblem::Matrix("is too large or too small for float32")) }
}

/// Returns whether the linear part is invertible; false if its determinant overflows.
fn is_invertible(matrix: DMat4) -> bool {
    let linear = DMat3::from_mat4(matrix);
    let volume = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
    volume.is_finite() && linear.determinant().abs() > SINGULAR * volume
}

/// Appends `.png` unless the path ends in the extension of an image.
fn with_image_extension(file: &str) -> String {
    let extension = Path::new(file).extension().unwrap_or_default();
    let known = ["png", "jpg", "jpeg"].iter().any(|known| extension.eq_ignore_ascii_case(known));
    if known { file.to_owned() } else { format!("{file}.png") }
}

/// Returns the stem of an image path, made unique with the index of the frame; `None` if it is not a plain file name, or
/// the path has characters that a terminal obeys: it is shown in reports and errors.
fn output_name(file: &str, index: usize, taken: &mut HashSet<String>) -> Option<String> {
    if file.contains(is_obeyed) {
        return None;
    }
    let path = Path::new(file);
    let stem = path.extension().and(path.file_stem())?.to_str()?;
    if Path::new(stem).file_name()? != stem {
        return None;
    }
    let mut name = stem.to_owned();
    while !taken.insert(name.clone()) {
        name = format!("{name}-{index}");
    }
    Some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extension_is_appended_only_where_there_is_none() {
        assert_eq!(with_image_extension("./test/r_000"), "./test/r_000.png", "D-NeRF");
        assert_eq!(with_image_extension("a/b.JPG"), "a/b.JPG", "any case");
        assert_eq!(with_image_extension("a/b.jpeg"), "a/b.jpeg", "jpeg");
        assert_eq!(with_image_extension("cam00/frame.001"), "cam00/frame.001.png", "a dot is not an extension");
    }

    #[test]
    fn output_names_are_stems_and_unique() {
        let mut taken = HashSet::new();
        assert_eq!(output_name("./images/c04_f00.jpg", 0, &mut taken).as_deref(), Some("c04_f00"), "stem");
        assert_eq!(output_name("x/frame.001.png", 1, &mut taken).as_deref(), Some("frame.001"), "dots stay");
        assert_eq!(output_name("y/c04_f00.png", 2, &mut taken).as_deref(), Some("c04_f00-2"), "a repeated stem");
        assert_eq!(output_name("...png", 3, &mut taken), None, "would leave the folder");
        assert_eq!(output_name(".png", 4, &mut taken), None, "an empty path");
        assert_eq!(output_name("a\u{1b}[2J/b.png", 5, &mut taken), None, "would clear the terminal");
    }

    #[test]
    fn poses_are_checked() {
        let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let with = |row: usize, column: usize, value: f64| {
            let mut rows = identity;
            rows[row][column] = value;
            pose(&rows).is_ok()
        };
        assert!(with(0, 3, 5.0), "a translation");
        assert!(!with(1, 1, 0.0), "singular");
        assert!(!with(1, 1, f64::NAN) && !with(0, 3, f64::INFINITY), "not finite");
        assert!(!with(3, 3, 2.0), "not affine");
        let huge = DMat4::from_scale(glam::DVec3::splat(1e60));
        assert!(single_precision(huge).is_err() && single_precision(huge.inverse()).is_err(), "beyond float32");
    }
}
