//! Files of torch before 1.6: pickles, then the values of each storage, without an archive.
//!
//! In: a seekable reader. Out: the bytes of the pickle of the objects, and those of one storage at a time. Nothing
//! checks whether values are damaged.

use super::error::CheckpointError;
use super::pickle::{Pickle, Value};
use crate::codec::text::printable;
use std::io::{self, Read, Seek, SeekFrom};

/// Largest size of `data.pkl` in bytes. In real checkpoints it has about 5,000, for any number of Gaussians.
pub(super) const PICKLE_LIMIT: u64 = 1 << 20;
/// The first bytes: the pickles of the magic number and of the version of the format, 1001.
pub(super) const START: &[u8] = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.\x80\x02M\xe9\x03.";

/// A file.
pub(super) struct Legacy<R> {
    reader: R,
    pickle: Vec<u8>,
    storages: Vec<Stored>,
}

/// The place of the values of a storage.
struct Stored {
    key: String,
    /// Offset in the file and size, bytes.
    start: u64,
    size: u64,
}

impl<R: Read + Seek> Legacy<R> {
    /// Returns whether the bytes of a reader begin with [`START`], and rewinds it.
    ///
    /// # Errors
    /// Errors of the reader.
    pub(super) fn is_start_of(reader: &mut R) -> io::Result<bool> {
        let mut bytes = Vec::new();
        reader.rewind()?;
        reader.by_ref().take(START.len() as u64).read_to_end(&mut bytes)?;
        reader.rewind()?;
        Ok(bytes == START)
    }

    /// Finds the pickle of the objects, and the values of every storage, in a file of `length` bytes.
    ///
    /// # Errors
    /// Pickles that are damaged; another byte order; a storage beyond the end of the file.
    pub(super) fn open(mut reader: R, length: u64) -> Result<Self, CheckpointError> {
        let mut bytes = Vec::new();
        reader.by_ref().take(PICKLE_LIMIT).read_to_end(&mut bytes).map_err(CheckpointError::Io)?;
        let after = |at: usize| bytes.get(at..).unwrap_or_default();
        let system = Pickle::parse_inert(after(START.len()))?;
        if !matches!(system.entry(system.root(), "little_endian"), Some(Value::Bool(true))) {
            return Err(CheckpointError::ByteOrder("big".to_owned()));
        }
        let first = START.len() + system.length();
        let objects = Pickle::parse_inert(after(first))?;
        let last = first + objects.length();
        let keys = Pickle::parse_inert(after(last))?;
        let mut at = (last + keys.length()) as u64;
        let mut storages = Vec::new();
        for key in texts(&keys)? {
            let size = objects.size_of_storage(key).ok_or_else(|| {
                CheckpointError::Layout(format!("the storage {} has values of an unknown type", printable(key)))
            })?;
            let stored = Stored::read(&mut reader, key, at, size, length)?;
            at = stored.start + stored.size;
            storages.push(stored);
        }
        Ok(Self { reader, pickle: after(first)[..objects.length()].to_vec(), storages })
    }

    /// Returns the pickle of the objects.
    pub(super) fn pickle(&self) -> &[u8] {
        &self.pickle
    }

    /// Returns the index and the size in bytes of the storage that an archive would have under this name.
    pub(super) fn find(&self, name: &str) -> Option<(usize, u64)> {
        let key = name.strip_prefix("data/")?;
        let index = self.storages.iter().position(|stored| stored.key == key)?;
        Some((index, self.storages[index].size))
    }

    /// Returns the bytes of a storage.
    ///
    /// # Errors
    /// Errors of the reader.
    pub(super) fn entry(&mut self, index: usize) -> io::Result<impl Read> {
        let (start, size) = self.storages.get(index).map_or((0, 0), |stored| (stored.start, stored.size));
        self.reader.seek(SeekFrom::Start(start))?;
        Ok(self.reader.by_ref().take(size))
    }
}

impl Stored {
    /// Reads the number of values of a storage, which is before them.
    fn read(
        reader: &mut (impl Read + Seek),
        key: &str,
        at: u64,
        size_of_value: u64,
        length: u64,
    ) -> Result<Self, CheckpointError> {
        let mut count = [0; 8];
        reader.seek(SeekFrom::Start(at)).and_then(|_| reader.read_exact(&mut count)).map_err(CheckpointError::Io)?;
        let (start, size) = (at + 8, u64::from_le_bytes(count).saturating_mul(size_of_value));
        if start.checked_add(size).is_none_or(|end| end > length) {
            return Err(CheckpointError::EntrySize { entry: printable(key), size });
        }
        Ok(Self { key: key.to_owned(), start, size })
    }
}

/// Returns the texts of the list that is the outermost value.
fn texts<'p>(pickle: &'p Pickle<'_>) -> Result<Vec<&'p str>, CheckpointError> {
    let damaged = || CheckpointError::Layout("the list of its storages is damaged; copy the file again".to_owned());
    let Value::List(ids) = pickle.root() else { return Err(damaged()) };
    let text = |&id: &u32| match pickle.get(id) {
        Value::Text(key) => Ok(*key),
        _ => Err(damaged()),
    };
    ids.iter().map(text).collect()
}
