//! The table of the file formats of captures.
//!
//! In: the first bytes or the name of a file. Out: its [`Format`], with the functions that read and write it. A further
//! format is one new file in this folder and one row of [`FORMATS`]. The formats do not use the table.

use super::checkpoint;
use super::error::CodecErrorKind;
use super::options::ReadOptions;
use super::package::{self, PackageInfo, WriteSettings};
use crate::scene::GaussianScene;
use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

/// A file format: a row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Format {
    /// One word for a file of this format, for reports.
    pub id: &'static str,
    /// Description of a file of this format, with article and extension, for messages.
    pub name: &'static str,
    /// Extensions of its files, without the dot.
    pub extensions: &'static [&'static str],
    /// The first bytes of each of its files.
    pub magic: &'static [u8],
    /// Reads a scene from the file at a path, which is open and positioned at its start.
    pub read: fn(&Path, BufReader<File>, &ReadOptions) -> Result<GaussianScene, CodecErrorKind>,
    /// Writes a scene; `None` if the format is only read.
    pub write: Option<fn(&mut dyn Write, &GaussianScene, &WriteSettings) -> Result<(), CodecErrorKind>>,
    /// Verifies the checksums of a file without building the scene, and returns its header and the damaged sections;
    /// `None` if the files of the format have no sections.
    pub inspect: Option<fn(BufReader<File>) -> Result<PackageInfo, CodecErrorKind>>,
}

/// All formats.
pub const FORMATS: &[Format] = &[
    Format {
        id: "checkpoint",
        name: "a checkpoint of the 4DGS trainer (.pth, a zip archive)",
        extensions: checkpoint::EXTENSIONS,
        magic: &checkpoint::MAGIC,
        read: read_checkpoint,
        write: None,
        inspect: None,
    },
    Format {
        id: "package",
        name: "a package (.gs4d)",
        extensions: package::EXTENSIONS,
        magic: &package::MAGIC,
        read: read_package,
        write: Some(write_package),
        inspect: Some(inspect_package),
    },
];

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
pub(super) fn unknown() -> String {
    let names: Vec<&str> = FORMATS.iter().map(|format| format.name).collect();
    match names.split_last() {
        Some((last, others)) => format!("neither {} nor {last}", others.join(", ")),
        None => "of no known format".to_owned(),
    }
}

fn read_checkpoint(path: &Path, file: BufReader<File>, options: &ReadOptions) -> Result<GaussianScene, CodecErrorKind> {
    Ok(checkpoint::read_file(path, file, options)?)
}

fn read_package(_: &Path, file: BufReader<File>, options: &ReadOptions) -> Result<GaussianScene, CodecErrorKind> {
    Ok(package::read_with(file, options)?)
}

fn write_package(
    writer: &mut dyn Write,
    scene: &GaussianScene,
    settings: &WriteSettings,
) -> Result<(), CodecErrorKind> {
    Ok(package::write(writer, scene, settings)?)
}

fn inspect_package(file: BufReader<File>) -> Result<PackageInfo, CodecErrorKind> {
    Ok(package::inspect(file)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_about_an_unknown_format_names_every_format() {
        let expected = "neither a checkpoint of the 4DGS trainer (.pth, a zip archive) nor a package (.gs4d)";
        assert_eq!(unknown(), expected, "every format by name and extension");
    }

    #[test]
    fn no_two_formats_have_the_same_magic_or_extension() {
        for (index, format) in FORMATS.iter().enumerate() {
            for other in &FORMATS[index + 1..] {
                let clash = format.magic.starts_with(other.magic) || other.magic.starts_with(format.magic);
                assert!(!clash, "{} and {} differ in their first bytes", format.name, other.name);
                let common = format.extensions.iter().any(|extension| other.extensions.contains(extension));
                assert!(!common, "{} and {} differ in their extensions", format.name, other.name);
            }
        }
    }
}
