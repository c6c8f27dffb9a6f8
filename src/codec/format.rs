//! The table of formats that captures are stored in.
//!
//! In: the first bytes or the name of a file. Out: its [`Format`], with the functions that read and write it. A further
//! format is one new file in this folder, which defines its row, and one line of [`FORMATS`].

use super::CodecErrorKind;
use super::checkpoint::{self, CheckpointOptions};
use super::package::{self, WriteSettings};
use crate::scene::GaussianScene;
use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

/// A file format: a row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Format {
    /// Description of a file of this format, with article and extension, for messages.
    pub name: &'static str,
    /// Extensions of its files, without the dot.
    pub extensions: &'static [&'static str],
    /// The first bytes of each of its files.
    pub magic: &'static [u8],
    /// Reads a scene from the file at a path, which is open and positioned at its start.
    pub read: fn(&Path, BufReader<File>, &CheckpointOptions) -> Result<GaussianScene, CodecErrorKind>,
    /// Writes a scene; `None` if the format is only read.
    pub write: Option<fn(&mut dyn Write, &GaussianScene, &WriteSettings) -> Result<(), CodecErrorKind>>,
}

/// All formats.
pub const FORMATS: &[Format] = &[checkpoint::FORMAT, package::FORMAT];

impl Format {
    /// Returns the format of a file that starts with these bytes, of which [`longest_magic`] are enough; `None` if no
    /// format does.
    pub fn of_start(start: &[u8]) -> Option<Self> {
        FORMATS.iter().copied().find(|format| start.starts_with(format.magic))
    }

    /// Returns whether a path ends in one of its extensions.
    pub fn is_named(&self, path: &Path) -> bool {
        path.extension()
            .is_some_and(|found| self.extensions.iter().any(|extension| found.eq_ignore_ascii_case(extension)))
    }
}

/// Returns the largest number of first bytes by which a format is recognized.
pub fn longest_magic() -> usize {
    FORMATS.iter().map(|format| format.magic.len()).max().unwrap_or_default()
}

/// Returns the message about a file of no known format.
pub(super) fn none_of_them() -> String {
    let names: Vec<&str> = FORMATS.iter().map(|format| format.name).collect();
    match names.split_last() {
        Some((last, others)) => format!("neither {} nor {last}", others.join(", ")),
        None => "of no known format".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_about_a_foreign_file_names_every_format() {
        let expected = "neither a checkpoint of the 4DGS trainer (.pth, a zip archive) nor a package (.gs4d)";
        assert_eq!(none_of_them(), expected, "every format by name and extension");
    }

    #[test]
    fn no_file_is_of_two_formats() {
        for (index, format) in FORMATS.iter().enumerate() {
            for other in &FORMATS[index + 1..] {
                let clash = format.magic.starts_with(other.magic) || other.magic.starts_with(format.magic);
                assert!(!clash, "{} and {} start alike", format.name, other.name);
                let shared = format.extensions.iter().any(|extension| other.extensions.contains(extension));
                assert!(!shared, "{} and {} end alike", format.name, other.name);
            }
        }
    }
}
