//! Camera files.
//!
//! In: a `transforms*.json` (Blender form, OpenGL axes) or a `golden*.json` (list `views`, OpenCV axes). Out:
//! [`TrainingView`]s in file order, cameras in OpenCV axes at the size to render, counted from an origin.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec2, UVec2};
use serde::Deserialize;
use serde_json::Value;

use super::named_images::{NamedImages, named};
use super::numbered::FRAME_RATE;
use super::{json, masks};
use crate::codec::text::{is_obeyed, printable};
use crate::offline::dataset::cameras::camera_options::{CameraOptions, check_size};
use crate::offline::dataset::cameras::clock::Clock;
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::lens::{
    LensEntries, OriginalLens, check_centered, check_pinhole, checked_size, distortion,
};
use crate::offline::dataset::cameras::lens_matrix;
use crate::offline::dataset::cameras::origin;
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::cameras::pose;
use crate::offline::dataset::cameras::pose::{pose, rows};
use crate::offline::dataset::{DatasetError, FrameProblem, MAX_SIDE, Split, TrainingView};
use crate::offline::picture_file;
use crate::scene::Origin;

/// Name of the camera file of a nerfstudio dataset.
pub(crate) const SINGLE: &str = "transforms.json";

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
    transform_matrix: Value,
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
    time: Option<f64>,
    width: f64,
    height: f64,
    fl_x: f64,
    fl_y: f64,
    cx: Option<f64>,
    cy: Option<f64>,
    world_to_camera_opencv: Value,
}

/// A frame of either form.
struct Parsed {
    file: String,
    mask: Option<String>,
    time: Option<f64>,
    world_to_camera: DMat4,
    /// Size of the original picture; `None` if the file does not have it.
    size: Option<UVec2>,
    lens: OriginalLens,
    distortion: Distortion,
}

impl CameraFile {
    /// Reads the cameras of a file. Images need not be on disk, unless the picture size comes from them.
    ///
    /// The picture size is `options.size`, else `w` and `h` of the frame or the file, else the size of the first image
    /// found, of this file or of the other splits of the folder; the sizes of files and images are reduced by
    /// `options.resolution`. Places and times are counted from `options.origin`, else from an origin that follows from
    /// the frames of this file.
    ///
    /// # Errors
    /// [`DatasetError`], naming the file, the frame and the reason.
    pub fn load(path: &Path, options: &CameraOptions) -> Result<Vec<TrainingView>, DatasetError> {
        options.size.map_or(Ok(()), check_size)?;
        Ok(Self::read(path)?.views(options)?.views)
    }

