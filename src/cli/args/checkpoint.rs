//! Options for settings that a checkpoint does not contain.
//!
//! In: options, a path. Out: a scene; an error for an option that has no effect on it.

use super::effects::Need;
use super::{Given, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::note::note;
use crate::codec::import::Imported;
use crate::codec::{self, CodecError, InvalidOption, ReadOptions};
use crate::gaussian::{Model, ShDirection};
use crate::offline::train::CaptureSettings;
use crate::scene::{ColorCodebooks, GaussianScene, RotationConvention, SceneForm, TrainedCameras, UpAxis};
use crate::view::RasterFov;
use std::path::Path;
use std::sync::Arc;

/// Settings that a checkpoint does not contain.
#[derive(clap::Args, Default)]
#[command(
    next_help_heading = "Settings that a checkpoint does not contain (taken from cfg_args beside it, else the default)"
)]
pub(crate) struct CheckpointArgs {
    #[command(flatten)]
    given: Given,
    /// First and last timestamp of training [default: 0,1].
    #[arg(long, value_name = "T0,T1", value_parser = values::interval, allow_hyphen_values = true)]
    time_interval: Option<[f64; 2]>,
    /// Background color, 0 to 1 in the space of the pictures; also replaces that of a package [default: 0,0,0].
    #[arg(long, value_name = "R,G,B", value_parser = values::color, allow_hyphen_values = true)]
    pub background: Option<[f32; 3]>,
    /// Order of the axes when the rotations were trained; unflipped: code before 2024-09-15 [default: flipped].
    #[arg(long, value_name = "CONVENTION", value_parser = values::one_of(&ROTATION_CONVENTIONS))]
    rotation_convention: Option<RotationConvention>,
    /// Field of view that shapes splats seen by intrinsics cameras: the original's placeholder or the true one; also
    /// replaces that of a package [default: reference for checkpoints, corrected for files of other makes].
    #[arg(long, value_name = "FOV", value_parser = values::one_of(&RASTER_FOVS))]
    raster_fov: Option<RasterFov>,
    /// Kind of cameras of the training views; also replaces that of a package [default: intrinsics if there is an
    /// environment map, else fov].
    #[arg(long, value_name = "KIND", value_parser = values::one_of(&TRAINED_CAMERAS))]
    trained_cameras: Option<TrainedCameras>,
    /// Mean that gives the viewing direction of color; also replaces that of a package [default: canonical].
    #[arg(long, value_name = "MEAN", value_parser = values::one_of(&SH_DIRECTIONS))]
    sh_direction: Option<ShDirection>,
    /// Use only the first 16 color coefficients.
    #[arg(long)]
    force_sh_3d: bool,
    /// Variance that is added to the temporal variance in the marginal, if positive [default: -1].
    #[arg(long, value_name = "VARIANCE", value_parser = values::number, allow_hyphen_values = true)]
    prefilter_var: Option<f32>,
    /// Axis that points up; also replaces that of a package or another file [default: +z].
    #[arg(long, value_name = "AXIS", value_parser = values::one_of(&UP_AXES), allow_hyphen_values = true)]
    up: Option<UpAxis>,
    /// Seconds of one pass through the time interval at speed 1, 0 for a still; also replaces those of a package or a
    /// dataset [default: the interval's length].
    #[arg(long, value_name = "SECONDS", value_parser = values::seconds)]
    duration: Option<f32>,
    /// Marginal at and below which a Gaussian is not drawn, 1/255 to 1; also replaces that of a package [default: that
    /// of the format, 0.05 for checkpoints].
    #[arg(long, value_name = "MARGINAL", value_parser = values::number)]
    cutoff: Option<f32>,
    /// Frames a second of a sequence of files, or of the frames in a PLY [default: 30].
    #[arg(long, value_name = "FPS", value_parser = values::number)]
    pub fps: Option<f32>,
    /// Largest distance between a curved path and the straight pieces that replace it, as a multiple of the middle one
    /// of the Gaussian's three scales [default: 0.25].
    #[arg(long, value_name = "SCALES", value_parser = values::number)]
    tolerance: Option<f32>,
    /// The codebooks of a chunk file, if those of its capture have been read ([`ReadOptions::codebooks`]).
    #[arg(skip)]
    pub codebooks: Option<Arc<ColorCodebooks>>,
}

const ROTATION_CONVENTIONS: [(&str, RotationConvention); 2] =
    [("flipped", RotationConvention::Flipped), ("unflipped", RotationConvention::Unflipped)];
const RASTER_FOVS: [(&str, RasterFov); 2] = [("reference", RasterFov::Reference), ("corrected", RasterFov::Corrected)];
const TRAINED_CAMERAS: [(&str, TrainedCameras); 2] =
    [("fov", TrainedCameras::Fov), ("intrinsics", TrainedCameras::Intrinsics)];
const SH_DIRECTIONS: [(&str, ShDirection); 2] =
    [("canonical", ShDirection::Canonical), ("displaced", ShDirection::Displaced)];
const UP_AXES: [(&str, UpAxis); 6] = [
    ("+x", UpAxis::PosX),
    ("-x", UpAxis::NegX),
    ("+y", UpAxis::PosY),
    ("-y", UpAxis::NegY),
    ("+z", UpAxis::PosZ),
    ("-z", UpAxis::NegZ),
];

