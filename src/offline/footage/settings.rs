//! Settings of the making of a dataset from footage.
//!
//! In: paths and choices of the user. Out: [`FootageSettings`].

use std::path::PathBuf;

/// Settings of [`footage`](super::footage).
#[derive(Debug, Clone, PartialEq)]
pub struct FootageSettings {
    /// The folder of the footage: a dataset of any format, or videos or folders of frames, one for each camera. It is
    /// never written to.
    pub folder: PathBuf,
    /// The folder of the dataset that is made: a new one, or one that was made from the same footage.
    pub out: PathBuf,
    /// How the clocks of the cameras are compared.
    pub sync: Synchronization,
    /// For some cameras, by name, the seconds by which the times of their frames are too late; 0 for the others. If it
    /// is not empty, clocks are not compared.
    pub offsets: Vec<(String, f64)>,
    /// The cameras for the test, by name; `None` divides the cameras as the footage does, or takes every eighth if
    /// there are eight.
    pub test: Option<Vec<String>>,
    /// Longest side of the pictures that plates, masks and points are made from, pixels.
    pub work_size: u32,
    /// Smallest part of a picture that is taken to move, as a share of the picture, 0 to 1.
    pub smallest: f64,
    /// The folder of masks of what moves, `CAMERA/FRAME.png`; `None` takes `seg` or `motion` in the folder of the
    /// footage if there is one, and else tells what moves from the plates.
    pub masks: Option<PathBuf>,
    /// Whether points of every moment are looked for, which takes most of the time. Without them a training begins at
    /// random points.
    pub points: bool,
    /// Least share, 0 to 1, of the cameras that show a place whose masks have it inside, for a point there. Cameras in
    /// which what stands hides the place, by the plates, do not count, if half of all have it inside.
    pub agreeing: f64,
    /// Whether a short training on a GPU, without some of the cameras, tells the verdict what quality to expect.
    pub rehearse: bool,
}

impl FootageSettings {
    /// The usual longest side of the pictures to work with, pixels.
    pub const WORK_SIZE: u32 = 640;
    /// The usual smallest part of a picture that is taken to move, as a share of the picture.
    pub const SMALLEST: f64 = 0.0001;
    /// The usual least share of the cameras that must agree on a place.
    pub const AGREEING: f64 = 0.9;

    /// Returns the usual settings.
    pub fn usual(folder: PathBuf, out: PathBuf) -> Self {
        let (sync, work_size) = (Synchronization::Auto, Self::WORK_SIZE);
        Self {
            folder,
            out,
            sync,
            offsets: Vec::new(),
            test: None,
            work_size,
            smallest: Self::SMALLEST,
            masks: None,
            points: true,
            agreeing: Self::AGREEING,
            rehearse: false,
        }
    }
}

/// How the clocks of cameras are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Synchronization {
    /// By the sound of their videos, if at least two have sound.
    Auto,
    /// By what moves in the pictures, to about half a frame.
    Motion,
    /// Not at all: the times of frames are right.
    No,
}

impl Synchronization {
    /// The name of each way.
    pub const NAMES: [(&'static str, Self); 3] = [("auto", Self::Auto), ("motion", Self::Motion), ("no", Self::No)];
}
