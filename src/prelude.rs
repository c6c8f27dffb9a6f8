//! The names that a game needs, to be imported beside Bevy's own: `use bevy_gs4d::prelude::*;`.
//!
//! In: the modules of the plugin. Out: plugins, the capture and its component, messages, playback, settings, picking.
//!
//! Other crates export everything at once, too. Every name of this prelude therefore begins with `Capture`, `Gaussian`
//! or `Playback`, except `Upright`. Shorter names stay in their modules: `Repeat`, `Markers`, `FollowsClock`,
//! `MarkerReached` and timelines in [`playback`](crate::playback), `CropBox` and `DepthWrite` in
//! [`render`](crate::render), shadows in `pbr`, eyes in [`stereo`](crate::stereo), `BlendSpace` and `DebugView` in
//! [`view`](crate::view).
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
//! app.add_plugins((DefaultPlugins, GaussianCapturePlugins));
//! app.add_systems(Startup, (setup, slow_motion).chain()).run();
//! ```

#[doc(no_inline)]
pub use crate::plugin::GaussianCapturePlugins;
#[doc(no_inline)]
pub use crate::plugin::asset::{CaptureFailed, CaptureFailure, CaptureReady, CaptureState};
#[doc(no_inline)]
pub use crate::plugin::component::{GaussianCapture, GaussianCapture3d, Upright};
#[cfg(feature = "pbr")]
#[doc(no_inline)]
pub use crate::plugin::pbr::{CaptureContactShadow, CaptureLight};
#[doc(no_inline)]
pub use crate::plugin::picker::{CaptureHit, CapturePicker};
#[cfg(feature = "picking")]
#[doc(no_inline)]
pub use crate::plugin::picking_backend::{CapturePickingCamera, CapturePickingSettings};
#[doc(no_inline)]
pub use crate::plugin::playback::{
    CaptureCollider, CaptureColliderChanged, CaptureSocket, Playback, PlaybackClock, PlaybackEnded, PlaybackLooped,
    PlaybackPaused, PlaybackSeeked, PlaybackStarted,
};
#[doc(no_inline)]
pub use crate::plugin::render::{
    CaptureBudget, CaptureDetail, CaptureSettings, CaptureStatistics, CaptureUploadBudget, CaptureViewSettings,
};
#[doc(no_inline)]
pub use crate::plugin::sound::CaptureSound;
#[doc(no_inline)]
pub use crate::plugin::stream::{
    CaptureBuffered, CaptureBuffering, CaptureStalled, CaptureStreamSettings, CaptureStreamState,
};
