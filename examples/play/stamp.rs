//! Whether a file has changed.
//!
//! In: the path of a file that the example `play` shows. Out: its [`Stamp`], which changes with its contents.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

/// Size, bytes, and time of change of a file; none while it is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp(Option<(u64, Option<SystemTime>)>);

impl Stamp {
    /// Returns the stamp of a file.
    pub fn of(file: &Path) -> Self {
        Self(fs::metadata(file).ok().map(|found| (found.len(), found.modified().ok())))
    }

    /// Returns whether the file is there and has changed since another stamp, or has appeared. A file that is missing
    /// for a moment is not a change.
    pub fn is_change_of(self, before: Self) -> bool {
        self.0.is_some() && self != before
    }
}
