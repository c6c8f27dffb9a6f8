//! PLY files of Gaussians.
//!
//! In: the bytes of a file. Out: its scene. `header` and `body` read PLY as such, into a [`Table`] for each element;
//! `layout` recognizes the trainer or tool by the names of the properties; `splats`, `compressed`, `moving`,
//! `spacetime` and `rotated` read one layout each, or several that differ only in names. `deltas` adds frames of
//! motion, `origin` finds the origin of far places, `axes` the axis that points up, `unread` names unread properties.

pub(crate) mod axes;
mod body;
mod compressed;
mod deltas;
mod header;
mod layout;
mod moving;
pub(crate) mod origin;
pub(crate) mod read;
mod rotated;
mod scalar;
mod spacetime;
mod splats;
pub(crate) mod table;
mod unread;

#[cfg(test)]
pub(crate) mod fixture;
#[cfg(test)]
mod tests;

pub(crate) use header::is_ply;
pub(crate) use read::{read, still};
