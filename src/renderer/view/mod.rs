//! One view on the GPU: its working buffers, its targets, and the frame.
//!
//! In: captures with a [`View`](crate::view::View) each, a background, the depth of opaque surfaces. Out: a texture of
//! color and transmittance and a texture of expected and median depth. [`ViewRenderer::prepare`] sizes and fills the buffers,
//! [`ViewRenderer::record`] records the frame.
mod choice;
mod motion;
mod prepare;
mod readback;
mod record;
mod resources;
#[cfg(test)]
pub(crate) mod tests;
mod uniforms;
mod view_renderer;

pub use view_renderer::ViewRenderer;
