//! Renders a capture into PNG files, without a window or a display: a camera goes round it once while it plays once.
//!
//! ```text
//! cargo run --release --features viewer --example headless -- [CAPTURE] [FOLDER] [COUNT] [WIDTHxHEIGHT]
//! ```
//!
//! Defaults: `toybox.gs4d` from `assets/`, `out`, 8 pictures, 640x480. The capture may be a `.gs4d` or a `.pth`.

mod common;

use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{GaussianCapture3d, GaussianCapturePlugin};
use common::{Orbit, offscreen};
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Resource)]
struct Capture(PathBuf);

fn main() -> Result {
    let mut arguments = std::env::args().skip(1);
    let mut argument = |default: &str| arguments.next().unwrap_or_else(|| default.into());
    let (capture, folder, count, size) = (argument("toybox.gs4d"), argument("out"), argument("8"), argument("640x480"));
    let count: u32 = count.parse().map_err(|_| format!("{count}: not a number of pictures"))?;
    let size = parse_size(&size).ok_or_else(|| format!("{size}: not a size such as 640x480"))?;

    let mut app = offscreen::app(size);
    app.add_plugins(GaussianCapturePlugin)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(Capture(common::asset_path(&capture)))
        .add_systems(Startup, setup)
        .add_systems(Update, go_round);
    offscreen::settle(&mut app)?;
    let captures = app.world().resource::<Assets<GaussianCapture>>();
    let duration = captures.iter().next().map_or(0.0, |(_, capture)| capture.duration_seconds());
    let step = Duration::from_secs_f32(duration / count.max(1) as f32);
    common::save_pictures(&mut app, count, step, Path::new(&folder))
}

fn parse_size(text: &str) -> Option<UVec2> {
    let (width, height) = text.split_once('x')?;
    let size = UVec2::new(width.parse().ok()?, height.parse().ok()?);
    (size.min_element() > 0).then_some(size)
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    capture: Res<Capture>,
    offscreen: Res<offscreen::Offscreen>,
) {
    commands.spawn(GaussianCapture3d(assets.load(capture.0.clone())));
    commands.spawn((
        Camera3d::default(),
        offscreen.target(),
        Msaa::Off,
        // Pixels as trained.
        Tonemapping::None,
        DebandDither::Disabled,
    ));
}

fn go_round(
    captures: Res<Assets<GaussianCapture>>,
    mut orbit: Local<Option<Orbit>>,
    capture: Single<(&GaussianCapture3d, &Playback, &mut Transform), Without<Camera3d>>,
    mut camera: Single<&mut Transform, With<Camera3d>>,
) {
    let (handle, playback, mut transform) = capture.into_inner();
    let Some(loaded) = captures.get(&handle.0) else { return };
    transform.rotation = loaded.upright();
    let turn = playback.time / loaded.duration_seconds().max(f32::MIN_POSITIVE);
    let orbit = *orbit.get_or_insert_with(|| Orbit::around(loaded));
    **camera = Orbit { yaw: orbit.yaw + TAU * turn, ..orbit }.transform();
}
