//! The settings with which a capture was trained and is meant to be played.
//!
//! In: options of a command, `cfg_args`, or a package's header. Out: [`TrainedWith`] and [`PlaybackHints`], stored in
//! every package so that drawing needs no options.

use crate::gaussian::{MARGINAL_CUTOFF, ShDirection};
use crate::view::{NEAR, Optics, RasterFov};
use serde::{Deserialize, Serialize};

/// The settings a capture was trained with. Drawing must use the same settings to match the original.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TrainedWith {
    /// First and last timestamp of training, `[T0, T1]`. Default: `[0, 1]`.
    pub time_interval: [f32; 2],
    /// Background color, in the blend space. Default: black.
    pub background: [f32; 3],
    /// Convention of the rotations *in the source file*; in memory they are always flipped. Default: flipped.
    pub rotation_convention: RotationConvention,
    /// Field of view that shaped the footprints. Default: reference.
    pub raster_fov: RasterFov,
    /// Kind of cameras that took the training views. Default: cameras with a field of view.
    pub cameras: TrainedCameras,
    /// Mean that gives the viewing direction of color. Default: canonical.
    pub sh_direction: ShDirection,
    /// Whether only the first 16 coefficients are evaluated, even if more are stored. Default: `false`.
    pub force_sh_3d: bool,
    /// Added to the temporal variance in the marginal, if positive. Default: −1, nothing is added.
    pub prefilter_var: f32,
    /// The marginal at and below which a Gaussian is not drawn, from 1/255 to below 1. Default: 0.05.
    #[serde(skip_serializing_if = "is_the_original_cutoff")]
    pub marginal_cutoff: f32,
    /// Time after which colors that change with time repeat, timestamp units. Default: `None`, the length of the time
    /// interval; a capture of segments that were trained apart has that of one segment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color_period: Option<f32>,
    /// Iteration of the checkpoint. Default: 0.
    pub iteration: u64,
    /// Extent of the training cameras, the factor of positional learning rates. Default: 1.
    pub spatial_lr_scale: f64,
    /// Near plane of the cameras, capture units: a Gaussian is not drawn unless its depth is larger. Default: 0.2, that
    /// of the original.
    #[serde(skip_serializing_if = "is_the_original_near")]
    pub near: f32,
    /// Whether it was trained with the screen-space filter of Mip-Splatting: the opacity of each splat is reduced to
    /// compensate for the low-pass of 0.3 pixels squared, which makes it larger. Default: `false`.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub mip_filter: bool,
    /// Where the capture's space and its times begin in the coordinates of the files that it was made from. Default:
    /// zeros, the same coordinates.
    #[serde(skip_serializing_if = "Origin::is_zero")]
    pub origin: Origin,
    /// Largest size of a pixel of the training views at the Gaussians that they see, capture units. Views of larger
    /// pixels may be anti-aliased ([`View::antialiased`](crate::view::View::antialiased)). Default: `None`, not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel: Option<f32>,
    /// Text that describes how the views of the dataset were divided when the capture was fine-tuned or baked: how many
    /// were used for training, and which for choices. Default: `None`, not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation: Option<String>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_the_original_cutoff(cutoff: &f32) -> bool {
    *cutoff == MARGINAL_CUTOFF
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_the_original_near(near: &f32) -> bool {
    *near == NEAR
}

impl Default for TrainedWith {
    fn default() -> Self {
        Self {
            time_interval: [0.0, 1.0],
            background: [0.0; 3],
            rotation_convention: RotationConvention::Flipped,
            raster_fov: RasterFov::Reference,
            cameras: TrainedCameras::Fov,
            sh_direction: ShDirection::Canonical,
            force_sh_3d: false,
            prefilter_var: -1.0,
            marginal_cutoff: MARGINAL_CUTOFF,
            color_period: None,
            iteration: 0,
            spatial_lr_scale: 1.0,
            near: NEAR,
            mip_filter: false,
            origin: Origin::default(),
            pixel: None,
            validation: None,
        }
    }
}

