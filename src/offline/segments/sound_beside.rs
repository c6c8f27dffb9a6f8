//! The sound of a capture in chunk files: a file beside them, which players load by itself.
//!
//! In: a capture, or the folder of its chunk files. Out: `index.ogg` or `index.wav` beside the index, byte for byte the
//! file that the capture carries; and back.

use super::error::SegmentsError;
use crate::codec::CodecError;
use crate::codec::input::read_at_most;
use crate::offline::work::{FileError, write_beside};
use crate::scene::{ChunkTable, SoundFile};
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The extensions that the file may have.
const EXTENSIONS: [&str; 2] = ["ogg", "wav"];

/// Returns where the sound of a capture is written: in a folder, with the extension of its kind.
pub fn sound_path(folder: &Path, sound: &SoundFile) -> PathBuf {
    let is_wave = sound.bytes().starts_with(b"RIFF");
    folder.join(ChunkTable::INDEX).with_extension(EXTENSIONS[usize::from(is_wave)])
}

/// Writes the sound of a capture, if it has one, and removes that of an earlier capture.
pub(super) fn write_sound(folder: &Path, sound: Option<&SoundFile>) -> Result<(), SegmentsError> {
    let own = sound.map(|sound| sound_path(folder, sound));
    for path in paths(folder).filter(|path| Some(path) != own.as_ref()) {
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(FileError::at(&path, error).into()),
            _ => {}
        }
    }
    match own.zip(sound) {
        Some((path, sound)) => Ok(write_beside(&path, |file| file.write_all(sound.bytes()))?),
        None => Ok(()),
    }
}

/// Returns the sound beside chunk files; `None` if there is none.
///
/// # Errors
/// A file that cannot be read, or is too large.
pub fn sound_beside(folder: &Path) -> Result<Option<Arc<SoundFile>>, CodecError> {
    let Some(path) = paths(folder).find(|path| path.exists()) else { return Ok(None) };
    let bytes = read_at_most(&path, SoundFile::MOST_BYTES as u64).map_err(|error| CodecError::at(&path, error))?;
    Ok(SoundFile::new(&bytes).ok().map(Arc::new))
}

/// Returns the paths at which a sound may be.
fn paths(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let index = folder.join(ChunkTable::INDEX);
    EXTENSIONS.into_iter().map(move |extension| index.with_extension(extension))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sound_is_written_beside_the_index_and_takes_the_place_of_another() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        let [song, wave] = [&b"OggS a song"[..], b"RIFF a wave"].map(|bytes| SoundFile::new(bytes).expect("bytes"));
        assert_eq!(sound_beside(folder).expect("nothing to read"), None, "no sound");
        for (sound, name) in [(&song, "index.ogg"), (&wave, "index.wav"), (&song, "index.ogg")] {
            write_sound(folder, Some(sound)).expect("the folder can be written to");
            assert_eq!(sound_path(folder, sound), folder.join(name), "the name by the kind");
            let names = folder.read_dir().expect("a folder").map(|entry| entry.expect("a file").file_name());
            assert_eq!(names.collect::<Vec<_>>(), [name], "one sound");
            let again = sound_beside(folder).expect("the sound can be read").expect("a sound");
            assert_eq!(again.bytes(), sound.bytes(), "the same bytes");
        }
        write_sound(folder, None).expect("the sound can be removed");
        assert_eq!(sound_beside(folder).expect("nothing to read"), None, "the sound of an earlier capture is gone");
    }
}
