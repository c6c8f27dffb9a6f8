//! The real captures.
//!
//! In: the variable `GS4D_DATA`. Out: the folder it names, or the word that it names none.

use crate::skip::skip;
use std::path::PathBuf;

/// The folder that holds `toybox/` and `standup/`; nothing, said aloud, where it is not known.
pub fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("GS4D_DATA").map(PathBuf::from);
    if folder.is_none() {
        skip("GS4D_DATA is not set to the folder of the real captures (toybox, standup)");
    }
    folder
}
