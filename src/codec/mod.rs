//! Files and scenes.
//!
//! In: a path and the options for what a file does not say. Out: a [`GaussianScene`], or the reverse.
//! [`checkpoint`] reads what a trainer stores (`.pth`), [`package`] reads and writes our own format (`.gs4d`).

pub mod checkpoint;
mod error;
pub mod package;

pub use error::{CodecError, CodecErrorKind};

use crate::scene::GaussianScene;
use checkpoint::CheckpointOptions;
use package::WriteSettings;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
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

/// Writes a scene as a package, through [`write_beside`].
///
/// # Errors
/// A scene that the format cannot hold, a folder that cannot be written to, a full disk.
pub fn save(path: &Path, scene: &GaussianScene, settings: &WriteSettings) -> Result<(), CodecError> {
    write_beside(path, |writer| package::write(writer, scene, settings))
}

/// Writes a file whole or not at all: `write` fills a temporary file in the same folder, which then takes the place of `path`.
/// If anything fails, or the program ends on the way, what was at `path` before is still there.
///
/// Devices and pipes are written to directly.
///
/// # Errors
/// What `write` reports, a folder that cannot be written to, a full disk.
pub fn write_beside<E>(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>) -> Result<(), CodecError>
where
    CodecErrorKind: From<E>,
{
    replace(path, write).map_err(|kind| CodecError { path: path.to_owned(), kind })
}

fn replace<E>(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>) -> Result<(), CodecErrorKind>
where
    CodecErrorKind: From<E>,
{
    if path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        let mut writer = BufWriter::new(File::create(path)?);
        write(&mut writer)?;
        return Ok(writer.flush()?);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".gs4d-").suffix(".part");
    #[cfg(unix)]
    {
        // As any new file: readable by whom the umask allows, not by the owner alone.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(folder)?;
    let mut writer = BufWriter::with_capacity(1 << 16, temporary.as_file().try_clone()?);
    write(&mut writer)?;
    writer.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
    temporary.persist(path).map_err(|failed| failed.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_what_was_there() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("scene.gs4d");
        write_beside(&path, |writer| writer.write_all(b"first")).expect("the folder can be written to");
        let failed = write_beside(&path, |writer| {
            writer.write_all(b"second")?;
            Err(io::Error::other("disk full"))
        });
        let message = failed.expect_err("the writer failed").to_string();
        assert!(message.contains("scene.gs4d: disk full"), "path and reason: {message}");
        assert_eq!(std::fs::read(&path).expect("still there"), b"first", "the old file is whole");
        write_beside(&path, |writer| writer.write_all(b"third")).expect("the folder can be written to");
        assert_eq!(std::fs::read(&path).expect("replaced"), b"third", "the new file took its place");
        let left = std::fs::read_dir(folder.path()).expect("the folder").count();
        assert_eq!(left, 1, "no temporary file stays behind");
    }

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
