//! Captures of the 4dgs format (`.4dgs`).
//!
//! In: the bytes of a file; Gaussians in columns. Out: [`Imported`](super::import::Imported); the bytes of a file. Without the feature `fourdgs`,
//! `refused` has the same functions, which say how to build it in.

#[cfg(feature = "fourdgs")]
mod chunks;
#[cfg(feature = "fourdgs")]
mod coder;
#[cfg(feature = "fourdgs")]
mod colors;
#[cfg(feature = "fourdgs")]
mod deviation;
#[cfg(feature = "fourdgs")]
mod exact;
#[cfg(feature = "fourdgs")]
mod memory;
#[cfg(feature = "fourdgs")]
mod read;
#[cfg(not(feature = "fourdgs"))]
mod refused;
#[cfg(feature = "fourdgs")]
mod rows;
mod start;
#[cfg(feature = "fourdgs")]
mod steps;
#[cfg(feature = "fourdgs")]
mod tracks;
#[cfg(feature = "fourdgs")]
mod write;

#[cfg(feature = "fourdgs")]
pub(super) use read::read;
#[cfg(not(feature = "fourdgs"))]
pub(super) use refused::{encode, read};
pub(super) use start::{EXTENSIONS, is_of};
#[cfg(feature = "fourdgs")]
pub(super) use write::encode;
