//! The errors of `sockets`.
//!
//! In: what is wrong with a placement, or the error of a part. Out: [`SocketError`].

use crate::gaussian::InvalidGaussian;
use crate::offline::work::Interrupted;

/// Why a point cannot be followed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SocketError {
    /// A name, a position or a number of samples that no socket can have.
    #[error("{0}")]
    Invalid(&'static str),
    /// A time outside the time interval of the capture.
    #[error("the time {time} is outside the time interval of the capture, {first} to {last}")]
    Outside {
        /// The time, timestamp units.
        time: f32,
        /// The first time of the capture, timestamp units.
        first: f32,
        /// The last time of the capture, timestamp units.
        last: f32,
    },
    /// The point is in the air, or too few solid Gaussians are visible near it.
    #[error(
        "nothing that can be followed is visible within {distance} units of the point at the time {time}: place it on \
         what it is to follow, at a time at which that is visible"
    )]
    NothingThere {
        /// The distance within which they are looked for, capture units.
        distance: f32,
        /// The time, timestamp units.
        time: f32,
    },
    /// A known point has no place at the times of the capture.
    #[error(
        "the point {name} has no known place within the time interval of the capture, {first} to {last}: give the \
         points of the film that the capture was trained on"
    )]
    Unknown {
        /// The name of the point.
        name: String,
        /// The first time of the capture, timestamp units.
        first: f32,
        /// The last time of the capture, timestamp units.
        last: f32,
    },
    /// A capture whose parts do not fit together.
    #[error("{0}")]
    Scene(&'static str),
    /// A Gaussian cannot be drawn.
    #[error("{0}")]
    Gaussian(#[from] InvalidGaussian),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
