//! The trained captures.
//!
//! In: the environment variable `GS4D_DATA`. Out: the folder that it names.

use crate::support::skip::skip;
use std::path::PathBuf;

/// Returns the folder that contains `toybox/` and `standup/`; without the variable, reports the skipped test and
/// returns `None`.
pub fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("GS4D_DATA").map(PathBuf::from);
    if folder.is_none() {
        skip("no trained captures: GS4D_DATA is not set to their folder");
    }
    folder
}
