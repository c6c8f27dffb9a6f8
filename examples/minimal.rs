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

use arguments::Arguments;
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy_gs4d::component::Upright;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugin, testing};
use std::path::PathBuf;
use std::time::Duration;

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
    let defaults = Arguments { file: "toybox.gs4d".into(), headless: None, frames: 8 };
    let arguments = arguments::parse(defaults, |_, _| Ok(false))?;
    let mut app = match arguments.headless {
        Some(_) => testing::app(UVec2::new(640, 360)),
        None => {
            let mut app = App::new();
            // A capture may be in any folder.
            let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
            app.add_plugins(DefaultPlugins.set(files));
            app
        }
    };
    app.insert_resource(Capture(arguments::asset_path(&arguments.file)));
    app.add_plugins(GaussianCapturePlugin).add_systems(Startup, setup);
    match arguments.headless {
        Some(folder) => {
            arguments::save_pictures(&mut app, arguments.frames, Duration::from_secs_f64(1.0 / 30.0), &folder)
        }
        None => {
            app.run();
            Ok(())
        }
    }
}
