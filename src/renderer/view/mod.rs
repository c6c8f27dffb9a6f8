//! One view on the GPU: its working buffers, its targets, and the frame.
//!
//! In: captures with a [`View`](crate::view::View) each, a background, the depth of opaque surfaces. Out: a texture of
//! color and transmittance and a texture of expected and median depth. [`ViewRenderer::prepare`] sizes and fills the buffers,
//! [`ViewRenderer::record`] records the frame.
mod allocate;
mod bins;
mod dispatch;
mod fast;
mod loops;
mod motion;
mod motion_passes;
mod parameters;
mod prepare;
mod readback;
mod record;
mod reference;
mod resources;
mod sizes;
#[cfg(test)]
mod tests;
mod uniforms;
mod view_renderer;

pub use parameters::{Instance, OpaqueDepth, ViewParameters};
pub use resources::PassBuffers;
pub(super) use sizes::max_pairs;
pub use view_renderer::{FinishedFrame, ViewRenderer};
