//! The settings of a checkpoint's scene.
//!
//! In: [`ReadOptions`], `cfg_args`, and values from the file itself. Out: [`TrainedWith`] and [`PlaybackHints`]. An
//! option that is given takes precedence over `cfg_args`, and `cfg_args` over the defaults.

use super::cfg_args::CfgArgs;
use crate::codec::options::ReadOptions;
use crate::scene::{Origin, PlaybackHints, RotationConvention, TrainedCameras, TrainedWith};
use crate::view::NEAR;

/// Values from the file itself.
pub(super) struct FromFile {
    pub has_environment: bool,
    pub rotation_convention: RotationConvention,
    pub iteration: u64,
    pub spatial_lr_scale: f64,
}

/// Returns the training settings.
pub(super) fn trained_with(options: &ReadOptions, cfg_args: Option<&str>, file: &FromFile) -> TrainedWith {
    let cfg = cfg_args.map(CfgArgs::parse).unwrap_or_default();
    let default = TrainedWith::default();
    let background = cfg.white_background.map_or(default.background, |white| [f32::from(u8::from(white)); 3]);
    let cameras = if file.has_environment { TrainedCameras::Intrinsics } else { TrainedCameras::Fov };
    TrainedWith {
        time_interval: options.time_interval.unwrap_or(default.time_interval),
        background: options.background.unwrap_or(background),
        rotation_convention: file.rotation_convention,
        raster_fov: options.raster_fov.unwrap_or(default.raster_fov),
        cameras: options.cameras.unwrap_or(cameras),
        sh_direction: options.sh_direction.unwrap_or(default.sh_direction),
        force_sh_3d: options.force_sh_3d.unwrap_or(default.force_sh_3d),
        prefilter_var: options.prefilter_var.or(cfg.prefilter_var).unwrap_or(default.prefilter_var),
        marginal_cutoff: options.marginal_cutoff.unwrap_or(default.marginal_cutoff),
        iteration: file.iteration,
        spatial_lr_scale: file.spatial_lr_scale,
        ..default
    }
}

/// Returns the playback settings of a capture with these training settings.
pub(super) fn playback(options: &ReadOptions, trained_with: &TrainedWith) -> PlaybackHints {
    PlaybackHints {
        up: options.up.unwrap_or_default(),
        duration_seconds: options.duration_seconds.unwrap_or_else(|| trained_with.time_span()),
    }
}

/// Returns the settings of a scene as pairs of a name and a text, for a command to print.
pub fn describe(trained_with: &TrainedWith, playback: &PlaybackHints) -> Vec<(&'static str, String)> {
    let [first, last] = trained_with.time_interval;
    let [r, g, b] = trained_with.background;
    let prefilter = trained_with.prefilter_var;
    let mut pairs = vec![
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
        ("up", playback.up.name().to_owned()),
        ("duration", format!("{} s", playback.duration_seconds)),
    ];
    if trained_with.near != NEAR {
        pairs.push(("near limit", format!("{} units", trained_with.near)));
    }
    if let Some(period) = trained_with.color_period {
        pairs.push(("colors repeat after", format!("{period} units of time")));
    }
    if trained_with.mip_filter {
        pairs.push(("filter", "Mip-Splatting".to_owned()));
    }
    if !trained_with.origin.is_zero() {
        let Origin { place: [x, y, z], time } = trained_with.origin;
        pairs.push(("origin", format!("({x}, {y}, {z}), time {time}")));
    }
    pairs
}

fn lowercase(value: impl std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
}
