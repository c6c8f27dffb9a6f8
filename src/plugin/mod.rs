//! Captures in a Bevy app: everything that uses Bevy.
//!
//! In: an app with Bevy's `DefaultPlugins`, or at least its `MinimalPlugins` and `AssetPlugin`. Out: the same app, in
//! which captures load, play and, if it has a renderer, are drawn. The crate root re-exports these modules except
//! `component`, whose items are at the root and in [`asset`]. Each module uses only modules before it:
//!
//! ```text
//! component ──▶ asset ──▶ playback ──▶ render, sound ──▶ stream ──▶ pbr, picker, stereo ──▶ picking_backend, inspector, testing
//! ```
//!
//! * `component`: the capture asset, and the component that places it in the world
//! * [`asset`]: loading and saving captures, and the state of loading on each entity
//! * [`playback`]: the time of each capture; shared clocks and timelines
//! * [`sound`]: what is heard beside captures, at the time that is drawn
//! * [`render`]: drawing captures into the targets of cameras, and their settings
//! * [`stream`]: captures of minutes in chunk files, of which only what is played next is in memory
//! * `pbr` (feature `pbr`): captures among Bevy's lit meshes
//! * [`picker`]: the Gaussian that a ray hits
//! * [`stereo`]: two eyes on one head
//! * `picking_backend` (feature `picking`): pointer events on captures
//! * `inspector` (feature `inspector`): a panel that shows and edits captures
//! * `testing` (feature `testing`): apps without a window, rendered to pictures
//!
//! [`GaussianCapturePlugins`] adds the plugins of all of them to an app except the inspector's. `picker` and `testing`
//! have no plugin. The crate root has tables of the components and the sets of systems.

pub mod asset;
mod capture_plugins;
pub(crate) mod component;
#[cfg(feature = "inspector")]
pub mod inspector;
#[cfg(feature = "pbr")]
pub mod pbr;
pub mod picker;
#[cfg(feature = "picking")]
pub mod picking_backend;
pub mod playback;
pub mod render;
pub mod sound;
pub mod stereo;
pub mod stream;
#[cfg(feature = "testing")]
pub mod testing;

pub use capture_plugins::GaussianCapturePlugins;
pub use component::{GaussianCapture3d, Upright, UprightTurn};
