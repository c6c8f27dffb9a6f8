//! Shared by the examples without keys: runs an app with a window, or an app without a window that writes pictures.
//!
//! In: the command line `[CAPTURE] [--headless FOLDER] [--frames N]`, the plugins and systems of an example. Out: a
//! window until it is closed, or pictures in a folder.

use crate::arguments::{Arguments, asset_path, parse, save_pictures};
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy_gs4d::testing;
use std::path::PathBuf;
use std::time::Duration;

/// Runs an app with Bevy's default plugins. `size` is the size of pictures; `build` adds the plugins and systems of the
/// example, given the asset path of the capture on the command line.
///
/// # Errors
/// Those of [`parse`] and [`save_pictures`].
pub fn run(size: UVec2, build: impl FnOnce(&mut App, PathBuf)) -> Result {
    let defaults = Arguments { file: "toybox.gs4d".into(), headless: None, frames: 8 };
    let arguments = parse(defaults, |_, _| Ok(false))?;
    let mut app = match arguments.headless {
        Some(_) => testing::app(size),
        None => {
            let mut app = App::new();
            // A capture may be in any folder.
            let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
            app.add_plugins(DefaultPlugins.set(files));
            app
        }
    };
    build(&mut app, asset_path(&arguments.file));
    match arguments.headless {
        Some(folder) => save_pictures(&mut app, arguments.frames, Duration::from_secs_f64(1.0 / 30.0), &folder),
        None => {
            app.run();
            Ok(())
        }
    }
}
