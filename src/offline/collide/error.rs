//! The errors of `collide`.
//!
//! In: what is wrong with settings, or the error of a part. Out: [`CollideError`].

use crate::gaussian::InvalidGaussian;
use crate::offline::work::Interrupted;
use crate::scene::Colliders;

/// Why a capture gets no colliders.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CollideError {
    /// A setting that is out of its range, or meshes that no capture can have.
    #[error("{0}")]
    Invalid(&'static str),
    /// The box that is searched has no size that cells can have.
    #[error("the box that is searched is empty, or too small for its distance from the origin")]
    NoExtent,
    /// The time of the capture has more stretches than a capture may have.
    #[error("the capture would have {stretches} stretches of time, more than {most}", most = Colliders::MOST_STRETCHES)]
    TooManyStretches {
        /// Their number.
        stretches: usize,
    },
    /// The meshes are larger than those of a capture may be.
    #[error(
        "the meshes have more than {points} points or {triangles} triangles",
        points = Colliders::MOST_POINTS,
        triangles = Colliders::MOST_TRIANGLES
    )]
    TooLarge,
    /// No cell is solid.
    #[error("nothing is as opaque as the level {level} and as large as the smallest part")]
    NothingSolid {
        /// The level of the settings.
        level: f32,
    },
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Gaussian(#[from] InvalidGaussian),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
