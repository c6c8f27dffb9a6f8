//! The plugins that a game adds.
//!
//! In: an app with Bevy's `DefaultPlugins` (or at least its `MinimalPlugins` and `AssetPlugin`). Out: the same app, in
//! which captures load, play and, if it has a renderer, are drawn.

#[cfg(feature = "pbr")]
use super::pbr;
#[cfg(feature = "picking")]
use super::picking_backend;
use super::{asset, playback, render, sound, stereo, stream};
use bevy::app::plugin_group;

plugin_group! {
    /// Loads, plays and draws captures. Add it once, after `DefaultPlugins`, and spawn
    /// [`GaussianCapture3d`](crate::GaussianCapture3d)s. Cameras need no component for captures.
    ///
    /// Each part can be left out. Only [`CaptureAssetPlugin`](asset::CaptureAssetPlugin) is needed by others: by all
    /// but [`StereoPlugin`](stereo::StereoPlugin). If a plugin of Bevy that a part needs is added later than the part
    /// or not at all, the log has a warning with the remedy, and the app goes on.
    ///
    /// # Examples
    ///
    /// ```no_run
    /// use bevy::prelude::*;
    /// use bevy_gs4d::prelude::*;
    ///
    /// App::new().add_plugins((DefaultPlugins, GaussianCapturePlugins)).run();
    /// ```
    ///
    /// A server of a game loads and plays captures, but does not draw them:
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_gs4d::prelude::*;
    /// use bevy_gs4d::render::CaptureRenderPlugin;
    ///
    /// let parts = GaussianCapturePlugins.build().disable::<CaptureRenderPlugin>();
    /// App::new().add_plugins((MinimalPlugins, AssetPlugin::default(), parts));
    /// ```
    #[derive(Debug, Default, Clone, Copy)]
    pub struct GaussianCapturePlugins {
        asset:::CaptureAssetPlugin,
        playback:::CapturePlaybackPlugin,
        render:::CaptureRenderPlugin,
        stream:::CaptureStreamPlugin,
        sound:::CaptureSoundPlugin,
        stereo:::StereoPlugin,
        #[cfg(feature = "pbr")]
        pbr:::CapturePbrPlugin,
        #[cfg(feature = "picking")]
        picking_backend:::CapturePickingPlugin,
    }
}
