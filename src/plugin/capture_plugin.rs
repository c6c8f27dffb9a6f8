//! The plugin that a game adds.
//!
//! In: an app with Bevy's `DefaultPlugins` (or at least its `MinimalPlugins` and `AssetPlugin`). Out: the same app, in
//! which captures load, play and, if it has a renderer, are drawn.

use super::asset::CaptureAssetPlugin;
use super::playback::PlaybackPlugin;
use super::render::CaptureRenderPlugin;
use bevy::app::{App, Plugin};

/// Loads, plays and draws captures. Add it after `DefaultPlugins`, and spawn [`GaussianCapture3d`](crate::GaussianCapture3d)s. Cameras
/// need no component for captures.
///
/// # Examples
///
/// ```no_run
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// App::new().add_plugins((DefaultPlugins, GaussianCapturePlugin)).run();
/// ```
#[derive(Debug, Default, Clone, Copy)]
pub struct GaussianCapturePlugin;

impl Plugin for GaussianCapturePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((CaptureAssetPlugin, PlaybackPlugin, CaptureRenderPlugin));
        #[cfg(feature = "pbr")]
        app.add_plugins(super::pbr::CapturePbrPlugin);
    }
}
