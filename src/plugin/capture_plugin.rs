//! The plugin that a game adds.
//!
//! In: an app with Bevy's `DefaultPlugins` (or at least its `MinimalPlugins` and `AssetPlugin`). Out: the same app, in
//! which captures load, play and, if it has a renderer, are drawn.

use super::asset::CaptureAssetPlugin;
use super::playback::PlaybackPlugin;
use super::render::CaptureRenderPlugin;
use super::stereo::StereoPlugin;
use bevy::app::{App, Plugin};
use bevy::asset::AssetServer;
use bevy::time::Time;

/// Loads, plays and draws captures. Add it once, after `DefaultPlugins`, and spawn [`GaussianCapture3d`](crate::GaussianCapture3d)s. Cameras
/// need no component for captures.
///
/// # Panics
/// If the plugin is added twice, or before the plugins that it needs (Bevy's `AssetPlugin` and, if the app has one, `RenderPlugin`), or if
/// the app starts without `TimePlugin`. The message names the remedy.
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
        assert!(
            !app.is_plugin_added::<Self>(),
            "GaussianCapturePlugin was added twice: remove one of them. Another plugin of the game may also add it"
        );
        assert!(
            app.world().contains_resource::<AssetServer>(),
            "GaussianCapturePlugin needs Bevy's AssetPlugin, which was not added before it: add GaussianCapturePlugin \
             after DefaultPlugins or, in an app without them, after AssetPlugin"
        );
        app.add_plugins((CaptureAssetPlugin, PlaybackPlugin, CaptureRenderPlugin));
        if !app.is_plugin_added::<StereoPlugin>() {
            app.add_plugins(StereoPlugin);
        }
        #[cfg(feature = "pbr")]
        app.add_plugins(super::pbr::CapturePbrPlugin);
        #[cfg(feature = "picking")]
        app.add_plugins(super::picking_backend::CapturePickingPlugin);
    }

    fn finish(&self, app: &mut App) {
        assert!(
            app.world().contains_resource::<Time>(),
            "GaussianCapturePlugin needs Bevy's TimePlugin, which this app does not have: add DefaultPlugins or \
             MinimalPlugins, or TimePlugin itself"
        );
    }

    /// [`build`](Self::build) rejects a second plugin with a message that names the remedy.
    fn is_unique(&self) -> bool {
        false
    }
}
