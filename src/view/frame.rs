//! What drawing a view gives, on the CPU and on the GPU alike.
//!
//! In: what a pixel of a view has gathered. Out: a [`Frame`], and how much work it was ([`Counts`]).

use super::Picture;

/// One rendered view.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Colour `C + T · background`, unclamped, in the blend space.
    pub picture: Picture,
    /// Transmittance T left after the last splat blended, per pixel, row by row.
    pub transmittance: Vec<f32>,
    /// Expected depth `Σ z α T` in camera units, not divided by `1 − T`, per pixel.
    pub depth: Vec<f32>,
    /// Median depth in camera units, per pixel: that of the splat at which T falls to one half or below; 0 where none does.
    pub median_depth: Vec<f32>,
    /// How much work it was.
    pub counts: Counts,
}

/// Work in a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Gaussians that become splats of at least one tile.
    pub visible: u32,
    /// Splat–tile pairs.
    pub pairs: u32,
}