impl TrainedWith {
    /// Returns the optics with which the training cameras drew the capture.
    pub fn optics(&self) -> Optics {
        let trained_pixel = if self.mip_filter { 0.0 } else { f32::INFINITY };
        Optics { raster_fov: self.raster_fov, near: self.near, trained_pixel }
    }

    /// Returns the unit of the lengths among the training settings, capture units: 1, or less in a scene so small that
    /// its near plane is nearer than that of the original.
    pub(crate) fn unit_length(&self) -> f64 {
        f64::from(self.near) / f64::from(NEAR)
    }

    /// Returns the length of the time interval, in the capture's unit.
    pub fn time_span(&self) -> f32 {
        self.time_interval[1] - self.time_interval[0]
    }

    /// Returns the time after which colors that change with time repeat, in the capture's unit.
    pub fn period_of_colors(&self) -> f32 {
        self.color_period.unwrap_or_else(|| self.time_span())
    }

    /// Returns whether footprints were shaped by the field-of-view sentinel of intrinsics cameras.
    pub fn uses_fov_sentinel(&self) -> bool {
        self.raster_fov == RasterFov::Reference && self.cameras == TrainedCameras::Intrinsics
    }
}

/// The origin of a capture in the coordinates of the files that it was made from, if these coordinates are too far from
/// 0 for single precision: maps (UTM) and times since 1970. A place of the files is `place` + a mean, a time of the
/// files is `time` + a timestamp; both in the unit of the files, which is that of the capture. Default: zeros.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Origin {
    /// The place of the capture's origin.
    pub place: [f64; 3],
    /// The time of timestamp 0.
    pub time: f64,
}

impl Origin {
    /// Returns whether places and times are those of the files.
    pub fn is_zero(&self) -> bool {
        *self == Self::default()
    }
}

/// The axis order of the 4D vector in the code that trained the rotations. Default: [`Flipped`](Self::Flipped).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RotationConvention {
    /// (x, y, z, t): code since 2024-09-15.
    #[default]
    Flipped,
    /// The order of code before that date.
    Unflipped,
}

/// The kind of cameras that took the training views. Default: [`Fov`](Self::Fov).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrainedCameras {
    /// Described by a field of view (D-NeRF).
    #[default]
    Fov,
    /// Described by focal lengths and a principal point (N3V).
    Intrinsics,
}

/// How a capture is meant to be played.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PlaybackHints {
    /// The axis that points up in the capture's own space. Default: +Z.
    pub up: UpAxis,
    /// Seconds that one pass through the time interval takes at speed 1; 0 for a still, which shows the first
    /// timestamp. Default: 1.
    pub duration_seconds: f32,
}

impl Default for PlaybackHints {
    fn default() -> Self {
        Self { up: UpAxis::PosZ, duration_seconds: 1.0 }
    }
}

/// A signed axis. Default: [`PosZ`](Self::PosZ).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// +X.
    PosX,
    /// −X.
    NegX,
    /// +Y, as in glTF.
    PosY,
    /// −Y.
    NegY,
    /// +Z, as in Blender and in D-NeRF and N3V data.
    #[default]
    PosZ,
    /// −Z.
    NegZ,
}

impl UpAxis {
    /// Returns the unit vector of the axis.
    pub fn vector(self) -> glam::Vec3 {
        match self {
            Self::PosX => glam::Vec3::X,
            Self::NegX => glam::Vec3::NEG_X,
            Self::PosY => glam::Vec3::Y,
            Self::NegY => glam::Vec3::NEG_Y,
            Self::PosZ => glam::Vec3::Z,
            Self::NegZ => glam::Vec3::NEG_Z,
        }
    }

    /// Returns the name of the axis: `+z`.
    pub fn name(self) -> &'static str {
        match self {
            Self::PosX => "+x",
            Self::NegX => "-x",
            Self::PosY => "+y",
            Self::NegY => "-y",
            Self::PosZ => "+z",
            Self::NegZ => "-z",
        }
    }
}
