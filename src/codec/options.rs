//! Options of reading a file: settings that the file may not contain.
//!
//! In: values from a command line or a loader's settings. Out: [`ReadOptions`] with valid values, which each format
//! interprets; an [`InvalidOption`] for a value that is invalid or contradicts the file.

use crate::gaussian::{SMALLEST_CUTOFF, ShDirection};
use crate::scene::{ColorCodebooks, RotationConvention, TrainedCameras, UpAxis};
use crate::view::RasterFov;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Frames a second of sequences and clips that do not say it.
pub(crate) const FPS: f32 = 30.0;

/// How a capture was trained and is meant to be played, where the file does not say so or the user decides otherwise.
///
/// A checkpoint contains none of these settings: a field that is `None` is taken from `cfg_args` in the folder of the
/// checkpoint, else from the default. A package contains all of them: a field that is given replaces the stored value;
/// for a field that the Gaussians of the package depend on (`time_interval`, `rotation_convention`, `force_sh_3d`,
/// `prefilter_var`), a value other than the stored one is an error. `fps` and `tolerance` have no effect on packages
/// and checkpoints; [`Loading::lost`](super::Loading::lost) and the log of a game say so.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReadOptions {
    /// First and last timestamp of training. Default: 0, 1.
    pub time_interval: Option<[f32; 2]>,
    /// Background color in the blend space. Default: black, or white according to `cfg_args`.
    pub background: Option<[f32; 3]>,
    /// Convention of the rotations in the file. Default: flipped, unless the file is certainly unflipped (all
    /// coefficients of the time blocks zero at time degree 2).
    pub rotation_convention: Option<RotationConvention>,
    /// Field of view that shaped the footprints. Default: reference, the placeholder of the original trainer, for its
    /// checkpoints; corrected, the true one, for files of other makes.
    pub raster_fov: Option<RasterFov>,
    /// Kind of cameras that took the training views. Default: intrinsics if there is an environment map, else field of
    /// view.
    pub cameras: Option<TrainedCameras>,
    /// Mean that gives the viewing direction of color. Default: canonical.
    pub sh_direction: Option<ShDirection>,
    /// Whether only the first 16 coefficients are evaluated. Default: `false`.
    pub force_sh_3d: Option<bool>,
    /// Added to the temporal variance in the marginal, if positive. Default: the value in `cfg_args`, else −1.
    pub prefilter_var: Option<f32>,
    /// The axis that points up. Default: +Z for checkpoints; for files of other makes that of the file or its format,
    /// −Y for PLY without a comment about it.
    pub up: Option<UpAxis>,
    /// Seconds of one pass through the time interval; 0 for a still. Default: the length of the interval, as if its
    /// unit were the second.
    pub duration_seconds: Option<f32>,
    /// The marginal at and below which a Gaussian is not drawn, from 1/255 to below 1. Default: what the format has;
    /// 0.05 for checkpoints.
    pub marginal_cutoff: Option<f32>,
    /// Frames a second of a sequence of files, whose numbers count frames, and of the frames of motion in a PLY.
    /// Default: 30.
    pub fps: Option<f32>,
    /// Whether the file is the first of several with consecutive numbers in their names, which are the frames of a
    /// sequence. Default: `false`.
    pub sequence: bool,
    /// Largest distance between a curved path and the straight pieces that replace it, relative to the middle scale of
    /// the Gaussian. Default: 0.25.
    pub tolerance: Option<f32>,
    /// The codebooks of a chunk file whose colors are coded, which are in the index of its capture; no effect on other
    /// files. Not a setting of a `.meta` file. Default: those of the file `index.gs4d` beside it.
    #[serde(skip)]
    pub codebooks: Option<Arc<ColorCodebooks>>,
}

/// An option whose value is invalid or contradicts the file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("option {name}: {reason}")]
pub struct InvalidOption {
    /// Name of the field of [`ReadOptions`].
    pub name: &'static str,
    /// Why its value is refused.
    pub reason: String,
}

impl ReadOptions {
    /// Returns a sentence about the options that are given and have no effect on packages and checkpoints; `None` if
    /// there are none.
    pub(crate) fn without_effect(&self) -> Option<String> {
        let given = [("fps", self.fps.is_some()), ("tolerance", self.tolerance.is_some())];
        let names: Vec<&str> = given.into_iter().filter_map(|(name, is_given)| is_given.then_some(name)).collect();
        (!names.is_empty())
            .then(|| format!("Options without an effect on packages and checkpoints: {}.", names.join(", ")))
    }

    /// Checks the values given.
    ///
    /// # Errors
    /// The first invalid value: a time interval that is not positive, a negative duration, a number that is not finite.
    pub fn check(&self) -> Result<(), InvalidOption> {
        let refuse = |name, reason: String| Err(InvalidOption { name, reason });
        if let Some([first, last]) = self.time_interval
            && !(first.is_finite() && last > first && (last - first).is_finite())
        {
            return refuse("time_interval", format!("{first},{last} is not a first and a later last timestamp"));
        }
        if let Some(color) = self.background
            && !color.iter().all(|channel| channel.is_finite())
        {
            return refuse("background", format!("{color:?} is not a finite color"));
        }
        if let Some(variance) = self.prefilter_var
            && !variance.is_finite()
        {
            return refuse("prefilter_var", format!("{variance} is not finite"));
        }
        if let Some(seconds) = self.duration_seconds
            && !(seconds.is_finite() && seconds >= 0.0)
        {
            return refuse("duration_seconds", format!("{seconds} is not a number of seconds, zero or above"));
        }
        if let Some(cutoff) = self.marginal_cutoff
            && !(SMALLEST_CUTOFF..1.0).contains(&cutoff)
        {
            return refuse("marginal_cutoff", format!("{cutoff} is not from 1/255 to below 1"));
        }
        if let Some(fps) = self.fps
            && !(fps.is_finite() && fps > 0.0)
        {
            return refuse("fps", format!("{fps} is not a positive number of frames a second"));
        }
        if let Some(tolerance) = self.tolerance
            && !(tolerance.is_finite() && tolerance > 0.0)
        {
            return refuse("tolerance", format!("{tolerance} is not a positive part of a scale"));
        }
        Ok(())
    }
}
