//! The first bytes of a `.4dgs` file.
//!
//! In: the start of a file. Out: whether it is of this format.

use crate::codec::start::Start;

/// Extensions of these files.
pub(crate) const EXTENSIONS: &[&str] = &["4dgs"];

/// Returns whether a file that starts so is of this format, in any version.
pub(crate) fn is_of(start: &Start) -> bool {
    start.bytes.starts_with(b"\x894DGS")
}
