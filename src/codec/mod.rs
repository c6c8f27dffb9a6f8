//! Files and scenes.
//!
//! In: a path and the options for what a file does not say. Out: a [`GaussianScene`].
//! [`checkpoint`] reads what a trainer stores (`.pth`), [`package`] reads and writes our own format (`.gs4d`).

pub mod checkpoint;
mod error;
pub mod package;

pub use error::{CodecError, CodecErrorKind};

use crate::scene::GaussianScene;
use checkpoint::CheckpointOptions;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// First bytes of a zip archive that is not empty.
const ZIP_MAGIC: [u8; 4] = *b"PK\x03\x04";
/// Most bytes read of `cfg_args`, which has some 300.
const CFG_ARGS_LIMIT: u64 = 1 << 16;

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
    let mut magic = Vec::new();
    file.by_ref().take(4).read_to_end(&mut magic)?;
    file.rewind()?;
    if magic == ZIP_MAGIC {
        let cfg_args = cfg_args_beside(path);
        Ok(checkpoint::read(file, options, cfg_args.as_deref())?)
    } else if magic == package::MAGIC {
        options.check()?;
        let mut scene = package::read(file)?;
        options.override_stored(&mut scene);
        Ok(scene)
    } else {
        Err(CodecErrorKind::UnknownFormat)
    }
}

/// The text of `cfg_args` in the folder of a checkpoint. It is optional: one that cannot be read counts as absent.
fn cfg_args_beside(path: &Path) -> Option<String> {
    let mut text = Vec::new();
    File::open(path.with_file_name("cfg_args")).ok()?.take(CFG_ARGS_LIMIT).read_to_end(&mut text).ok()?;
    Some(String::from_utf8_lossy(&text).into_owned())
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
