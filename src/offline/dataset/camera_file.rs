//! Camera files.
//!
//! In: a `transforms*.json` (Blender form, OpenGL axes) or a `golden*.json` (list `views`, OpenCV axes). Out: [`TrainingView`]s in file
//! order, cameras in OpenCV axes at the size to render.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec2, Mat4, UVec2};
use serde::Deserialize;
use serde_json::Value;

use super::camera_options::{CameraOptions, check_size};
use super::clock::Clock;
use super::distortion::Distortion;
use super::frame::{Frame, Mask, output_name};
use super::lens::{LensEntries, OriginalLens, check_centered, check_pinhole, checked_size, distortion};
use super::masks;
use super::numbered::{FRAME_RATE, IMAGE_EXTENSIONS};
use super::pose::{pose, single_precision};
use super::{DatasetError, FrameProblem, MAX_SIDE, Split, TrainingView};
use crate::codec::text::is_obeyed;
use crate::offline::picture_file;

/// Name of the camera file of a nerfstudio dataset.
pub(super) const SINGLE: &str = "transforms.json";

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
    /// A list `views`: pictures drawn by the original, beside a capture. Always FoV cameras.
    Golden,
}

/// One frame of the Blender form, without its lens.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct TransformsFrame {
    file_path: String,
    transform_matrix: [[f64; 4]; 4],
    time: Option<f64>,
    /// The number of the frame in its video, instead of a time.
    frame_number: Option<f64>,
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
struct Parsed {
    file: String,
    mask: Option<String>,
    time: f32,
    world_to_camera: Mat4,
    /// Size of the original picture; `None` if the file does not have it.
    size: Option<UVec2>,
    lens: OriginalLens,
    distortion: Distortion,
}

impl CameraFile {
    /// Reads the cameras of a file. Images need not be on disk, unless the picture size comes from them.
    ///
    /// The picture size is `options.size`, else `w` and `h` of the frame or the file, else the size of the first image found, of this
    /// file or of the other splits of the folder; the sizes of files and images are reduced by `options.resolution`.
    ///
    /// # Errors
    /// [`DatasetError`], naming the file, the frame and the reason.
    pub fn load(path: &Path, options: &CameraOptions) -> Result<Vec<TrainingView>, DatasetError> {
        options.size.map_or(Ok(()), check_size)?;
        Self::read(path)?.views(options)
    }

