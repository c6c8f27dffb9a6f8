//! What drawing a view gives, on the CPU and on the GPU alike.
//!
//! In: nothing; these are the outputs of [`crate::reference`] and of the GPU renderer: [`Frame`], its [`Counts`], and what
//! stands behind the Gaussians, [`Background`].

use crate::picture::Picture;

/// One rendered view.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Colour `C + T · background`, unclamped, in the blend space.
    pub picture: Picture,
    /// Transmittance T left after the last splat blended, per pixel, row by row.
    pub transmittance: Vec<f32>,
    /// Expected depth `Σ z α T` in camera units, not divided by `1 − T`, per pixel.
    pub depth: Vec<f32>,
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

/// What stands behind all Gaussians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Background {
    /// Nothing: the picture is premultiplied, for a compositor.
    None,
    /// One colour, in the blend space.
    Color([f32; 3]),
    /// The capture's environment map.
    Environment,
}

impl Background {
    /// The background a capture was trained with: its map if it has one, else its colour.
    pub fn trained(scene: &crate::scene::RuntimeScene) -> Self {
        match scene.environment {
            Some(_) => Self::Environment,
            None => Self::Color(scene.trained_with.background),
        }
    }
}
