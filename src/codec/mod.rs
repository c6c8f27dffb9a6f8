//! Files and scenes.
//!
//! In: a path, and options for what the file does not contain. Out: a [`GaussianScene`]; and back.
//! [`format`](mod@format) is the table of formats: [`checkpoint`] reads what a trainer stores (`.pth`), [`package`]
//! reads and writes the format of this crate (`.gs4d`).

pub mod checkpoint;
mod error;
pub mod format;
pub mod package;
pub(crate) mod text;

pub use error::{CodecError, CodecErrorKind};

use crate::scene::GaussianScene;
use checkpoint::CheckpointOptions;
use format::{FORMATS, Format};
use package::WriteSettings;
use std::fs::File;
use std::io::{BufReader, Read, Seek, Write};
use std::path::Path;

/// Reads a capture. Its format follows from the first bytes of the file, not from its name.
///
/// For a checkpoint, the file `cfg_args` in the same folder supplies what `options` leave open. For a package, which
/// stores how it was trained, only the options `up`, `duration_seconds` and `background` are used; they replace the
/// stored values.
///
/// # Errors
/// A file that cannot be opened, is of another format, or is damaged; invalid options.
pub fn load(path: &Path, options: &CheckpointOptions) -> Result<GaussianScene, CodecError> {
    load_file(path, options).map_err(|kind| CodecError { path: path.to_owned(), kind })
}

fn load_file(path: &Path, options: &CheckpointOptions) -> Result<GaussianScene, CodecErrorKind> {
    let mut file = BufReader::new(File::open(path)?);
    let mut start = Vec::new();
    file.by_ref().take(format::longest_magic() as u64).read_to_end(&mut start)?;
    file.rewind()?;
    let format = Format::of_start(&start).ok_or(CodecErrorKind::UnknownFormat)?;
    (format.read)(path, file, options)
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
    fn another_format_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (name, text) in [("empty.gs4d", ""), ("short.pth", "PK"), ("points.ply", "ply\nformat ascii 1.0\n")] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("the folder can be written to");
            let message = load(&path, &CheckpointOptions::default()).expect_err("not a capture").to_string();
            assert!(message.contains(name) && message.contains(".pth") && message.contains(".gs4d"), "{message}");
        }
    }
}
