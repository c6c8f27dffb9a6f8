//! Errors of datasets.
//!
//! In: a file, a frame, a reason. Out: a [`DatasetError`], whose message names the file, the frame if there is one, the
//! reason and the remedy.

use std::borrow::Cow;
use std::path::PathBuf;
use std::{fmt, io};

use glam::UVec2;

use super::{MAX_SIDE, Split, Validation};
use crate::offline::picture_file::PictureError;
use crate::offline::work::Interrupted;

/// A dataset, a camera file or an image that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The folder has no camera file.
    #[error(
        "{}: no {file} in it, and nothing else that a dataset folder holds: {formats}",
        .folder.display()
    )]
    NotADataset {
        /// The folder.
        folder: PathBuf,
        /// Name of the missing file.
        file: &'static str,
        /// The names of the formats.
        formats: String,
    },
    /// The folder has camera files of other splits alone.
    #[error(
        "{}: no {file} in it, which holds the cameras of this split: add it, or choose another split",
        .folder.display()
    )]
    NoSplit {
        /// The folder.
        folder: PathBuf,
        /// Name of the missing file.
        file: &'static str,
    },
    /// A camera file cannot be read.
    #[error("{}: cannot be read: {reason}", .path.display())]
    Read {
        /// The camera file.
        path: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// A camera file is not JSON, or a file-level entry has the wrong type.
    #[error("{}: not a valid camera file: {reason}", .path.display())]
    Json {
        /// The camera file.
        path: PathBuf,
        /// The error of the parser, with its line and column.
        reason: serde_json::Error,
    },
    /// The JSON has neither `frames` nor `views`.
    #[error(
        "{}: neither a transforms file (no list \"frames\") nor a file of golden views (no list \"views\")",
        .path.display()
    )]
    UnknownForm {
        /// The camera file.
        path: PathBuf,
    },
    /// The list of frames is empty.
    #[error("{}: its list of frames is empty: there is nothing to render or to train on", .path.display())]
    NoFrames {
        /// The camera file.
        path: PathBuf,
    },
    /// Every frame lies outside the time interval.
    #[error(
        "{}: all frames lie outside the time interval {},{}: their times are {} to {}{}; pass the interval the capture \
         was trained with",
        .path.display(), .interval[0], .interval[1], .times[0], .times[1], Counted(*.origin)
    )]
    NoFramesInInterval {
        /// The camera file.
        path: PathBuf,
        /// The requested interval, counted from the origin.
        interval: [f32; 2],
        /// First and last time found, counted from the origin.
        times: [f32; 2],
        /// The time of the dataset from which times are counted.
        origin: f64,
    },
    /// One frame cannot be used.
    #[error("{}: frame {frame}: {problem}", .path.display())]
    Frame {
        /// The camera file.
        path: PathBuf,
        /// Index of the frame in its list, from 0.
        frame: usize,
        /// The fault of the frame.
        problem: FrameProblem,
    },
    /// The picture size is not given anywhere.
    #[error(
        "{}: the picture size is unknown: no \"w\" and \"h\" in it, and none of its images is on disk; add them",
        .path.display()
    )]
    SizeUnknown {
        /// The camera file.
        path: PathBuf,
    },
    /// The requested picture size is out of range.
    #[error("pictures of {}x{} pixels cannot be made: each side must be 1 to {MAX_SIDE}", .size.x, .size.y)]
    Size {
        /// Requested width and height, pixels.
        size: UVec2,
    },
    /// The requested resolution gives a picture size that is out of range.
    #[error(
        "resolution {resolution} cannot be used on {}x{} pixels: it is a divisor (1, 2, 3, 4 or 8), -1 (at most 1600 \
         wide) or a target width up to {MAX_SIDE}",
        .original.x, .original.y
    )]
    Resolution {
        /// The requested value.
        resolution: i32,
        /// Size of the original pictures.
        original: UVec2,
    },
    /// Images named by the camera file are not on disk.
    #[error("{missing} of {total} images are missing: {} ({LOOKED_FOR}): put them there", Listing(.first, *.missing))]
    MissingImages {
        /// The first few missing images.
        first: Vec<PathBuf>,
        /// Number of missing images.
        missing: usize,
        /// Number of images named by the camera file.
        total: usize,
    },
    /// An image or a mask has another shape than the pictures of the camera file, so that it would be stretched.
    #[error(
        "{}: {} x {} pixels do not have the aspect ratio of the pictures of the camera file, {} x {}: crop it to that \
         aspect ratio, or correct the size in the camera file (without one, it is that of the first image)",
        .path.display(), .size.x, .size.y, .expected.x, .expected.y
    )]
    Aspect {
        /// The image or the mask.
        path: PathBuf,
        /// Its width and height, pixels.
        size: UVec2,
        /// Width and height according to the camera file, pixels.
        expected: UVec2,
    },
    /// A file of a dataset, or a video, cannot be used.
    #[error("{}: {reason}", .path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// The fault and the remedy.
        reason: String,
    },
    /// A dataset has a single view.
    #[error("{}: it has one view, and a scene needs several cameras or several times: add images", .path.display())]
    OneView {
        /// The camera file.
        path: PathBuf,
    },
    /// All views are taken from one place.
    #[error(
        "{}: all {views} views are taken from the same place, so that no depth can be found: the poses are missing, or \
         belong to another scene",
        .path.display()
    )]
    SamePlace {
        /// The camera file.
        path: PathBuf,
        /// Number of views.
        views: usize,
    },
    /// A dataset has no views for a split.
    #[error(
        "{}: it has no views of the split {split:?}: list some, or remove its splits, so that every eighth camera is \
         for the test",
        .path.display()
    )]
    EmptySplit {
        /// The camera file.
        path: PathBuf,
        /// The split.
        split: Split,
    },
    /// A frame that was decoded from a video cannot be used.
    #[error("{reason}: delete {}, so that the frames are decoded from the videos again", .folder.display())]
    Decoded {
        /// The fault of the frame.
        reason: Box<PictureError>,
        /// The folder of all frames that were decoded from the videos of the dataset.
        folder: PathBuf,
    },
    /// The views of a dataset cannot be divided into training and validation views in the requested way.
    #[error(
        "{}: does not allow validation by {validation}: it has too few cameras or times, or no split val of its own",
        .folder.display()
    )]
    NoValidation {
        /// The dataset.
        folder: PathBuf,
        /// The requested way.
        validation: Validation,
    },
    /// An image cannot be decoded, or is larger than the camera file says.
    #[error("{0}")]
    Image(#[from] PictureError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

/// The fault of one frame of a camera file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameProblem {
    /// An entry is missing or has the wrong type.
    #[error("{0}")]
    Malformed(serde_json::Error),
    /// The path of the image or of its mask names no file, or has control characters.
    #[error("the image path {0:?} names no file, or has control characters")]
    FileName(String),
    /// The time does not fit a float32.
    #[error("the time {0:?} is not a usable number")]
    Time(f64),
    /// A frame has no time, and others have one.
    #[error(
        "\"{0}\" has no \"time\", and other frames of the dataset have one: add the time, or remove those of all \
         frames"
    )]
    NoTime(String),
    /// The camera's matrix is not a pose.
    #[error("the camera matrix {0}")]
    Matrix(Cow<'static, str>),
    /// The camera's matrix has another scale than those of other frames.
    #[error(
        "the axes of the camera have the length {found}, and those of most cameras {usual}: write rotations without a \
         scale, or with one scale for all"
    )]
    Scale {
        /// Length of the axes in units of the world.
        found: f64,
        /// The length for most frames.
        usual: f64,
    },
    /// Neither intrinsics nor a field of view.
    #[error(
        "no lens: give camera_angle_x, all of fl_x, fl_y, cx and cy, or a matrix K, for the frame or the whole file"
    )]
    NoLens,
    /// The horizontal field of view is out of range.
    #[error("camera_angle_x is {0}: it must lie between 0 and π (radians)")]
    FieldOfView(f64),
    /// The values of the lens are out of range.
    #[error("the lens cannot be used: focal lengths must be above 0 and every value finite (in float32)")]
    Lens,
    /// An entry describes the picture of a camera that is not a pinhole camera.
    #[error(
        "{entry} is not 0 but {value}, and a distorted picture cannot be used: {UNDISTORT}; then remove {entry}, or \
         set it to 0"
    )]
    Distorted {
        /// Name of the entry.
        entry: &'static str,
        /// Its value, as JSON.
        value: String,
    },
    /// The distortion cannot be undone.
    #[error(
        "the distortion k1, k2, k3, k4, p1, p2 folds the picture, or needs more than twice the focal length, and \
         cannot be undone: {UNDISTORT}, or correct the coefficients"
    )]
    Folded,
    /// The distortion has coefficients, of which so many are given, that cannot be undone.
    #[error(
        "its {0} coefficients of distortion cannot be undone, of which only k1, k2, p1, p2, k3, k4, k5 and k6 of \
         OpenCV can: {UNDISTORT}; then write five zeros"
    )]
    Coefficients(usize),
    /// The distortion of the camera model cannot be undone.
    #[error(
        "camera_model is \"{0}\", whose distortion cannot be undone (PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and \
         OPENCV_FISHEYE can, of COLMAP also SIMPLE_PINHOLE, FULL_OPENCV, FISHEYE, SIMPLE_FISHEYE, RADIAL_FISHEYE and \
         SIMPLE_RADIAL_FISHEYE): {UNDISTORT}; then write PINHOLE"
    )]
    CameraModel(String),
    /// The principal point of a golden view is not the center of the picture.
    #[error(
        "{entry} is {found}, and golden views have their principal point at the center, {center}: write the views as a \
         transforms file, whose fl_x, fl_y, cx and cy are used"
    )]
    PrincipalPoint {
        /// Name of the entry: `cx` or `cy`.
        entry: &'static str,
        /// Its value, pixels.
        found: f64,
        /// Half the width or half the height, pixels.
        center: f64,
    },
    /// A number that follows from the lens and the pose is not finite.
    #[error(
        "the projection of camera {0:?} is not finite: check its focal lengths and principal point, or its field of \
         view, and its matrix"
    )]
    Projection(String),
    /// The picture size is out of range.
    #[error("pictures of {width}x{height} pixels cannot be made: each side must be a whole number, 1 to {MAX_SIDE}")]
    Size {
        /// Width in the file.
        width: f64,
        /// Height in the file.
        height: f64,
    },
}

/// The names under which a missing image was looked for.
pub(super) const LOOKED_FOR: &str =
    "looked for by these names, in any letter case, and with the extensions png, jpg, jpeg, exr and webp";

/// The remedy for pictures of a lens that is not a pinhole.
const UNDISTORT: &str = "undistort the images first, as COLMAP's image_undistorter does";

/// Prints the time from which times are counted, unless it is 0.
struct Counted(f64);

impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0.0 { Ok(()) } else { write!(f, ", counted from the time {} of the dataset", self.0) }
    }
}

/// Prints some of `total` paths.
struct Listing<'a>(&'a [PathBuf], usize);

impl fmt::Display for Listing<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, path) in self.0.iter().enumerate() {
            let separator = if i == 0 { "" } else { ", " };
            write!(f, "{separator}{}", path.display())?;
        }
        match self.1.saturating_sub(self.0.len()) {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}
