//! The reasons why a scene could not be filmed.
//!
//! In: the faults of a film, of its folder, and the errors of drawing. Out: a [`FilmError`].

use crate::plugin::testing::TestingError;
use std::path::PathBuf;

/// The reason why a scene could not be filmed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// The film has no camera or no time.
    #[error("a film needs at least one camera and one time: it has {cameras} cameras and {times} times")]
    Empty {
        /// The number of cameras.
        cameras: usize,
        /// The number of times.
        times: usize,
    },
    /// A time is negative, not finite, or too large.
    #[error("the time {0} s cannot be filmed: times are seconds from the call, 0 or more")]
    Time(f32),
    /// The path of one camera does not have one pose for each time.
    #[error("the path has {poses} poses for {times} different times: give one pose for each time")]
    Path {
        /// The number of poses.
        poses: usize,
        /// The number of different times.
        times: usize,
    },
    /// The pose of a camera is not a position and a rotation.
    #[error("camera {0} has no usable pose: its position must be finite and its rotation a unit quaternion")]
    Pose(usize),
    /// The vertical field of view is not between 0 and π.
    #[error("a vertical field of view of {0} rad cannot be filmed: it must be larger than 0 and smaller than π")]
    FieldOfView(f32),
    /// The size of the pictures is 0, or larger than the GPU's largest texture.
    #[error("pictures of {width} x {height} pixels cannot be filmed: each side must be from 1 to {largest} pixels")]
    Size {
        /// The width in pixels.
        width: u32,
        /// The height in pixels.
        height: u32,
        /// The longest side that the GPU can draw.
        largest: u32,
    },
    /// Every picture is held out.
    #[error("no picture is left for training: hold out fewer cameras or fewer times")]
    NoTraining,
    /// Two points have one name at the same time.
    #[error("two points of the scene are named {0} at the same time: give each FilmedPoint a name of its own")]
    SamePoint(String),
    /// The folder holds files.
    #[error(
        "{}: the folder is not empty, and its files are not overwritten: name a new folder, or empty this one",
        .0.display()
    )]
    Occupied(PathBuf),
    /// The app could not be drawn, or a file could not be written.
    #[error(transparent)]
    Testing(#[from] TestingError),
}
