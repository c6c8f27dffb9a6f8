//! Files and scenes.
//!
//! In: a path, and [`ReadOptions`] for settings that the file may not contain. Out: a [`GaussianScene`]; and back.
//! `format` is the table of formats: [`checkpoint`] reads the files of the 4DGS trainer (`.pth`),
//! [`package`] reads and writes the format of this crate (`.gs4d`), `import` reads those of other makes.

pub mod checkpoint;
mod error;
pub(crate) mod export;
pub(crate) mod format;
mod fourdgs;
pub(crate) mod import;
pub(crate) mod npy;
pub(crate) mod options;
pub mod package;
mod start;
pub(crate) mod text;
mod zstd_frames;

pub use error::{CodecError, CodecErrorKind};
pub use import::ImportError;
pub use options::{InvalidOption, ReadOptions};

use crate::scene::GaussianScene;
use format::FORMATS;
pub use format::Format;
use format::Read;
use import::Imported;
use import::sequence;
use import::source::{Beside, InFolder, Source};
use package::{PackageInfo, WriteSettings};
use start::Start;
use std::fs::File;
use std::io::{BufReader, Cursor, Read as _, Write};
use std::path::Path;

/// Reads a capture: a file, or the folder of a sequence of files. Its format follows from the contents of the file, not from its name, unless
/// nothing in the file tells it. The format interprets the options; see [`ReadOptions`].
///
/// # Errors
/// A file that cannot be opened, is of an unknown format, or is damaged; options that are invalid or contradict the
/// file.
pub fn load(path: &Path, options: &ReadOptions) -> Result<GaussianScene, CodecError> {
    Ok(load_stating(path, options)?.scene)
}

/// As [`load`], with what of the file the scene does not show.
///
/// # Errors
/// As [`load`].
pub(crate) fn load_stating(path: &Path, options: &ReadOptions) -> Result<Imported, CodecError> {
    let read = || {
        let (format, file) = open(path)?;
        match (format.read, file) {
            (Read::File(read), Some(file)) => Ok(Imported { scene: read(path, file, options)?, lost: Vec::new() }),
            (Read::Bytes(read), Some(mut file)) => {
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes)?;
                let folder = path.parent().unwrap_or(Path::new(""));
                Ok(read(&Source { bytes: &bytes, beside: &InFolder(folder) }, options)?)
            }
            (Read::Folder(read), _) => Ok(read(path, options)?),
            (Read::File(_) | Read::Bytes(_), None) => Err(CodecErrorKind::UnknownFormat(format::unknown_folder())),
        }
    };
    read().map_err(|kind| CodecError { path: path.to_owned(), kind })
}

/// Reads a capture of another make from bytes in memory.
///
/// # Errors
/// Bytes of an unknown format, or of one that is read from files alone; as [`load`].
pub(crate) fn read_bytes(
    path: &Path,
    bytes: &[u8],
    beside: &dyn Beside,
    options: &ReadOptions,
) -> Result<Imported, CodecErrorKind> {
    let start = Start::of(&mut Cursor::new(bytes), path)?;
    match Format::of(&start).map(|format| format.read) {
        Some(Read::Bytes(read)) => Ok(read(&Source { bytes, beside }, options)?),
        Some(Read::File(_) | Read::Folder(_)) | None => Err(CodecErrorKind::UnknownFormat(format::unknown())),
    }
}

/// Reads the frames of a sequence, each the name and the bytes of a file, in order.
///
/// # Errors
/// As [`read_bytes`], with the name of the frame.
pub(crate) fn read_frames(frames: Vec<(String, Vec<u8>)>, options: &ReadOptions) -> Result<Imported, CodecErrorKind> {
    let frames = frames.into_iter().map(|(name, bytes)| sequence::Frame { name, bytes: Box::new(move || Ok(bytes)) });
    Ok(sequence::read(frames, options)?)
}

/// Returns the format of a file. If the files of that format have sections, all checksums are verified, and the header
/// and the damaged sections are returned too.
///
/// # Errors
/// A file that cannot be opened, is of an unknown format, or has a damaged header.
pub fn inspect(path: &Path) -> Result<(Format, Option<PackageInfo>), CodecError> {
    let inspect = || {
        let (format, file) = open(path)?;
        Ok((format, format.inspect.zip(file).map(|(inspect, file)| inspect(file)).transpose()?))
    };
    inspect().map_err(|kind| CodecError { path: path.to_owned(), kind })
}

/// Returns the format of a file, and the file at its start; of a folder the format alone.
fn open(path: &Path) -> Result<(Format, Option<BufReader<File>>), CodecErrorKind> {
    if path.is_dir() {
        let format = Format::of(&Start::of_folder(path)?);
        return Ok((format.ok_or_else(|| CodecErrorKind::UnknownFormat(format::unknown_folder()))?, None));
    }
    let mut file = BufReader::new(File::open(path)?);
    let start = Start::of(&mut file, path)?;
    let format = Format::of(&start).ok_or_else(|| CodecErrorKind::UnknownFormat(format::unknown()))?;
    Ok((format, Some(file)))
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
        for (name, text) in [("empty.gs4d", ""), ("short.pth", "PK"), ("points.obj", "v 0 0 0\n")] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("the folder can be written to");
            let message = load(&path, &ReadOptions::default()).expect_err("not a capture").to_string();
            let is_complete = [name, ".pth", ".gs4d"].iter().all(|part| message.contains(part));
            assert!(is_complete, "the message names the file and the known formats: {message}");
        }
    }
}
