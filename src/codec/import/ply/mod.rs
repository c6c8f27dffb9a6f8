//! PLY files of Gaussians.
//!
//! In: the bytes of a file. Out: its scene. `header` and `body` read PLY as such, into a [`Table`] for each element; `layout` recognizes the trainer or
//! tool by the names of the properties; `splats`, `compressed`, `moving`, `spacetime` and `rotated` read one layout each, or some that differ in names alone.

mod body;
mod compressed;
mod header;
mod layout;
mod moving;
mod read;
mod rotated;
mod scalar;
mod spacetime;
mod splats;
pub(crate) mod table;

#[cfg(test)]
pub(crate) mod fixture;
#[cfg(test)]
mod tests;

pub(crate) use header::is_ply;
#[cfg(feature = "offline")]
pub(crate) use read::vertices;
pub(crate) use read::{read, still};
