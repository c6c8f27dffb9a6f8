//! Renders a capture to PNG files without a window or a display: a camera orbits the capture once while it plays once.
//!
//! ```text
//! cargo run --release --features viewer --example headless -- [CAPTURE] [--headless FOLDER] [--frames N] \
//!     [--size WIDTHxHEIGHT]
//! ```
//!
//! Defaults: `toybox.gs4d` from `assets/`, `out`, 8 pictures, 640x480. The capture may be a `.gs4d` or a `.pth`.

mod common;
#[path = "common/size.rs"]
mod size;

use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy_gs4d::Upright;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins, testing};
use common::Orbit;
use common::arguments::{Arguments, parse, value};
use size::parse_size;
use std::f32::consts::TAU;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Resource)]
struct Capture(PathBuf);

fn main() -> Result {
    let mut size = UVec2::new(640, 480);
    let defaults = Arguments { file: "toybox.gs4d".into(), headless: Some("out".into()), frames: 8 };
    let arguments = parse(defaults, |option, values| {
        if option == "--size" {
            let text = value(option, "a size", values)?;
            size = parse_size(&text).ok_or_else(|| format!("--size {text}: not a size such as 640x480"))?;
        }
        Ok(option == "--size")
    })?;

    let mut app = testing::app(size);
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(Capture(common::asset_path(&arguments.file)))
        .add_systems(Startup, setup)
        .add_systems(Update, orbit);
    testing::settle(&mut app)?;
    let captures = app.world().resource::<Assets<GaussianCapture>>();
    let duration = captures.iter().next().map_or(0.0, |(_, capture)| capture.duration_seconds());
    let step = Duration::try_from_secs_f32(duration / arguments.frames.max(1) as f32)
        .map_err(|error| format!("a capture of {duration} s cannot be divided into pictures: {error}"))?;
    common::save_pictures(&mut app, arguments.frames, step, &arguments.headless.unwrap_or_default())
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, capture: Res<Capture>) {
    commands.spawn((GaussianCapture3d(assets.load(capture.0.clone())), Upright));
    commands.spawn((
        Camera3d::default(),
        Msaa::Off,
        // Pixels keep their trained colors.
        Tonemapping::None,
        DebandDither::Disabled,
    ));
}

fn orbit(
    captures: Res<Assets<GaussianCapture>>,
    mut orbit: Local<Option<Orbit>>,
    capture: Single<(&GaussianCapture3d, &Playback)>,
    camera: Single<(&mut Transform, &mut Projection), With<Camera3d>>,
) {
    let (handle, playback) = capture.into_inner();
    let Some(loaded) = captures.get(&handle.0) else { return };
    let turn = playback.time / loaded.duration_seconds().max(f32::MIN_POSITIVE);
    let orbit = *orbit.get_or_insert_with(|| Orbit::around(loaded));
    let (mut transform, mut projection) = camera.into_inner();
    Orbit { yaw: orbit.yaw + TAU * turn, ..orbit }.place(&mut transform, &mut projection);
}