    /// Returns whether a file has the sizes of its views, on which [`resolution`](CameraOptions::resolution) has no
    /// effect.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn ignores_resolution(path: &Path) -> Result<bool, DatasetError> {
        Ok(Self::read(path)?.form == Form::Golden)
    }

    pub(crate) fn read(path: &Path) -> Result<Self, DatasetError> {
        let json = json::read(path)?;
        let has_list = |form: &Form| json.get(form.list_name()).is_some_and(Value::is_array);
        match [Form::Transforms, Form::Golden].into_iter().find(has_list) {
            Some(form) => Ok(Self { path: path.to_owned(), form, json }),
            None => Err(DatasetError::UnknownForm { path: path.to_owned() }),
        }
    }

    fn entries(&self) -> &[Value] {
        self.json.get(self.form.list_name()).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    /// Returns the views of the frames within the time interval of the options.
    pub(crate) fn views(&self, options: &CameraOptions) -> Result<Placed, DatasetError> {
        let frames = self.frames(options.is_static)?;
        if frames.is_empty() {
            return Err(DatasetError::NoFrames { path: self.path.clone() });
        }
        let probed = if frames.iter().any(|frame| frame.size.is_none()) { self.probe_size(options)? } else { None };
        let (images, mut names) = (NamedImages::of(self.folder()), HashSet::new());
        let mut unplaced = Vec::new();
        for (index, frame) in frames.into_iter().enumerate() {
            let original = frame.size.or(probed).or(options.size);
            let original = original.ok_or_else(|| DatasetError::SizeUnknown { path: self.path.clone() })?;
            let frame = self.frame(index, frame, &images, &mut names)?;
            unplaced.push(Unplaced { frame, original, failed: move |problem| self.frame_error(index, problem) });
        }
        let mut placed = place(unplaced, options, self.form == Form::Transforms)?;
        placed.notes.extend(images.note());
        self.keep_inside(&mut placed, options.time_interval)?;
        Ok(placed)
    }

    /// Leaves out the views outside an interval.
    fn keep_inside(&self, placed: &mut Placed, interval: Option<[f32; 2]>) -> Result<(), DatasetError> {
        let Some(interval @ [start, end]) = interval else { return Ok(()) };
        let times = placed.views.iter().map(|view| view.time);
        let times =
            times.fold([f32::INFINITY, f32::NEG_INFINITY], |[first, last], time| [first.min(time), last.max(time)]);
        placed.views.retain(|view| (start..=end).contains(&view.time));
        if !placed.views.is_empty() {
            return Ok(());
        }
        Err(DatasetError::NoFramesInInterval { path: self.path.clone(), interval, times, origin: placed.origin.time })
    }

    /// Returns the frames of the file. Unless the scene is at rest, all of them have a time, or none.
    fn frames(&self, is_static: bool) -> Result<Vec<Parsed>, DatasetError> {
        let shared = LensEntries::deserialize(&self.json)
            .map_err(|reason| DatasetError::Json { path: self.path.clone(), reason })?;
        // A number is no time beside times, which may be shares of an interval.
        let first = (!self.has_entry("time")).then(|| self.first_number().unwrap_or(0.0));
        let parse = |entry| match self.form {
            Form::Transforms => transforms_frame(entry, &shared, &self.json, first),
            Form::Golden => golden_frame(entry, &self.json),
        };
        let frames: Vec<Parsed> = self
            .entries()
            .iter()
            .enumerate()
            .map(|(i, entry)| parse(entry).map_err(|problem| self.frame_error(i, problem)))
            .collect::<Result<_, _>>()?;
        let is_timed = !is_static && frames.iter().any(|frame| frame.time.is_some());
        match frames.iter().position(|frame| is_timed && frame.time.is_none()) {
            Some(index) => Err(self.untimed(index, &frames[index].file)),
            None => Ok(frames),
        }
    }

    /// Returns the error of a frame without a time beside others that have one.
    fn untimed(&self, frame: usize, file: &str) -> DatasetError {
        self.frame_error(frame, FrameProblem::NoTime(printable(file)))
    }

    /// Returns the origin that the splits of a folder have in common, that of the training split; `None` if it cannot
    /// be used, or is this file.
    ///
    /// # Errors
    /// Frames without a time if the training split has times.
    pub(crate) fn common_origin(
        &self,
        folder: &Path,
        split: Split,
        is_static: bool,
    ) -> Result<Option<Origin>, DatasetError> {
        let train = Some(folder.join(Split::Train.file_name())).filter(|_| split != Split::Train);
        let Some(train) = train.and_then(|path| Self::read(&path).ok()) else { return Ok(None) };
        if !is_static {
            self.require_times_as(&train)?;
        }
        Ok(train.origin(is_static))
    }

    /// Checks that frames have times if those of the training split have others than 0.
    fn require_times_as(&self, train: &Self) -> Result<(), DatasetError> {
        let moves = train.entries().iter().any(|entry| {
            let number = |name: &str| entry.get(name).and_then(Value::as_f64);
            number("time").or(number("frame_number")).is_some_and(|time| time != 0.0)
        });
        match self.entries().first().and_then(|entry| entry.get(self.form.file_key())) {
            Some(file) if moves && !self.has_entry("time") && !self.has_entry("frame_number") => {
                Err(self.untimed(0, file.as_str().unwrap_or_default()))
            }
            _ => Ok(()),
        }
    }

    /// Returns the origin that the frames have unless one is given; `None` if a frame cannot be used.
    fn origin(&self, is_static: bool) -> Option<Origin> {
        let frames = self.frames(is_static).ok()?;
        let times: Vec<f64> = frames.iter().map(|frame| frame.time.filter(|_| !is_static).unwrap_or(0.0)).collect();
        Some(origin::automatic(frames.iter().map(|frame| pose::center(&frame.world_to_camera)).collect(), &times))
    }

    /// Returns the size of the first image on disk; `None` if there is none. An unreadable image is an error only if
    /// `options` has no size.
    fn probe_size(&self, options: &CameraOptions) -> Result<Option<UVec2>, DatasetError> {
        let images = NamedImages::of(self.folder());
        let found = self.first_image(&images).or_else(|| self.sibling_image(&images));
        match found.map(|path| picture_file::size(&path, UVec2::splat(MAX_SIDE))) {
            Some(Err(error)) if options.size.is_none() => Err(error.into()),
            size => Ok(size.and_then(Result::ok)),
        }
    }

    fn sibling_image(&self, images: &NamedImages<'_>) -> Option<PathBuf> {
        let siblings = Split::ALL.map(|split| self.folder().join(split.file_name()));
        siblings
            .into_iter()
            .filter(|path| *path != self.path)
            .filter_map(|path| Self::read(&path).ok())
            .find_map(|file| file.first_image(images))
    }

    /// Returns the first image on disk that an entry names.
    fn first_image(&self, images: &NamedImages<'_>) -> Option<PathBuf> {
        let files = self.entries().iter().filter_map(|entry| entry.get(self.form.file_key())?.as_str());
        files.map(|file| images.find(file)).find(|path| path.is_file())
    }

    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    fn frame_error(&self, frame: usize, problem: FrameProblem) -> DatasetError {
        DatasetError::Frame { path: self.path.clone(), frame, problem }
    }

    fn frame(
        &self,
        index: usize,
        frame: Parsed,
        images: &NamedImages<'_>,
        names: &mut HashSet<String>,
    ) -> Result<Frame, DatasetError> {
        let unnamed = |path: &str| self.frame_error(index, FrameProblem::FileName(path.to_owned()));
        let name = output_name(&named(&frame.file), index, names).ok_or_else(|| unnamed(&frame.file))?;
        if let Some(mask) = frame.mask.as_deref().filter(|mask| mask.contains(is_obeyed)) {
            return Err(unnamed(mask));
        }
        let image = images.find(&frame.file);
        let has_masks = self.form == Form::Transforms;
        let beside = has_masks.then(|| masks::beside(self.folder(), &image)).flatten();
        // Images of the Blender form have been multiplied by the masks that their frames name.
        let mask = frame.mask.map(|mask| images.find(&mask));
        let applied = mask.is_some() && !self.is_single();
        Ok(Frame {
            name,
            image,
            mask: mask.or(beside).map(|path| Mask { path, applied }),
            time: frame.time.unwrap_or(0.0),
            world_to_camera: frame.world_to_camera,
            lens: frame.lens,
            distortion: frame.distortion,
        })
    }

    /// Returns whether this is the single file of a nerfstudio dataset.
    fn is_single(&self) -> bool {
        self.form == Form::Transforms && self.path.file_name().is_some_and(|name| name == SINGLE)
    }

    /// Returns the meaning of the times: films have the entry `seconds`, the seconds of the times 0 and 1; frames may
    /// have numbers in place of times.
    pub(crate) fn clock(&self) -> Clock {
        let seconds = self.entry("seconds").and_then(|entry| <[f32; 2]>::deserialize(entry).ok());
        let length = seconds.map(|[first, last]| last - first).filter(|length| length.is_finite() && *length > 0.0);
        match length {
            Some(unit_seconds) => Clock { unit_seconds, is_numbered: false },
            None if self.is_numbered() => Clock::NUMBERED,
            None => Clock::default(),
        }
    }

    /// Returns the least number of a frame, which is time 0, if the frames of a single file have numbers and no times.
    /// Files of splits have no first number in common.
    fn first_number(&self) -> Option<f64> {
        if !self.is_single() || !self.is_numbered() {
            return None;
        }
        let numbers = self.entries().iter().filter_map(|entry| entry.get("frame_number")?.as_f64());
        numbers.reduce(f64::min)
    }

    /// Returns whether frames have numbers in place of times.
    fn is_numbered(&self) -> bool {
        self.form == Form::Transforms && !self.has_entry("time") && self.has_entry("frame_number")
    }

    /// Returns whether a frame has an entry; `null` is no entry.
    fn has_entry(&self, name: &str) -> bool {
        self.entries().iter().any(|entry| entry.get(name).is_some_and(|value| !value.is_null()))
    }

    /// Returns an entry of the whole file.
    pub(crate) fn entry(&self, name: &str) -> Option<&Value> {
        self.json.get(name)
    }

    /// Returns, for each frame in file order, its path and its entry `split`, where the file has them.
    pub(crate) fn splits(&self) -> impl Iterator<Item = (Option<&str>, Option<&str>)> {
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

/// Reads a frame of the Blender form. The number `first` is time 0; `None` if frames have times in place of numbers.
fn transforms_frame(
    entry: &Value,
    shared: &LensEntries,
    file: &Value,
    first: Option<f64>,
) -> Result<Parsed, FrameProblem> {
    let frame = TransformsFrame::deserialize(entry).map_err(FrameProblem::Malformed)?;
    let own = LensEntries::deserialize(entry).map_err(FrameProblem::Malformed)?;
    let camera_to_world = pose(&rows(&frame.transform_matrix)?)?;
    let by_number = frame.frame_number.zip(first).map(|(number, first)| (number - first) / FRAME_RATE);
    Ok(Parsed {
        file: frame.file_path,
        mask: frame.mask_path,
        time: frame.time.or(by_number).map(finite_time).transpose()?,
        world_to_camera: pose::of_opengl(camera_to_world),
        size: own.or(shared).size()?,
        lens: lens_matrix::of_frame(entry, &own, file, shared)?,
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
        time: frame.time.map(finite_time).transpose()?,
        world_to_camera: pose(&rows(&frame.world_to_camera_opencv)?)?,
        size: Some(checked_size(frame.width, frame.height)?),
        lens: OriginalLens::Tangents(tangents),
        distortion: Distortion::default(),
    })
}

fn finite_time(time: f64) -> Result<f64, FrameProblem> {
    if (time as f32).is_finite() { Ok(time) } else { Err(FrameProblem::Time(time)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_in_place_of_times_are_no_shares_of_an_interval() {
        let clock = |file: &str, frame: Value| {
            let json = json!({ "frames": [frame] });
            CameraFile { path: file.into(), form: Form::Transforms, json }.clock()
        };
        for file in ["transforms_train.json", "transforms_test.json", SINGLE] {
            let numbered = clock(file, json!({ "frame_number": 12, "time": null }));
            assert_eq!(numbered, Clock::NUMBERED, "{file} has numbers");
            let both = clock(file, json!({ "frame_number": 12, "time": 0.4 }));
            assert_eq!(both, Clock::default(), "{file} has times");
        }
        assert_eq!(clock(SINGLE, json!({})), Clock::default(), "neither");
    }
}
