//! Settings that a checkpoint does not contain.
//!
//! In: [`CheckpointOptions`] from a command line or a loader's settings, and `cfg_args`. Out: [`TrainedWith`] and
//! [`PlaybackHints`]. An option that is given takes precedence over `cfg_args`, and that over the defaults.

use super::cfg_args::CfgArgs;
use super::error::CheckpointError;
use crate::gaussian::ShDirection;
use crate::scene::{GaussianScene, PlaybackHints, RotationConvention, TrainedCameras, TrainedWith, UpAxis};
use crate::view::RasterFov;
use serde::{Deserialize, Serialize};

/// How a checkpoint was trained and is meant to be played. A field that is `None` is taken from `cfg_args` in the
/// folder of the file, else from the default.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CheckpointOptions {
    /// First and last timestamp of training. Default: 0, 1.
    pub time_interval: Option<[f32; 2]>,
    /// Background color in the blend space. Default: black, or white according to `cfg_args`.
    pub background: Option<[f32; 3]>,
    /// Convention of the rotations in the file. Default: flipped, unless the file is certainly unflipped (all
    /// coefficients of the time blocks zero at time degree 2).
    pub rotation_convention: Option<RotationConvention>,
    /// Which field of view shaped the footprints. Default: reference.
    pub raster_fov: Option<RasterFov>,
    /// What kind of cameras took the training views. Default: intrinsics if there is an environment map, else field of
    /// view.
    pub cameras: Option<TrainedCameras>,
    /// Which mean gives the viewing direction of color. Default: canonical.
    pub sh_direction: Option<ShDirection>,
    /// Whether only the first 16 coefficients are evaluated. Default: `false`.
    pub force_sh_3d: Option<bool>,
    /// Added to the temporal variance in the marginal, if positive. Default: the value in `cfg_args`, else −1.
    pub prefilter_var: Option<f32>,
    /// The axis that points up. Default: +Z.
    pub up: Option<UpAxis>,
    /// Seconds of one pass through the time interval; 0 for a still. Default: the length of the interval, as if its unit
    /// were the second.
    pub duration_seconds: Option<f32>,
}

/// Values from the file itself.
pub(super) struct FromFile {
    pub has_environment: bool,
    pub rotation_convention: RotationConvention,
    pub iteration: u64,
    pub spatial_lr_scale: f64,
}

impl CheckpointOptions {
    /// Checks the values given.
    ///
    /// # Errors
    /// The first invalid value: a time interval that is not positive, a negative duration, a number that is not finite.
    pub fn check(&self) -> Result<(), CheckpointError> {
        let refuse = |name, reason: String| Err(CheckpointError::Option { name, reason });
        if let Some([first, last]) = self.time_interval
            && !(first.is_finite() && last > first && (last - first).is_finite())
        {
            return refuse("time interval", format!("{first},{last} is not a first and a later last timestamp"));
        }
        if let Some(color) = self.background
            && !color.iter().all(|channel| channel.is_finite())
        {
            return refuse("background", format!("{color:?} is not a finite colour"));
        }
        if let Some(variance) = self.prefilter_var
            && !variance.is_finite()
        {
            return refuse("prefilter variance", format!("{variance} is not finite"));
        }
        if let Some(seconds) = self.duration_seconds
            && !(seconds.is_finite() && seconds >= 0.0)
        {
            return refuse("duration", format!("{seconds} is not a number of seconds, zero or above"));
        }
        Ok(())
    }

    pub(super) fn trained_with(&self, cfg_args: Option<&str>, file: &FromFile) -> TrainedWith {
        let cfg = cfg_args.map(CfgArgs::parse).unwrap_or_default();
        let default = TrainedWith::default();
        let background = cfg.white_background.map_or(default.background, |white| [f32::from(u8::from(white)); 3]);
        let cameras = if file.has_environment { TrainedCameras::Intrinsics } else { TrainedCameras::Fov };
        TrainedWith {
            time_interval: self.time_interval.unwrap_or(default.time_interval),
            background: self.background.unwrap_or(background),
            rotation_convention: file.rotation_convention,
            raster_fov: self.raster_fov.unwrap_or(default.raster_fov),
            cameras: self.cameras.unwrap_or(cameras),
            sh_direction: self.sh_direction.unwrap_or(default.sh_direction),
            force_sh_3d: self.force_sh_3d.unwrap_or(default.force_sh_3d),
            prefilter_var: self.prefilter_var.or(cfg.prefilter_var).unwrap_or(default.prefilter_var),
            iteration: file.iteration,
            pixel: default.pixel,
            validation: default.validation,
            spatial_lr_scale: file.spatial_lr_scale,
        }
    }

    pub(super) fn playback(&self, trained_with: &TrainedWith) -> PlaybackHints {
        PlaybackHints {
            up: self.up.unwrap_or_default(),
            duration_seconds: self.duration_seconds.unwrap_or_else(|| trained_with.time_span()),
        }
    }

    /// Replaces `up`, `duration_seconds` and `background` of a stored scene by the options that are given. The other
    /// options describe a checkpoint and have no effect.
    pub fn override_stored(&self, scene: &mut GaussianScene) {
        scene.playback.up = self.up.unwrap_or(scene.playback.up);
        scene.playback.duration_seconds = self.duration_seconds.unwrap_or(scene.playback.duration_seconds);
        scene.trained_with.background = self.background.unwrap_or(scene.trained_with.background);
    }
}

/// Returns the values as pairs of a name and a text, for a command to print.
pub fn describe(trained_with: &TrainedWith, playback: &PlaybackHints) -> Vec<(&'static str, String)> {
    let [first, last] = trained_with.time_interval;
    let [r, g, b] = trained_with.background;
    let prefilter = trained_with.prefilter_var;
    vec![
        ("time interval", format!("{first} to {last}")),
        ("background", format!("{r}, {g}, {b}")),
        ("rotation convention", lowercase(trained_with.rotation_convention)),
        ("raster fov", lowercase(trained_with.raster_fov)),
        ("cameras", lowercase(trained_with.cameras)),
        ("SH direction", lowercase(trained_with.sh_direction)),
        ("force SH 3D", trained_with.force_sh_3d.to_string()),
        ("prefilter variance", if prefilter > 0.0 { prefilter.to_string() } else { "off".to_owned() }),
        ("iteration", trained_with.iteration.to_string()),
        ("spatial lr scale", trained_with.spatial_lr_scale.to_string()),
        ("training pixel", trained_with.pixel.map_or("not known".to_owned(), |pixel| format!("{pixel} units"))),
        ("up", axis(playback.up).to_owned()),
        ("duration", format!("{} s", playback.duration_seconds)),
    ]
}

fn lowercase(value: impl std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
}

fn axis(up: UpAxis) -> &'static str {
    match up {
        UpAxis::PosX => "+x",
        UpAxis::NegX => "-x",
        UpAxis::PosY => "+y",
        UpAxis::NegY => "-y",
        UpAxis::PosZ => "+z",
        UpAxis::NegZ => "-z",
    }
}
