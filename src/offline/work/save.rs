//! Writing files whole or not at all.
//!
//! In: a path and its contents: a scene, a picture, any bytes. Out: the file, which replaces an existing file only when
//! it is complete, and gets its permissions. A package is read back first.

use super::temporary_file;
use super::temporary_file::{Part, folder_of};
use super::unfinished::Streaming;
use crate::codec::package::{self, PackageError, WriteSettings};
use crate::codec::{self, CodecError, CodecErrorKind};
use crate::scene::{Form, GaussianScene, SceneForm};
use crate::view::Picture;
use image::codecs::png::PngEncoder;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Most symbolic links that are followed from one to the next, as on Linux.
const MAX_LINKS: usize = 40;

/// Writes a scene in the format of the path's extension ([`codec::write`]), as `write_beside` does. The new file is
/// read back whole before it replaces an existing one.
///
/// # Errors
/// A scene that the format cannot hold, a folder that cannot be written to, a full disk, a package that cannot be read
/// back.
pub fn save(path: &Path, scene: &GaussianScene, settings: &WriteSettings) -> Result<(), CodecError> {
    let part = part(path, |writer| codec::write(writer, path, scene, settings), |file| read_back(package::read(file)))?;
    temporary_file::replace(part.into_iter().collect())
}

/// Writes a chunk file, as [`save`] does. Codebooks of colors are left to the index of its capture.
///
/// # Errors
/// As [`save`].
pub(crate) fn save_chunk(path: &Path, scene: &GaussianScene, settings: &WriteSettings) -> Result<(), CodecError> {
    let read = |file| read_back(package::read_chunk(file, scene.form.codebooks()));
    let part = part(path, |writer| package::write_chunk(writer, scene, settings), read)?;
    temporary_file::replace(part.into_iter().collect())
}

/// Writes an index and the bytes of its chunk files, in the order of its table, into one file, as [`save`] does.
///
/// # Errors
/// As [`save`].
pub(crate) fn save_one_file(
    path: &Path,
    index: &GaussianScene,
    files: &[Vec<u8>],
    settings: &WriteSettings,
) -> Result<(), CodecError> {
    let write = |writer: &mut BufWriter<File>| -> Result<(), CodecErrorKind> {
        package::write_index(&mut *writer, index, settings)?;
        Ok(files.iter().try_for_each(|file| writer.write_all(file))?)
    };
    let part = part(path, write, |file| read_back(package::read(file)))?;
    temporary_file::replace(part.into_iter().collect())
}

/// Checks that a package that was just written can be read.
fn read_back(read: Result<GaussianScene, PackageError>) -> Result<(), CodecErrorKind> {
    match read {
        Ok(_) => Ok(()),
        Err(error) => {
            let message = format!("the package cannot be read back ({error}), so that it is not kept");
            Err(io::Error::other(message).into())
        }
    }
}

/// Returns the settings for writing a scene of this form. `level` is the zstd level, 1 to 19; `None` uses 19 for the
/// packed form and the default of [`WriteSettings`] for the others.
pub(crate) fn write_settings(form: &SceneForm, level: Option<i32>) -> WriteSettings {
    let usual = match form {
        // Level 19 saves a tenth of the bytes and takes seconds.
        SceneForm::Ready(Form::Packed(_)) => 19,
        SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => WriteSettings::default().level,
    };
    WriteSettings { level: level.unwrap_or(usual) }
}

/// Writes a picture as an 8-bit PNG file, through [`write_beside`].
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub(crate) fn write_png(path: &Path, picture: &Picture) -> Result<(), CodecError> {
    write_beside(path, |file| picture.to_rgb8().write_with_encoder(PngEncoder::new(file)).map_err(io::Error::other))
}

/// Writes a file whole or not at all: `write` fills a temporary file in the same folder, which then replaces `path`. If
/// anything fails, or the program ends before, an existing file at `path` is unchanged. The new file has the
/// permissions of the one that it replaces; a symbolic link stays, and the file that it leads to is replaced.
///
/// Devices and pipes are written to directly.
///
/// # Errors
/// Errors of `write`, a folder that cannot be written to, a full disk.
pub(crate) fn write_beside<E>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), CodecError>
where
    CodecErrorKind: From<E>,
{
    let part = part(path, write, |_| Ok(()))?;
    temporary_file::replace(part.into_iter().collect())
}

/// Writes files that belong together, as [`write_beside`] does: no existing file is replaced before all are complete.
/// Files after the first are never beside another first file than their own.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub(crate) fn write_together(files: &[(&Path, &[u8])]) -> Result<(), CodecError> {
    let part = |&(path, bytes): &(&Path, &[u8])| part(path, |file| file.write_all(bytes), |_| Ok(())).transpose();
    temporary_file::replace(files.iter().filter_map(part).collect::<Result<_, _>>()?)
}

