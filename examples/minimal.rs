//! A window with a playing capture. The function `setup` is the minimum code of a game.
//!
//! ```text
//! cargo run --release --features viewer --example minimal -- [CAPTURE] [--headless FOLDER] [--frames N]
//! ```
//!
//! There are no keys. With `--headless FOLDER`, or without a display, it writes N (8) pictures, a 30th of a second
//! apart, to FOLDER (`out`) instead.

#[path = "common/arguments.rs"]
mod arguments;
#[path = "common/show.rs"]
mod show;

use bevy::prelude::*;
use bevy_gs4d::Upright;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::path::PathBuf;

/// The asset path of the capture on the command line.
#[derive(Resource)]
struct Capture(PathBuf);

fn setup(mut commands: Commands, assets: Res<AssetServer>, capture: Res<Capture>) {
    // `Upright` turns the capture's up axis (+z in most captures) to Bevy's +y.
    commands.spawn((GaussianCapture3d(assets.load(capture.0.clone())), Upright));
    commands.spawn((
        Camera3d::default(),
        // Captures need no multisampling.
        Msaa::Off,
        Transform::from_xyz(2.5, 1.5, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}

fn main() -> Result {
    // In a game: `App::new().add_plugins((DefaultPlugins, GaussianCapturePlugins)).add_systems(Startup, setup).run()`.
    show::run(UVec2::new(640, 360), |app, capture| {
        app.insert_resource(Capture(capture)).add_plugins(GaussianCapturePlugins).add_systems(Startup, setup);
    })
}
