//! The limit of the memory of a package with the packages within it, which follows from the length of the file.
//!
//! In: the header of a package, then the bytes of each level of detail and each chunk file. Out: the header of the
//! level or the chunk file; an error above the limit.

use super::check::unpacked_limit;
use super::envelope;
use super::error::PackageError;
use super::header::Header;
use crate::scene::ChunkFile;
use std::io::Cursor;

/// The bytes that a package and the packages within it take when they are read, and their limit.
pub(super) struct MemoryLimit {
    raw: u64,
    limit: u64,
}

impl MemoryLimit {
    /// Returns the bytes of the scene of a header, and the limit for a file of this length.
    pub(super) fn of(header: &Header, file_length: u64) -> Self {
        Self { raw: header.unpacked(), limit: unpacked_limit(file_length) }
    }

    /// Returns the header of a level of detail, which must be within the limit and have no levels, and its end.
    pub(super) fn header_of_level(&mut self, body: &[u8]) -> Result<(Header, u64), PackageError> {
        let (header, start) = read(body)?;
        if !header.levels.is_empty() {
            return Err(PackageError::Inconsistent("a level of detail that has levels itself"));
        }
        self.add(&header)?;
        Ok((header, start))
    }

    /// Returns the header of a chunk file, which must be within the limit and have what the table says, and its end.
    pub(super) fn header_of_chunk(&mut self, body: &[u8], file: &ChunkFile) -> Result<(Header, u64), PackageError> {
        let (header, start) = read(body)?;
        header.check_chunk(file)?;
        self.add(&header)?;
        Ok((header, start))
    }

    fn add(&mut self, header: &Header) -> Result<(), PackageError> {
        self.raw = self.raw.saturating_add(header.unpacked());
        match self.raw > self.limit {
            true => Err(PackageError::TooLarge { raw: self.raw, limit: self.limit }),
            false => Ok(()),
        }
    }
}

/// Reads the header of a package. Also returns where its first section starts.
fn read(body: &[u8]) -> Result<(Header, u64), PackageError> {
    let mut reader = Cursor::new(body);
    let (header, _) = envelope::read(&mut reader)?;
    Ok((header, reader.position()))
}

/// Returns a function that adds the number of a chunk file, from 0, to an error.
pub(super) fn of_chunk(number: usize) -> impl FnOnce(PackageError) -> PackageError {
    move |reason| PackageError::ChunkFile { number, reason: Box::new(reason) }
}

/// Returns a function that adds the index of a level of detail, from 0, to an error.
pub(super) fn of_level(index: usize) -> impl FnOnce(PackageError) -> PackageError {
    move |reason| PackageError::Level { index, reason: Box::new(reason) }
}
