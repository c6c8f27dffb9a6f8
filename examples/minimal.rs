//! A window with a capture that plays: the least code that is needed, in `setup`.
//!
//! ```text
//! cargo run --release --features viewer --example minimal -- [CAPTURE] [--headless FOLDER] [--frames N]
//! ```
//!
//! There are no keys. With `--headless FOLDER`, or where there is no display, it writes N (8) pictures, a 30th of a second apart, to
//! FOLDER (`out`) instead.

#[path = "common/arguments.rs"]
mod arguments;
#[path = "common/show.rs"]
mod show;

use bevy::prelude::*;
use bevy_gs4d::component::Upright;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugin};
use std::path::PathBuf;

/// The capture that the command line names.
#[derive(Resource)]
struct Capture(PathBuf);

fn setup(mut commands: Commands, assets: Res<AssetServer>, capture: Res<Capture>) {
    // Most captures have +z up, Bevy +y.
    commands.spawn((GaussianCapture3d(assets.load(capture.0.clone())), Upright));
    commands.spawn((
        Camera3d::default(),
        // Captures are no smoother for multisampling.
        Msaa::Off,
        Transform::from_xyz(2.5, 1.5, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}

fn main() -> Result {
    // In a game: `App::new().add_plugins((DefaultPlugins, GaussianCapturePlugin)).add_systems(Startup, setup).run()`.
    show::run(UVec2::new(640, 360), |app, capture| {
        app.insert_resource(Capture(capture)).add_plugins(GaussianCapturePlugin).add_systems(Startup, setup);
    })
}
