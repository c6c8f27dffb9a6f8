//! The names that a game needs, to be imported beside Bevy's own: `use bevy_gs4d::prelude::*;`.
//!
//! In: the modules of the plugin. Out: in their order, the plugin, the capture and its component, messages, playback, settings, picking
//! and stereo.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_gs4d::prelude::*;
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), Upright, Playback::once()));
//!     commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 4.0)));
//! }
//!
//! fn slow_motion(mut playback: Single<&mut Playback>) {
//!     playback.speed = 0.5;
//! }
//!
//! let mut app = App::new();
//! app.add_plugins((DefaultPlugins, GaussianCapturePlugin));
//! app.add_systems(Startup, (setup, slow_motion).chain()).run();
//! ```

pub use crate::plugin::GaussianCapturePlugin;
pub use crate::plugin::asset::{CaptureFailed, CaptureReady, CaptureState};
pub use crate::plugin::component::{GaussianCapture, GaussianCapture3d, Upright};
#[cfg(feature = "pbr")]
pub use crate::plugin::pbr::{CaptureContactShadow, CaptureLight, CastsShadows, ReceivesShadows, ShadowResolution};
pub use crate::plugin::picker::{CaptureHit, CapturePicker};
#[cfg(feature = "picking")]
pub use crate::plugin::picking_backend::{CapturePickingCamera, CapturePickingSettings};
pub use crate::plugin::playback::{
    FollowsClock, MarkerReached, Markers, Playback, PlaybackClock, PlaybackEnded, PlaybackLooped, PlaybackPaused,
    PlaybackSeeked, PlaybackStarted, Repeat, SegmentBoundCrossed, Timeline, TimelinePlayer, TimelineTrack,
};
pub use crate::plugin::render::{
    CaptureDetail, CaptureSettings, CaptureStatistics, CaptureUploadBudget, CaptureViewSettings, CropBox, DepthWrite,
};
pub use crate::plugin::stereo::{Eye, EyeTargets, StereoPlugin, StereoRig, spawn_stereo};
pub use crate::view::{BlendSpace, DebugView};
