//! Files and scenes.
//!
//! In: a path, and [`ReadOptions`] for settings that the file may not contain. Out: a [`GaussianScene`]; and back.
//! `format` is the table of formats: [`checkpoint`] reads the files of the 4DGS trainer (`.pth`), of gsplat and of
//! nerfstudio, [`package`] reads and writes the format of this crate (`.gs4d`), `import` reads those of other makes.
//! `found` finds the capture of a file, which may be inside of gzip or of a zip archive; `looks` says what a file is
//! that is no capture, `own_files` which files a capture has. `edits` reads a list of edits, [`sound`] what is heard
//! beside a capture. [`stream`] says which files of a capture in chunk files are fetched next.

pub(crate) mod budget;
pub mod checkpoint;
mod edits;
mod error;
pub(crate) mod export;
pub(crate) mod format;
mod found;
pub(crate) mod hidden;
pub(crate) mod import;
mod in_archive;
pub(crate) mod input;
pub(crate) mod json;
mod loading;
pub(crate) mod looks;
pub(crate) mod npy;
pub(crate) mod options;
mod own_files;
pub mod package;
pub(crate) mod pickle;
pub mod sound;
mod start;
pub mod stream;
pub(crate) mod text;
mod zstd_frames;

pub use edits::read_edits;
pub use error::{CodecError, CodecErrorKind};
pub use import::ImportError;
pub use loading::Loading;
pub use options::{InvalidOption, ReadOptions};
pub use own_files::files_of;

use crate::scene::GaussianScene;
use format::FORMATS;
pub use format::Format;
use format::Read;
use found::Found;
use import::Imported;
use import::source::{InFolder, InMemory, Others};
use import::{sequence, sog};
use input::Input;
use package::{PackageInfo, WriteSettings};
use start::Start;
use std::io::Write;
use std::path::Path;

/// A path that has been looked at.
enum Opened<'p> {
    /// The folder of a format that is read from folders.
    Folder(Format),
    /// A file, or the file of a folder that stands for all.
    File(Found<'p>),
}

/// Reads a capture: a file, the folder of a sequence of files, or that of a SOG. Its format follows from the contents
/// of the file, not from its name, unless nothing in the file tells it. A file in gzip is unpacked, and of a zip
/// archive its only capture is read. The format interprets the options; see [`ReadOptions`].
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
    let read = || match open(path, in_folder)? {
        Opened::File(mut found) => found.read(options),
        Opened::Folder(Format { read: Read::Folder(read), .. }) => Ok(read(path, options)?),
        Opened::Folder(_) => Err(CodecErrorKind::UnknownFormat(format::unknown_folder())),
    };
    read().map_err(|kind| CodecError::at(path, kind))
}

/// Reads a capture from bytes in memory, with the other files of its folder.
///
/// # Errors
/// Bytes of an unknown format; as [`load`].
pub(crate) fn read_bytes(
    path: &Path,
    bytes: Vec<u8>,
    others: InMemory,
    options: &ReadOptions,
) -> Result<Imported, CodecErrorKind> {
    Found::of(Input::of(bytes), path, Box::new(others))?.read(options)
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
    let inspect = || match open(path, in_folder)? {
        Opened::Folder(format) => Ok((format, None)),
        Opened::File(Found { format, input, .. }) => {
            Ok((format, format.inspect.map(|inspect| inspect(input)).transpose()?))
        }
    };
    inspect().map_err(|kind: CodecErrorKind| CodecError::at(path, kind))
}

/// Returns the files of a folder.
fn in_folder(folder: &Path) -> Others<'_> {
    Box::new(InFolder(folder))
}

/// Returns the file at a path, or the format of the folder there. `others` returns the files of a folder.
fn open<'p>(path: &'p Path, others: impl FnOnce(&'p Path) -> Others<'p>) -> Result<Opened<'p>, CodecErrorKind> {
    if !path.is_dir() {
        let folder = path.parent().unwrap_or(Path::new(""));
        return Ok(Opened::File(Found::of(Input::open(path)?, path, others(folder))?));
    }
    let start = Start::of_folder(path)?;
    if let Some(main) = sog::main_file(&start).map(|name| path.join(name)) {
        let mut input = Input::open(&main)?;
        if sog::is_of(&Start::of(&mut input, &main)?) {
            return Ok(Opened::File(Found::of(input, &main, others(path))?));
        }
    }
    let format = Format::of(&start).ok_or_else(|| CodecErrorKind::UnknownFormat(format::unknown_folder()))?;
    Ok(Opened::Folder(format))
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
        for (name, text, looks) in [
            ("empty.gs4d", "", "it is empty"),
            ("short.pth", "PK", "it is text that begins with PK"),
            ("points.obj", "v 0 0 0\n", "it is text that begins with v 0 0 0"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("the folder can be written to");
            let message = load(&path, &ReadOptions::default()).expect_err("not a capture").to_string();
            let is_complete = [name, ".pth", ".gs4d", looks].iter().all(|part| message.contains(part));
            assert!(is_complete, "the message names the file, the known formats and what it is: {message}");
        }
    }
}
