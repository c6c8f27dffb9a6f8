//! What tells two paths of one file from two files.
//!
//! In: the metadata of a file. Out: the numbers that the system knows it by.

use std::fs::Metadata;

/// Returns the device of a file and its number there; `None` where the system has no such numbers.
#[cfg(unix)]
pub(super) fn node(metadata: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

/// Returns the device of a file and its number there; `None` where the system has no such numbers.
#[cfg(not(unix))]
pub(super) fn node(_: &Metadata) -> Option<(u64, u64)> {
    None
}
