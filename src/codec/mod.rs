//! Files and scenes.
//!
//! In: a path, and [`ReadOptions`] for settings that the file may not contain. Out: a [`GaussianScene`]; and back.
//! `format` is the table of formats: [`checkpoint`] reads the files of the 4DGS trainer (`.pth`),
//! [`package`] reads and writes the format of this crate (`.gs4d`).

pub mod checkpoint;
mod error;
pub(crate) mod format;
mod options;
pub mod package;
pub(crate) mod text;

pub use error::{CodecError, CodecErrorKind};
pub use options::{InvalidOption, ReadOptions};

use crate::scene::GaussianScene;
use format::FORMATS;
pub use format::Format;
use package::{PackageInfo, WriteSettings};
use std::fs::File;
use std::io::{BufReader, Read, Seek, Write};
use std::path::Path;

/// Reads a capture. Its format follows from the first bytes of the file, not from its name. The format interprets the
/// options; see [`ReadOptions`].
///
/// # Errors
/// A file that cannot be opened, is of an unknown format, or is damaged; options that are invalid or contradict the
/// file.
pub fn load(path: &Path, options: &ReadOptions) -> Result<GaussianScene, CodecError> {
    let read = || {
        let (format, file) = open(path)?;
        (format.read)(path, file, options)
    };
    read().map_err(|kind| CodecError { path: path.to_owned(), kind })
}

/// Returns the format of a file. If the files of that format have sections, all checksums are verified, and the header
/// and the damaged sections are returned too.
///
/// # Errors
/// A file that cannot be opened, is of an unknown format, or has a damaged header.
pub fn inspect(path: &Path) -> Result<(Format, Option<PackageInfo>), CodecError> {
    let inspect = || {
        let (format, file) = open(path)?;
        Ok((format, format.inspect.map(|inspect| inspect(file)).transpose()?))
    };
    inspect().map_err(|kind| CodecError { path: path.to_owned(), kind })
}

/// Returns the format of a file, and the file at its start.
fn open(path: &Path) -> Result<(Format, BufReader<File>), CodecErrorKind> {
    let mut file = BufReader::new(File::open(path)?);
    let mut start = Vec::new();
    file.by_ref().take(format::longest_magic() as u64).read_to_end(&mut start)?;
    file.rewind()?;
    let format = Format::of_start(&start).ok_or_else(|| CodecErrorKind::UnknownFormat(format::unknown()))?;
    Ok((format, file))
}

/// Writes a scene in the format that the extension of `path` names; as a package if there is no such format or it
/// cannot be written.
///
/// # Errors
/// A scene that the format cannot hold; errors of the writer.
pub fn write(
    writer: &mut dyn Write,
    path: &Path,
    scene: &GaussianScene,
    settings: &WriteSettings,
) -> Result<(), CodecErrorKind> {
    match FORMATS.iter().filter(|format| format.is_named(path)).find_map(|format| format.write) {
        Some(write) => write(writer, scene, settings),
        None => Ok(package::write(writer, scene, settings)?),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_an_unknown_format_is_refused_with_the_known_formats() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (name, text) in [("empty.gs4d", ""), ("short.pth", "PK"), ("points.ply", "ply\nformat ascii 1.0\n")] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("the folder can be written to");
            let message = load(&path, &ReadOptions::default()).expect_err("not a capture").to_string();
            let is_complete = [name, ".pth", ".gs4d"].iter().all(|part| message.contains(part));
            assert!(is_complete, "the message names the file and the known formats: {message}");
        }
    }
}
