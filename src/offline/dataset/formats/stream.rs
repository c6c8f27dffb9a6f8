//! Numbers of binary files, little-endian.
//!
//! In: a file. Out: its numbers, one after the other. No number of the file is used before as many bytes are known to
//! be there.

use super::files::utf8_or_latin1;
use crate::offline::dataset::DatasetError;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// A file that is read from its beginning.
pub(crate) struct Stream {
    reader: BufReader<File>,
    /// Bytes that have not been read.
    left: u64,
    path: PathBuf,
}

impl Stream {
    pub(crate) fn open(path: &Path) -> Result<Self, DatasetError> {
        let failed = |reason| DatasetError::Read { path: path.to_owned(), reason };
        let file = File::open(path).map_err(failed)?;
        let left = file.metadata().map_err(failed)?.len();
        Ok(Self { reader: BufReader::new(file), left, path: path.to_owned() })
    }

    pub(crate) fn u8s<const N: usize>(&mut self) -> Result<[u8; N], DatasetError> {
        self.require(N as u64)?;
        let mut bytes = [0; N];
        self.reader.read_exact(&mut bytes).map_err(|reason| DatasetError::Read { path: self.path.clone(), reason })?;
        Ok(bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, DatasetError> {
        self.u8s().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, DatasetError> {
        self.u8s().map(u64::from_le_bytes)
    }

    pub(crate) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], DatasetError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_le_bytes(self.u8s()?);
        }
        Ok(values)
    }

    /// Skips `count` records of `size` bytes.
    pub(crate) fn skip(&mut self, count: u64, size: u64) -> Result<(), DatasetError> {
        let length = count.checked_mul(size).ok_or_else(|| self.cut_off())?;
        self.require(length)?;
        let offset = i64::try_from(length).map_err(|_| self.cut_off())?;
        self.reader.seek_relative(offset).map_err(|reason| DatasetError::Read { path: self.path.clone(), reason })
    }

    /// Reads a text that ends in 0, of at most `longest` bytes, in UTF-8 or Latin-1.
    pub(crate) fn text(&mut self, longest: usize) -> Result<String, DatasetError> {
        let mut bytes = Vec::new();
        let limit = self.left.min(longest as u64 + 1);
        let read = self.reader.by_ref().take(limit).read_until(0, &mut bytes);
        let read = read.map_err(|reason| DatasetError::Read { path: self.path.clone(), reason })?;
        self.left -= read as u64;
        match bytes.pop() {
            Some(0) => Ok(utf8_or_latin1(&bytes).into_owned()),
            _ => Err(self.unusable("a name in it does not end: copy the file again, or write it again with COLMAP")),
        }
    }

    pub(crate) fn unusable(&self, reason: impl Into<String>) -> DatasetError {
        DatasetError::Unusable { path: self.path.clone(), reason: reason.into() }
    }

    /// Takes a number of bytes from those that are left.
    fn require(&mut self, length: u64) -> Result<(), DatasetError> {
        self.left = self.left.checked_sub(length).ok_or_else(|| self.cut_off())?;
        Ok(())
    }

    fn cut_off(&self) -> DatasetError {
        self.unusable(
            "it is cut off, or one of its counts is wrong: copy the file again, or write it again with COLMAP",
        )
    }
}