impl CheckpointArgs {
    /// Returns the settings of a capture that is trained from pictures.
    pub(crate) fn capture(&self) -> CaptureSettings {
        let background = self.background.unwrap_or_default();
        CaptureSettings {
            time_interval: self.time_interval,
            background,
            duration_seconds: self.duration,
            ..CaptureSettings::default()
        }
    }

    /// Opens a capture of any format, and notes which parts of it the scene does not show.
    ///
    /// # Errors
    /// Errors of the codec; options that contradict the training settings in a package, or have no effect on the
    /// capture; the index of a capture in chunk files, which has no Gaussians itself.
    pub(crate) fn load(&self, path: &Path) -> Result<GaussianScene, Failure> {
        self.load_to_play(path, false)
    }

    /// Opens a capture to write files that are played: as [`load`](Self::load), but `--fps` also has an effect if the
    /// written files count frames (`counts_frames`).
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub(crate) fn load_to_play(&self, path: &Path, counts_frames: bool) -> Result<GaussianScene, Failure> {
        let scene = self.open(path, counts_frames)?;
        match scene.chunks {
            Some(_) => {
                let reason = "is the index of a capture in chunk files: gs4d join FOLDER -o CAPTURE makes one file of \
                              them";
                Err(Failure::about(path, reason))
            }
            None => Ok(scene),
        }
    }

    /// Opens a capture to describe it: as [`load`](Self::load), also the index of a capture in chunk files.
    ///
    /// # Errors
    /// As [`load`](Self::load), but for the index.
    pub(crate) fn load_to_describe(&self, path: &Path) -> Result<GaussianScene, Failure> {
        self.open(path, false)
    }

    fn open(&self, path: &Path, counts_frames: bool) -> Result<GaussianScene, Failure> {
        let Imported { scene, lost } = codec::load_stating(path, &self.options()).map_err(of_codec)?;
        self.require_effects(path, &scene, counts_frames)?;
        for sentence in lost {
            note(&format!("note: {}: {sentence}", path.display()));
        }
        Ok(scene)
    }

    /// Opens a capture to change it: as [`load`](Self::load), without its levels of detail, which would not fit the
    /// changed scene.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub(crate) fn load_to_change(&self, path: &Path) -> Result<GaussianScene, Failure> {
        let mut scene = self.load(path)?;
        if !scene.levels.is_empty() {
            scene.levels.clear();
            note(&format!("note: {}: levels of detail are left out; gs4d detail makes new ones", path.display()));
        }
        Ok(scene)
    }

    /// Checks that every option that is only for some formats has an effect on the scene of this file.
    fn require_effects(&self, path: &Path, scene: &GaussianScene, counts_frames: bool) -> Result<(), Failure> {
        let of_formats = [Need::FrameRate, Need::CurvedPaths, Need::NativeRotations, Need::Trainer];
        if !of_formats.into_iter().any(|need| self.given.depends_on(need)) {
            return Ok(());
        }
        let (format, _) = codec::inspect(path)?;
        let is_own = ["checkpoint", "package"].contains(&format.id);
        // Gaussians at rest of other makes are in the trained form.
        let is_moving = matches!(scene.form, SceneForm::Ready(_));
        let is_timed = is_own || !is_moving || format.id == "4dgs";
        self.given.require(Need::FrameRate, counts_frames || !is_timed)?;
        // The end of another interval depends on the frame rate, too.
        let is_open = self.duration.is_none() || scene.trained_with.time_interval != [0.0, 1.0];
        self.given.require(Need::OpenDuration, counts_frames || is_open)?;
        // Pieces of paths are drawn in windows of time, which are a temporal filter.
        let is_in_pieces = !is_own && format.id != "sequence" && scene.filter.is_some();
        self.given.require(Need::CurvedPaths, is_in_pieces)?;
        let is_native = matches!(scene.model(), Some(Model::Rotated4d | Model::Unrotated4d));
        self.given.require(Need::NativeRotations, is_own || is_native)?;
        self.given.require(Need::Trainer, is_own)
    }

    fn options(&self) -> ReadOptions {
        ReadOptions {
            time_interval: self.time_interval.map(|interval| interval.map(|time| time as f32)),
            background: self.background,
            rotation_convention: self.rotation_convention,
            raster_fov: self.raster_fov,
            cameras: self.trained_cameras,
            sh_direction: self.sh_direction,
            force_sh_3d: self.force_sh_3d.then_some(true),
            prefilter_var: self.prefilter_var,
            up: self.up,
            duration_seconds: self.duration,
            marginal_cutoff: self.cutoff,
            fps: self.fps,
            tolerance: self.tolerance,
            sequence: false,
            codebooks: self.codebooks.clone(),
        }
    }
}

/// Returns the failure of a file that cannot be read. A refused option has its name on the command line.
fn of_codec(error: CodecError) -> Failure {
    match error.kind.invalid_option() {
        Some(InvalidOption { name, reason }) => Failure::about(&error.path, &format!("{}: {reason}", option_of(name))),
        None => error.into(),
    }
}

/// Returns the option that sets a field of [`ReadOptions`].
fn option_of(field: &str) -> String {
    let other = match field {
        "cameras" => Some("trained-cameras"),
        "duration_seconds" => Some("duration"),
        "marginal_cutoff" => Some("cutoff"),
        _ => None,
    };
    format!("--{}", other.map_or(field.replace('_', "-"), str::to_owned))
}
