//! The identity of a file, which all of its paths have in common.
//!
//! In: the metadata of a file. Out: its device and inode numbers.

use std::fs::Metadata;

/// Returns the numbers of the device and of the inode of a file; `None` on systems without inodes.
#[cfg(unix)]
pub(crate) fn node(metadata: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

/// Returns the numbers of the device and of the inode of a file; `None` on systems without inodes.
#[cfg(not(unix))]
pub(crate) fn node(_: &Metadata) -> Option<(u64, u64)> {
    None
}
