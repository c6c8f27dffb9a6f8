//! Apps without a window that load captures from a folder.
//!
//! In: the folder of the assets. Out: an app, the state of a capture after its loading, and its scene.

use crate::support::waiting::wait_until;
use bevy::prelude::*;
use bevy_gs4d::asset::{CaptureState, GaussianCapture};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::path::Path;

/// Returns an app whose assets are in `folder`.
pub fn app(folder: &Path) -> App {
    let file_path = folder.to_str().expect("temporary folders have plain names").into();
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin { file_path, ..default() }, GaussianCapturePlugins));
    app
}

/// Spawns a capture and waits until it is ready or has failed.
pub fn wait(app: &mut App, name: &str, capture: &Handle<GaussianCapture>) -> CaptureState {
    let entity = app.world_mut().spawn(GaussianCapture3d(capture.clone())).id();
    let state = |app: &App| app.world().get::<CaptureState>(entity).expect("every capture has a state").clone();
    wait_until(app, name, |app| state(app) != CaptureState::Loading, App::update);
    state(app)
}

/// Returns the scene of a capture that is loaded.
pub fn scene<'a>(app: &'a App, capture: &Handle<GaussianCapture>) -> &'a RuntimeScene {
    app.world().resource::<Assets<GaussianCapture>>().get(capture).expect("it is loaded").scene()
}
