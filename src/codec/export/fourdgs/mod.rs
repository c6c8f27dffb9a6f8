//! Files of the 4dgs format (`.4dgs`).
//!
//! In: Gaussians in columns. Out: the bytes of a file, and what of the Gaussians it does not hold. Without the feature
//! `fourdgs`, `refused` has the encoder, which says how to build it in.

#[cfg(feature = "fourdgs")]
mod chunks;
#[cfg(feature = "fourdgs")]
mod coder;
#[cfg(feature = "fourdgs")]
mod colors;
#[cfg(feature = "fourdgs")]
mod deviation;
#[cfg(not(feature = "fourdgs"))]
mod refused;
#[cfg(feature = "fourdgs")]
mod rows;
#[cfg(feature = "fourdgs")]
mod steps;
#[cfg(feature = "fourdgs")]
mod write;

#[cfg(not(feature = "fourdgs"))]
pub(super) use refused::encode;
#[cfg(feature = "fourdgs")]
pub(super) use write::encode;
