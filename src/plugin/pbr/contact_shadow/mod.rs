//! Contact shadows: a soft dark ellipse on the ground beneath a capture, for a fraction of the cost of a cast shadow.
//!
//! In: captures with a [`CaptureContactShadow`] and their bounds at the current time. Out: one render pass for each
//! camera that sees a contact shadow:
//!
//! ```text
//! component    settings, and the ellipse for a capture's bounds      main world
//! extract      the ellipses of this frame                            main world -> render world
//! pipeline     one pipeline for each kind of target                  compiled in the background
//! prepare      the ellipses that each camera sees, in clip space     once per camera and frame
//! draw         the pass `contact_shadow`                             Core3d, after opaque meshes and before captures
//! ```
//!
//! Without contact shadows none of these systems runs. Contact shadows are not meshes with a custom material: Bevy
//! would process the material in every frame of every app, and would draw blended meshes over captures.

mod component;
mod draw;
mod extract;
mod pipeline;
mod plugin;
mod prepare;

pub use component::CaptureContactShadow;
pub(super) use plugin::build;
