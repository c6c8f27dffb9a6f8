//! Captures in a Bevy app: everything that knows Bevy.
//!
//! In: an app with Bevy's `DefaultPlugins`, or at least its `AssetPlugin`. Out: the same app, in which captures load ([`asset`]), play
//! ([`playback`]), are drawn ([`render`]), can be picked ([`picking`]) and be seen with two eyes ([`stereo`]). The crate root re-exports
//! each of these modules. Inside they build on each other in this order:
//!
//! ```text
//! component ──▶ asset ──▶ playback ──▶ render ──▶ picking, stereo ──▶ inspector, testing
//! ```

pub mod asset;
mod capture_plugin;
pub mod component;
#[cfg(feature = "inspector")]
pub mod inspector;
pub mod picking;
pub mod playback;
pub mod render;
pub mod stereo;
#[cfg(feature = "testing")]
pub mod testing;

pub use capture_plugin::GaussianCapturePlugin;
pub use component::GaussianCapture3d;
