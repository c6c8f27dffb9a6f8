//! The sound of a capture in chunk files: a file beside them, which players load by itself.
//!
//! In: a capture, or the folder of its chunk files. Out: `index.ogg` or `index.wav` beside the index, byte for byte the
//! file that the capture carries; and back. A sound beside an index belongs to it; any other is left alone.

use super::error::SegmentsError;
use crate::codec::CodecError;
use crate::codec::input::read_at_most;
use crate::offline::work::{FileError, write_beside};
use crate::scene::{ChunkTable, SoundFile};
use std::fs;
use std::io::{self, ErrorKind, Write};
use std::iter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The extensions that the file may have.
const EXTENSIONS: [&str; 2] = ["ogg", "wav"];

/// Returns where the sound of a capture is written: in a folder, with the extension of its kind.
pub fn sound_path(folder: &Path, sound: &SoundFile) -> PathBuf {
    let is_wave = sound.bytes().starts_with(b"RIFF");
    folder.join(ChunkTable::INDEX).with_extension(EXTENSIONS[usize::from(is_wave)])
}

/// Checks that no sound is beside chunk files that are written but that of the index that they replace, with which
/// players play it, or the same sound.
///
/// # Errors
/// A sound that belongs to no index: it would be replaced, or be played with a capture that has none.
pub fn require_own_sound(folder: &Path, sound: Option<&SoundFile>) -> Result<(), SegmentsError> {
    if folder.join(ChunkTable::INDEX).exists() {
        return Ok(());
    }
    let own = sound.map(|sound| (sound_path(folder, sound), sound.bytes()));
    let is_own = |path: &Path| {
        let same = own.as_ref().filter(|(own, _)| own == path);
        same.is_some_and(|(_, bytes)| fs::read(path).is_ok_and(|found| found == *bytes))
    };
    match paths(folder).find(|path| path.exists() && !is_own(path)) {
        Some(path) => Err(SegmentsError::OtherSound { path }),
        None => Ok(()),
    }
}

/// Removes the index of an earlier split, whose table is not that of the files that are written now, and the sound that
/// players play with it.
///
/// # Errors
/// As [`require_own_sound`]; a file that cannot be removed.
pub(crate) fn remove_index(folder: &Path, sound: Option<&SoundFile>) -> Result<(), SegmentsError> {
    require_own_sound(folder, sound)?;
    let index = folder.join(ChunkTable::INDEX);
    if index.exists() {
        for path in iter::once(index).chain(paths(folder)) {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(FileError::at(&path, error).into()),
                _ => {}
            }
        }
    }
    Ok(())
}

/// Writes the sound of a capture, if it has one.
pub(super) fn write_sound(folder: &Path, sound: Option<&SoundFile>) -> Result<(), SegmentsError> {
    match sound {
        Some(sound) => Ok(write_beside(&sound_path(folder, sound), |file| file.write_all(sound.bytes()))?),
        None => Ok(()),
    }
}

/// Returns the sound beside chunk files; `None` if there is none.
///
/// # Errors
/// A file that cannot be read, is too large or empty.
pub fn sound_beside(folder: &Path) -> Result<Option<Arc<SoundFile>>, CodecError> {
    let Some(path) = paths(folder).find(|path| path.exists()) else { return Ok(None) };
    let bytes = read_at_most(&path, SoundFile::MOST_BYTES as u64).map_err(|error| CodecError::at(&path, error))?;
    let sound = SoundFile::new(&bytes).map_err(|reason| CodecError::at(&path, io::Error::other(reason)))?;
    Ok(Some(Arc::new(sound)))
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
            remove_index(folder, Some(sound)).expect("an index with its sound, or nothing");
            write_sound(folder, Some(sound)).expect("the folder can be written to");
            assert_eq!(sound_path(folder, sound), folder.join(name), "the name by the kind");
            let names = folder.read_dir().expect("a folder").map(|entry| entry.expect("a file").file_name());
            assert_eq!(names.collect::<Vec<_>>(), [name], "one sound");
            let again = sound_beside(folder).expect("the sound can be read").expect("a sound");
            assert_eq!(again.bytes(), sound.bytes(), "the same bytes");
            fs::write(folder.join(ChunkTable::INDEX), b"").expect("the folder can be written to");
        }
        remove_index(folder, None).expect("an index with its sound");
        assert_eq!(sound_beside(folder).expect("nothing to read"), None, "the sound of an earlier capture is gone");
    }

    #[test]
    fn a_sound_without_an_index_is_left_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        let [song, other] =
            [&b"OggS a song"[..], b"OggS another"].map(|bytes| SoundFile::new(bytes).expect("a file has bytes"));
        let path = sound_path(folder, &song);
        fs::write(&path, song.bytes()).expect("the folder can be written to");
        for sound in [None, Some(&other)] {
            let refused = remove_index(folder, sound).expect_err("the song is of no split").to_string();
            assert!(refused.contains("index.ogg"), "the file is named: {refused}");
            assert_eq!(fs::read(&path).expect("the song"), song.bytes(), "it stays");
        }
        remove_index(folder, Some(&song)).expect("the same sound, of a split that was interrupted");
    }

    #[test]
    fn a_sound_that_no_capture_can_carry_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("index.wav"), b"").expect("the folder can be written to");
        let refused = sound_beside(folder.path()).expect_err("a file without bytes").to_string();
        assert!(refused.contains("index.wav") && refused.contains("without bytes"), "file and reason: {refused}");
    }
}
