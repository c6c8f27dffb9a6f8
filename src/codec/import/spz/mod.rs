//! SPZ files, versions 2 to 4.
//!
//! In: the bytes of a file, or of a buffer of a glTF file. Out: a scene, or Gaussians in columns. `payload` reads the
//! container, `axes` the coordinate system, `read` decodes the columns.

mod axes;
mod payload;
mod read;

pub(crate) use payload::is_of;
pub(crate) use read::{columns, read};
