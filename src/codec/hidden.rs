//! Files that systems put beside those of people.
//!
//! In: the name of an entry of a folder. Out: whether it is left out of every list: `._NAME` of macOS, `Thumbs.db` of Windows.

use std::ffi::OsStr;

/// Names of files and folders of systems that do not begin with a dot: Windows, archives of macOS, Synology.
const OF_SYSTEMS: [&str; 4] = ["Thumbs.db", "desktop.ini", "__MACOSX", "@eaDir"];

/// Returns whether an entry of a folder is hidden, by a dot before its name, or is a file of a system.
pub(crate) fn is_hidden(name: &OsStr) -> bool {
    name.as_encoded_bytes().starts_with(b".") || OF_SYSTEMS.iter().any(|known| name.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_systems_are_hidden() {
        for name in ["._0001.png", ".DS_Store", ".gs4d-1", "Thumbs.db", "thumbs.DB", "desktop.ini", "__MACOSX"] {
            assert!(is_hidden(OsStr::new(name)), "{name} is hidden");
        }
        for name in ["0001.png", "_0001.png", "a.DS_Store", "Thumbs.db.png"] {
            assert!(!is_hidden(OsStr::new(name)), "{name} is a file of people");
        }
    }
}
