//! Exports: from scenes to files of other makes.
//!
//! In: a [`GaussianScene`](crate::scene::GaussianScene), and for formats without motion a time. Out: the file, and what
//! of the scene it does not show. `instant` and `moving` turn a scene into
//! [`Columns`](super::import::columns::Columns), each format is one file that writes these, `table` lists the formats,
//! and `exporter` calls all of these.

mod clip;
pub(crate) mod error;
pub(crate) mod exporter;
mod fourdgs;
mod gltf;
mod instant;
mod lost;
mod moving;
mod ply;
#[cfg(test)]
mod samples;
mod sog;
mod splat;
mod spz;
mod still;
pub(crate) mod table;
mod usd;
mod y_up;
