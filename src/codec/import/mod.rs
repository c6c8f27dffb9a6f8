//! Captures of other makes: from their files to scenes.
//!
//! In: the bytes of a file, the others of its folder, [`ReadOptions`](super::ReadOptions). Out: [`Imported`]: a scene,
//! and what of the file it does not show. Each format is one file here, which fills [`Columns`] and calls
//! [`Columns::into_scene`]; `super::format` has the table of formats.

mod assumed;
pub(crate) mod columns;
mod cubic;
pub(crate) mod drawable;
mod error;
pub(crate) mod fourdgs;
pub(crate) mod gltf;
mod imported;
pub(crate) mod in_pieces;
pub(crate) mod ksplat;
pub(crate) mod npz;
pub(crate) mod placed;
pub(crate) mod ply;
pub(crate) mod sequence;
pub(crate) mod sog;
pub(crate) mod source;
pub(crate) mod splat;
pub(crate) mod splatv;
pub(crate) mod spz;
#[cfg(test)]
pub(crate) mod testing;

pub use error::ImportError;
pub(crate) use imported::Imported;
