//! Writers of the SOG family: attributes of Gaussians in lossless WebP textures, in an uncompressed zip archive.
//!
//! In: [`Columns`](crate::codec::import::columns::Columns). Out: a `.sog` of Gaussians at rest, or a `.sogst` of moving
//! ones.
//!
//! `attributes` codes what both have, by `codebook`, `wide`, `palette` and `rotation`; `sogst` adds motion and
//! lifespans, and the groups of `segments`, which a player draws and loads one after another. `texture` encodes the
//! codes, `archive` holds the files.

mod archive;
mod attributes;
mod codebook;
mod palette;
#[cfg(test)]
mod refusals;
mod rotation;
#[cfg(test)]
mod round_trip;
mod segments;
mod sog2;
mod sogst;
mod texture;
mod wide;

pub(super) use sog2::write as write_sog;
pub(super) use sogst::write as write_sogst;
