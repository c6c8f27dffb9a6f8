//! Contact shadows: a soft dark ellipse on the ground beneath a capture, for a fraction of the cost of a cast shadow.
//!
//! In: captures with a [`CaptureContactShadow`] and their bounds at the current time. Out: a child entity of each with a flat mesh, which
//! Bevy draws after opaque meshes and before captures.

mod component;
mod gradient;
mod material;
mod place;
mod plugin;

pub use component::CaptureContactShadow;
pub(super) use plugin::ContactShadowPlugin;
