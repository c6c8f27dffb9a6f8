//! The names of files that are copies of files elsewhere.
//!
//! In: the folders of copies, and where the files belong. Out: texts with the names that the user has given in place of those of the copies.

use std::sync::{Mutex, PoisonError};

/// Folders of copies, each with the place of the files.
static NAMES: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());

/// From now on, files in the folder `copies` are shown as files of `origin`.
pub(crate) fn show(copies: &str, origin: &str) {
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    names.push((copies.to_owned(), origin.to_owned()));
    // In a JSON document the separators of some systems are escaped.
    let escaped = copies.replace('\\', "\\\\");
    if escaped != copies {
        names.push((escaped, origin.to_owned()));
    }
}

/// Returns a text with the names of origins in place of those of copies.
pub(crate) fn shown(text: &str) -> String {
    let names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    names.iter().fold(text.to_owned(), |text, (copies, origin)| text.replace(copies, origin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_shown_by_their_origin() {
        show("/cache/of/this/test", "s3://bucket/folder");
        let text = shown("/cache/of/this/test/a.gs4d: damaged, unlike /cache/of/another");
        assert_eq!(text, "s3://bucket/folder/a.gs4d: damaged, unlike /cache/of/another", "only what is a copy");
    }
}
