//! Files and scenes.
//!
//! In: a path and the options for what a file does not say. Out: a [`GaussianScene`]; and back. [`format`](mod@format) is the table of
//! formats: [`checkpoint`] reads what a trainer stores (`.pth`), [`package`] reads and writes our own format (`.gs4d`).

pub mod checkpoint;
mod error;
pub mod format;
pub mod package;

pub use error::{CodecError, CodecErrorKind};

use crate::scene::GaussianScene;
use checkpoint::CheckpointOptions;
use format::{FORMATS, Format};
use package::WriteSettings;
use std::fs::File;
use std::io::{BufReader, Read, Seek, Write};
use std::path::Path;

/// Reads a capture, whichever format the file is in (its first bytes tell, not its name).
///
/// For a checkpoint, `cfg_args` beside it supplies what `options` leave open. For a package, which knows how it was trained,
/// only the options `up`, `duration_seconds` and `background` count, and replace what is stored.
///
/// # Errors
/// A file that cannot be opened, is of another format, or is damaged; options that make no sense.
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

/// Writes a scene in the format that the name of the file asks for; as a package if that format cannot be written, or is none.
///
/// # Errors
/// A scene that the format cannot hold, and what the writer reports.
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