    /// Returns whether a file has the sizes of its views, on which [`resolution`](CameraOptions::resolution) has no effect.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn ignores_resolution(path: &Path) -> Result<bool, DatasetError> {
        Ok(Self::read(path)?.form == Form::Golden)
    }

    pub(super) fn read(path: &Path) -> Result<Self, DatasetError> {
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

    pub(super) fn views(&self, options: &CameraOptions) -> Result<Vec<TrainingView>, DatasetError> {
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

    fn frames(&self) -> Result<Vec<Parsed>, DatasetError> {
        let shared = LensEntries::deserialize(&self.json)
            .map_err(|reason| DatasetError::Json { path: self.path.clone(), reason })?;
        let first = self.first_number().unwrap_or(0.0);
        let parse = |entry| match self.form {
            Form::Transforms => transforms_frame(entry, &shared, &self.json, first),
            Form::Golden => golden_frame(entry, &self.json),
        };
        self.entries()
            .iter()
            .enumerate()
            .map(|(i, entry)| parse(entry).map_err(|problem| self.frame_error(i, problem)))
            .collect()
    }

    /// Returns the size of the first image on disk; `None` if there is none. An unreadable image is an error only if
    /// `options` has no size.
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
        frame: Parsed,
        probed: Option<UVec2>,
        options: &CameraOptions,
        names: &mut HashSet<String>,
    ) -> Result<TrainingView, DatasetError> {
        let original = frame.size.or(probed).or(options.size);
        let original = original.ok_or_else(|| DatasetError::SizeUnknown { path: self.path.clone() })?;
        let file = with_image_extension(&frame.file);
        let unnamed = |path: &str| self.frame_error(index, FrameProblem::FileName(path.to_owned()));
        let name = output_name(&file, index, names).ok_or_else(|| unnamed(&frame.file))?;
        if let Some(mask) = frame.mask.as_deref().filter(|mask| mask.contains(is_obeyed)) {
            return Err(unnamed(mask));
        }
        let has_masks = self.form == Form::Transforms;
        let beside = has_masks.then(|| masks::beside(self.folder(), Path::new(&file))).flatten();
        // Images of the Blender form have been multiplied by the masks that their frames name.
        let named = frame.mask.map(|mask| self.folder().join(with_image_extension(&mask)));
        let applied = named.is_some() && !self.is_single();
        let frame = Frame {
            name,
            image: self.folder().join(file),
            mask: named.or(beside).map(|path| Mask { path, applied }),
            time: frame.time,
            world_to_camera: frame.world_to_camera,
            lens: frame.lens,
            distortion: frame.distortion,
        };
        let reducible = self.form == Form::Transforms;
        frame.into_view(original, options, reducible, |problem| self.frame_error(index, problem))
    }

    /// Returns whether this is the single file of a nerfstudio dataset.
    fn is_single(&self) -> bool {
        self.form == Form::Transforms && self.path.file_name().is_some_and(|name| name == SINGLE)
    }

    /// Returns what the times mean: films have the entry `seconds`, the seconds of the times 0 and 1; frames of a single file may have numbers in place
    /// of times.
    pub(super) fn clock(&self) -> Clock {
        let seconds = self.entry("seconds").and_then(|entry| <[f32; 2]>::deserialize(entry).ok());
        let length = seconds.map(|[first, last]| last - first).filter(|length| length.is_finite() && *length > 0.0);
        match length {
            Some(unit_seconds) => Clock { unit_seconds, is_numbered: false },
            None if self.first_number().is_some() => Clock::NUMBERED,
            None => Clock::default(),
        }
    }

    /// Returns the least number of a frame, which is time 0, if the frames of a single file have numbers and no times. Files of splits have no first
    /// number in common.
    fn first_number(&self) -> Option<f64> {
        let is_timed = |entry: &Value| entry.get("time").is_some_and(|time| !time.is_null());
        if !self.is_single() || self.entries().iter().any(is_timed) {
            return None;
        }
        let numbers = self.entries().iter().filter_map(|entry| entry.get("frame_number")?.as_f64());
        numbers.reduce(f64::min)
    }

    /// Returns an entry of the whole file.
    pub(super) fn entry(&self, name: &str) -> Option<&Value> {
        self.json.get(name)
    }

    /// Returns, for each frame in file order, its path and its entry `split`, where the file has them.
    pub(super) fn splits(&self) -> impl Iterator<Item = (Option<&str>, Option<&str>)> {
        self.entries()
            .iter()
            .map(|entry| (entry.get("file_path").and_then(Value::as_str), entry.get("split").and_then(Value::as_str)))
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

/// Reads a frame of the Blender form. The number `first` is time 0.
fn transforms_frame(entry: &Value, shared: &LensEntries, file: &Value, first: f64) -> Result<Parsed, FrameProblem> {
    let frame = TransformsFrame::deserialize(entry).map_err(FrameProblem::Malformed)?;
    let entries = LensEntries::deserialize(entry).map_err(FrameProblem::Malformed)?.or(shared);
    let mut camera_to_world = pose(&frame.transform_matrix)?;
    // OpenGL axes to OpenCV axes: the camera's y and z are negated.
    camera_to_world.y_axis = -camera_to_world.y_axis;
    camera_to_world.z_axis = -camera_to_world.z_axis;
    let by_number = frame.frame_number.map(|number| (number - first) / FRAME_RATE);
    Ok(Parsed {
        file: frame.file_path,
        mask: frame.mask_path,
        time: finite_time(frame.time.or(by_number).unwrap_or(0.0))?,
        world_to_camera: single_precision(camera_to_world.inverse())?,
        size: entries.size()?,
        lens: entries.lens()?,
        distortion: distortion(entry, file)?,
    })
}

fn golden_frame(entry: &Value, file: &Value) -> Result<Parsed, FrameProblem> {
    check_pinhole(entry, file)?;
    let frame = GoldenFrame::deserialize(entry).map_err(FrameProblem::Malformed)?;
    check_centered("cx", frame.cx, frame.width)?;
    check_centered("cy", frame.cy, frame.height)?;
    let tangents = DVec2::new(frame.width / (2.0 * frame.fl_x), frame.height / (2.0 * frame.fl_y));
    Ok(Parsed {
        file: frame.file,
        mask: None,
        time: finite_time(frame.time)?,
        world_to_camera: single_precision(pose(&frame.world_to_camera_opencv)?)?,
        size: Some(checked_size(frame.width, frame.height)?),
        lens: OriginalLens::Tangents(tangents),
        distortion: Distortion::default(),
    })
}

fn finite_time(time: f64) -> Result<f32, FrameProblem> {
    let narrow = time as f32;
    if narrow.is_finite() { Ok(narrow) } else { Err(FrameProblem::Time(time)) }
}

/// Appends `.png` unless the path ends in the extension of an image.
fn with_image_extension(file: &str) -> String {
    let extension = Path::new(file).extension().unwrap_or_default();
    let known = IMAGE_EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known));
    if known { file.to_owned() } else { format!("{file}.png") }
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
}
