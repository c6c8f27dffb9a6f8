//! Writing files whole or not at all.
//!
//! In: a path and its contents: a scene, a picture, anything else. Out: the file, which replaces an existing one only
//! once it is complete.

use super::OfflineError;
use crate::codec::package::WriteSettings;
use crate::codec::{self, CodecError, CodecErrorKind};
use crate::scene::{Form, GaussianScene, SceneForm};
use crate::view::Picture;
use image::codecs::png::PngEncoder;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a scene in the format of the path's extension ([`codec::write`]), through [`write_beside`].
///
/// # Errors
/// A scene that the format cannot hold, a folder that cannot be written to, a full disk.
pub fn save(path: &Path, scene: &GaussianScene, settings: &WriteSettings) -> Result<(), CodecError> {
    write_beside(path, |writer| codec::write(writer, path, scene, settings))
}

/// Returns the settings for writing a scene of this form. `level` is the zstd level, 1 to 19; `None` uses 19 for the
/// packed form and the default of [`WriteSettings`] for the others.
pub fn write_settings(form: &SceneForm, level: Option<i32>) -> WriteSettings {
    let usual = match form {
        // A tenth of the bytes for seconds of time.
        SceneForm::Ready(Form::Packed(_)) => 19,
        SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => WriteSettings::default().level,
    };
    WriteSettings { level: level.unwrap_or(usual) }
}

/// Checks that `out` is not the same file as `input`, which would be overwritten while it is still needed.
///
/// # Errors
/// Both paths lead to the same file.
pub fn require_another_file(input: &Path, out: &Path) -> Result<(), OfflineError> {
    match (input.canonicalize(), out.canonicalize()) {
        (Ok(a), Ok(b)) if a == b => Err(OfflineError::at(out, "is the input itself: write to another file")),
        _ => Ok(()),
    }
}

/// Writes a picture as an 8-bit PNG file, through [`write_beside`].
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub fn write_png(path: &Path, picture: &Picture) -> Result<(), CodecError> {
    write_beside(path, |file| picture.to_rgb8().write_with_encoder(PngEncoder::new(file)).map_err(io::Error::other))
}

/// Writes a file whole or not at all: `write` fills a temporary file in the same folder, which then replaces `path`. If
/// anything fails, or the program ends before, an existing file at `path` is unchanged.
///
/// Devices and pipes are written to directly.
///
/// # Errors
/// Errors of `write`, a folder that cannot be written to, a full disk.
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
        // Permissions as of any new file, by the umask; those of temporary files allow the owner only.
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
}
