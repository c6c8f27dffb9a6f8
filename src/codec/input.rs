//! The bytes of a capture that is read: a file on disk, or memory.
//!
//! In: a path, or bytes that were unpacked from another file. Out: [`Input`], which can be read at any place. Only
//! regular files are opened: a named pipe or a device that a file names would be waited for without an end.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes that can be read at any place.
pub(crate) enum Input {
    /// A file.
    File(BufReader<File>),
    /// Bytes in memory.
    Memory(Cursor<Vec<u8>>),
}

impl Input {
    /// Opens a file.
    ///
    /// # Errors
    /// As [`open_regular`].
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        Ok(Self::File(BufReader::new(open_regular(path)?)))
    }

    /// Returns bytes in memory as input.
    pub(crate) fn of(bytes: Vec<u8>) -> Self {
        Self::Memory(Cursor::new(bytes))
    }

    /// Returns all bytes.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(crate) fn all(&mut self) -> io::Result<Cow<'_, [u8]>> {
        match self {
            Self::Memory(bytes) => Ok(Cow::Borrowed(bytes.get_ref().as_slice())),
            Self::File(file) => {
                let mut bytes = Vec::new();
                file.rewind()?;
                file.read_to_end(&mut bytes)?;
                Ok(Cow::Owned(bytes))
            }
        }
    }
}

impl Read for Input {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(into),
            Self::Memory(bytes) => bytes.read(into),
        }
    }
}

impl Seek for Input {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::Memory(bytes) => bytes.seek(to),
        }
    }
}

/// Opens a regular file.
///
/// # Errors
/// A file that is not there or cannot be opened; a folder, a named pipe or a device.
pub(crate) fn open_regular(path: &Path) -> io::Result<File> {
    let kind = std::fs::metadata(path)?;
    if kind.is_file() {
        return File::open(path);
    }
    let reason = if kind.is_dir() {
        "is a folder, not a file"
    } else {
        "is a pipe or a device, not a file: write its contents to a file first"
    };
    Err(io::Error::new(io::ErrorKind::InvalidInput, reason))
}

/// Reads a regular file.
///
/// # Errors
/// As [`open_regular`]; a file that cannot be read.
pub(crate) fn read_regular(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_regular(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a regular file up to a byte more than `most`, which shows that it is longer.
///
/// # Errors
/// As [`read_regular`].
pub(crate) fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_regular(path)?.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_and_its_bytes_in_memory_are_read_alike() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a");
        std::fs::write(&path, b"capture").expect("the folder can be written to");
        for mut input in [Input::open(&path).expect("a file"), Input::of(b"capture".to_vec())] {
            let mut end = [0; 3];
            input.seek(SeekFrom::End(-3)).expect("it has seven bytes");
            input.read_exact(&mut end).expect("three are left");
            assert_eq!(&end, b"ure", "the last bytes");
            assert_eq!(*input.all().expect("it can be read"), *b"capture", "all bytes");
        }
        let refused = open_regular(folder.path()).expect_err("a folder").to_string();
        assert!(refused.contains("is a folder"), "{refused}");
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_refused_without_waiting_for_them() {
        let refused = read_regular(Path::new("/dev/zero")).expect_err("a device without an end").to_string();
        assert!(refused.contains("a pipe or a device"), "{refused}");
    }
}
