//! Shading: applies the fog, shadows and light of the scene to the picture of captures.
//!
//! In: a camera's fog, the shadows of meshes, the light of the surroundings; the captures that receive them. Out: one
//! pass between the renderer and the composite, only for cameras that need it:
//!
//! ```text
//! extract      boxes and components of captures, cameras with fog    main world -> render world
//! pipeline     one pipeline for each kind of Bevy's view             compiled in the background
//! uniform      the shading of each capture of a view                 once per camera and frame
//! draw         the pass `shade`                                      Core3d, in CaptureSystems::Shade
//! ```
//!
//! All captures of a view share one picture, which does not store the capture of a pixel. The pass assigns a pixel to
//! the capture in whose box the pixel's point lies deepest, so captures with different settings should not overlap.

mod components;
mod draw;
mod extract;
mod pipeline;
mod plugin;
mod uniform;

pub use components::{CaptureLight, ReceivesShadows};
pub(super) use plugin::build;
