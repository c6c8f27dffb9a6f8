//! Captures of the 4dgs format (`.4dgs`).
//!
//! In: the bytes of a file. Out: [`Imported`](super::Imported). `exact` and `memory` also serve the export. Without the
//! feature `fourdgs`, `refused` has the reader, which says how to build it in.

#[cfg(feature = "fourdgs")]
pub(crate) mod exact;
#[cfg(feature = "fourdgs")]
pub(crate) mod memory;
#[cfg(feature = "fourdgs")]
mod read;
#[cfg(not(feature = "fourdgs"))]
mod refused;
mod start;
#[cfg(feature = "fourdgs")]
mod tracks;

#[cfg(feature = "fourdgs")]
pub(crate) use read::read;
#[cfg(not(feature = "fourdgs"))]
pub(crate) use refused::read;
pub(crate) use start::{EXTENSIONS, is_of};
