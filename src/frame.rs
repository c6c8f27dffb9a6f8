//! What drawing a view gives, on the CPU and on the GPU alike.
//!
//! In: nothing; these are the outputs of [`crate::reference`] and of the GPU renderer, [`Frame`] and its [`Counts`], and the choices
//! that a view makes: [`Background`], [`BlendSpace`], [`DebugView`].

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

/// The space in which splats are blended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum BlendSpace {
    /// sRGB-encoded values: the space captures are trained in.
    #[default]
    Encoded,
    /// Linear light. Edges and haze come out lighter than in training.
    Linear,
}

/// What a view shows of its captures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum DebugView {
    /// Their colours.
    #[default]
    Color,
    /// Expected depth: near is bright. Two units of the first capture are half as bright as its nearest.
    Depth,
    /// How many splats were blended at each pixel: black 0, then blue, green and yellow to red, 64 and more.
    Overdraw,
    /// Every Gaussian that the temporal filter leaves active: green where it shows at this moment, red where it is looked at in vain.
    Active,
    /// The standard deviation in time `σ_t`: blue for an instant, red for what is always there.
    Lifespan,
    /// The direction and speed of motion: grey rests; red, green and blue are x, y and z of the capture.
    Velocity,
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
