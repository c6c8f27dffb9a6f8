//! Shading: what the scene around captures does to their picture.
//!
//! In: a camera's fog, the shadows of meshes, the light of the surroundings; the captures that take them. Out: one pass between the
//! renderer and the composite, only for cameras that need it:
//!
//! ```text
//! extract      boxes and components of captures, cameras with fog    main world -> render world
//! pipeline     one for each kind of Bevy's view                      compiled in the background
//! uniform      how each capture of a view is shaded                  once per camera and frame
//! draw         the pass `shade`                                      Core3d, in CaptureSystems::Shade
//! ```
//!
//! All captures of a view share one picture, which does not say which capture shows at a pixel. The pass finds it by place: a pixel belongs
//! to the capture in whose box its depth lies deepest. So captures with different settings should not overlap.

mod components;
mod draw;
mod extract;
mod pipeline;
mod plugin;
mod uniform;

pub use components::{CaptureLight, ReceivesShadows};
pub(super) use plugin::ShadePlugin;
