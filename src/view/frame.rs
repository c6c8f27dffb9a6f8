//! The result of drawing a view, on the CPU or on the GPU.
//!
//! In: the blended color, transmittance and depths of each pixel. Out: a [`Frame`], with the amount of work
//! ([`Counts`]).

use super::Picture;

/// One rendered view.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Color `C + T · background`, unclamped, in the blend space.
    pub picture: Picture,
    /// Transmittance T after the last splat blended, per pixel, row by row.
    pub transmittance: Vec<f32>,
    /// Expected depth `Σ z α T` in camera units, not divided by `1 − T`, per pixel.
    pub depth: Vec<f32>,
    /// Median depth in camera units, per pixel: that of the splat at which T falls to one half or below; 0 if T stays
    /// above one half.
    pub median_depth: Vec<f32>,
    /// Amount of work.
    pub counts: Counts,
}

/// Amount of work in a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Number of splats that cover at least one tile.
    pub visible: u32,
    /// Number of splat–tile pairs.
    pub pairs: u32,
}
