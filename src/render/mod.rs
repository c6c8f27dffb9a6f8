//! Captures in Bevy's frame.
//!
//! In: entities with a [`GaussianCapture3d`] and perspective `Camera3d`s. Out: pixels in every such camera's target. The drawing
//! itself is [`crate::gpu`], which knows nothing of Bevy; what is here connects the two:
//!
//! ```text
//! extract    what is where, at which moment                       main world -> render world
//! upload     a loaded capture -> buffers on the GPU                once per asset
//! prepare    a camera's lens and every capture's pose -> views     once per camera and frame
//! draw       one compute pass, then the composite                  Core3d, between opaque and transparent meshes
//! ```
//!
//! Blending happens in the space captures were trained in, sRGB-encoded values. A camera's tonemapping comes afterwards and applies
//! to captures as to everything else; `Tonemapping::None` shows them as they were trained.

mod component;
mod composite;
mod draw;
mod extract;
mod plugin;
mod prepare;
mod upload;
mod view;

pub use component::{CaptureSettings, GaussianCapture3d};
pub use draw::CaptureSystems;
pub use plugin::GaussianCapturePlugin;
pub use upload::GpuGaussianCapture;