/// Writes a complete temporary file that is to replace the output `path`. Returns it with the path that it replaces;
/// `None` if a device or a pipe was written. `check` may refuse the file.
fn part<E>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
    check: impl FnOnce(File) -> Result<(), CodecErrorKind>,
) -> Result<Option<(Part, PathBuf)>, CodecError>
where
    CodecErrorKind: From<E>,
{
    filled(path, write, check).map_err(|kind| CodecError::at(path, kind))
}

fn filled<E>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
    check: impl FnOnce(File) -> Result<(), CodecErrorKind>,
) -> Result<Option<(Part, PathBuf)>, CodecErrorKind>
where
    CodecErrorKind: From<E>,
{
    if is_stream(path) {
        let _streaming = Streaming::begin();
        let mut writer = BufWriter::new(File::create(path)?);
        write(&mut writer)?;
        writer.flush()?;
        return Ok(None);
    }
    let target = resolved(path);
    let part = temporary_file::create(target.clone())?;
    let mut writer = BufWriter::with_capacity(1 << 16, part.file.try_clone()?);
    write(&mut writer)?;
    let written = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
    written.sync_all()?;
    check(written)?;
    if let Ok(replaced) = target.metadata()
        && replaced.is_file()
    {
        part.file.set_permissions(replaced.permissions())?;
    }
    Ok(Some((part, path.to_owned())))
}

/// Returns whether a path leads to a device or a pipe.
pub(crate) fn is_stream(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// Returns a path without symbolic links, whether its file exists or not.
pub(crate) fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        if let Ok(found) = path.canonicalize() {
            return found;
        }
        match fs::read_link(&path) {
            Ok(link) => path = folder_of(&path).join(link),
            Err(_) => break,
        }
    }
    match path.file_name() {
        Some(name) => resolved(folder_of(&path)).join(name),
        None => path,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Packing;
    use crate::scene::synth::{SynthSettings, synthesize};

    #[test]
    fn a_failed_write_keeps_the_old_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("scene.gs4d");
        write_beside(&path, |writer| writer.write_all(b"first")).expect("the folder can be written to");
        let failed = write_beside(&path, |writer| {
            writer.write_all(b"second")?;
            Err(io::Error::other("disk full"))
        });
        let message = failed.expect_err("the writer failed").to_string();
        assert!(message.contains("scene.gs4d: disk full"), "path and reason: {message}");
        assert_eq!(fs::read(&path).expect("still there"), b"first", "the old file is unchanged");
        write_beside(&path, |writer| writer.write_all(b"third")).expect("the folder can be written to");
        assert_eq!(fs::read(&path).expect("replaced"), b"third", "the new file has replaced the old file");
        let left = fs::read_dir(folder.path()).expect("the folder").count();
        assert_eq!(left, 1, "no temporary file is left");
    }

    #[test]
    fn a_package_that_cannot_be_read_back_replaces_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("scene.gs4d");
        let scene = synthesize(&SynthSettings { count: 40, ..SynthSettings::default() });
        let runtime = scene.into_runtime().expect("a synthetic scene can be drawn");
        let mut packed = GaussianScene::from(runtime.pack(&Packing::default()).expect("the scene can be packed"));
        save(&path, &packed, &WriteSettings::default()).expect("a package that can be read");
        let before = fs::read(&path).expect("the package is there");
        let SceneForm::Ready(Form::Packed(records)) = &mut packed.form else { panic!("the scene is packed") };
        records.ranges[0][0] = f32::INFINITY;
        let message =
            save(&path, &packed, &WriteSettings::default()).expect_err("the package cannot be read").to_string();
        assert!(message.contains("scene.gs4d") && message.contains("not finite"), "path and reason: {message}");
        assert_eq!(fs::read(&path).expect("still there"), before, "the old package is unchanged");
        assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 1, "no temporary file is left");
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [file, link, ahead, later] = ["file", "link", "ahead", "later"].map(|name| folder.path().join(name));
        fs::write(&file, b"first").expect("the folder can be written to");
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).expect("permissions can be set");
        symlink("file", &link).expect("the folder can be written to");
        symlink(&later, &ahead).expect("the folder can be written to");
        for path in [&link, &ahead] {
            write_beside(path, |writer| writer.write_all(b"second")).expect("the folder can be written to");
            assert!(path.is_symlink(), "{} is still a link", path.display());
        }
        for path in [&file, &later] {
            assert_eq!(fs::read(path).expect("the file exists"), b"second", "{} was written", path.display());
        }
        let mode = file.metadata().expect("the file exists").permissions().mode() & 0o777;
        assert_eq!(mode, 0o640, "the permissions are those of the replaced file");
    }
}
