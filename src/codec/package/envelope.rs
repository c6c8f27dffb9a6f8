//! The fixed start of a package, and its header as bytes.
//!
//! In: a [`Header`]. Out: magic, version, length, checksum and RON text; and back, checked against the file length.

use super::error::PackageError;
use super::header::Header;
use std::io::{self, Read, Seek, SeekFrom, Write};

/// The first bytes of every package.
pub const MAGIC: [u8; 4] = *b"GS4D";

/// The format version written, and the only one read. It increases when an old reader could no longer read the fixed
/// start or the header; smaller changes are listed in [`Header::requires`].
pub const VERSION: u32 = 1;

/// Bytes before the header: magic, version, header length, checksum.
const FIXED: u64 = 20;

/// Longest header read, bytes. A million Gaussians need a tenth of a megabyte.
const HEADER_LIMIT: u64 = 16 << 20;

/// Writes the fixed start and the header, after checking that [`read`] accepts both. Returns the length of the file.
pub(super) fn write(writer: &mut impl Write, header: &Header) -> Result<u64, PackageError> {
    let text = header.to_text()?;
    let length = text.len() as u64;
    check_length(length)?;
    let file_length = header.length(FIXED + length);
    header.check(FIXED + length, file_length)?;
    writer.write_all(&MAGIC)?;
    writer.write_all(&VERSION.to_le_bytes())?;
    writer.write_all(&length.to_le_bytes())?;
    writer.write_all(&checksum(text.as_bytes()).to_le_bytes())?;
    writer.write_all(text.as_bytes())?;
    Ok(file_length)
}

/// Reads and checks the fixed start and the header. Also returns the length of the whole file; the reader is then
/// positioned at the first section.
pub(super) fn read(reader: &mut (impl Read + Seek)) -> Result<(Header, u64), PackageError> {
    let file_length = reader.seek(SeekFrom::End(0))?;
    reader.rewind()?;
    let (header, start) = read_header(reader, file_length)?;
    header.check(start, file_length)?;
    Ok((header, file_length))
}

/// Reads and checks the fixed start and the header of an index that chunk files follow, of which all bytes up to the
/// first of these can be read. Also returns its length: the chunk files are only claimed.
pub(super) fn read_index(reader: &mut impl Read, bytes: u64) -> Result<(Header, u64), PackageError> {
    let (header, start) = read_header(reader, bytes)?;
    let end = header.end(start);
    check_file_length(end, bytes)?;
    header.check(start, header.length(start))?;
    Ok((header, end))
}

/// Reads and checks the fixed start and the header of a package whose beginning has been received. Also returns where
/// the first section starts. `None`: there are not enough bytes.
pub(super) fn read_beginning(bytes: &[u8]) -> Result<Option<(Header, u64)>, PackageError> {
    let known = MAGIC.len().min(bytes.len());
    if bytes[..known] != MAGIC[..known] {
        return Err(PackageError::NotAPackage);
    }
    let length = bytes.get(8..16).and_then(|length| length.try_into().ok()).map(u64::from_le_bytes);
    let Some(length) = length else { return Ok(None) };
    check_length(length)?;
    if (bytes.len() as u64) < FIXED + length {
        return Ok(None);
    }
    let (header, start) = read_header(&mut &*bytes, bytes.len() as u64)?;
    header.check(start, header.length(start))?;
    Ok(Some((header, start)))
}

/// Reads the fixed start and the header, of a file of which `file_length` bytes can be read. Also returns where the
/// first section starts.
fn read_header(reader: &mut impl Read, file_length: u64) -> Result<(Header, u64), PackageError> {
    if file_length < MAGIC.len() as u64 || bytes::<4>(reader)? != MAGIC {
        return Err(PackageError::NotAPackage);
    }
    check_file_length(FIXED, file_length)?;
    let version = u32::from_le_bytes(bytes(reader)?);
    if version != VERSION {
        return Err(PackageError::UnsupportedVersion { found: version, known: VERSION });
    }
    let length = u64::from_le_bytes(bytes(reader)?);
    let stored = u32::from_le_bytes(bytes(reader)?);
    check_length(length)?;
    check_file_length(FIXED + length, file_length)?;
    let mut text = vec![0; length as usize];
    reader.read_exact(&mut text)?;
    if checksum(&text) != stored {
        return Err(PackageError::HeaderChecksum);
    }
    let (mut header, start) = (Header::parse(&text)?, FIXED + length);
    if header.chunks_follow {
        let end = header.end(start);
        header.chunks.iter_mut().for_each(|table| table.first_byte = Some(end));
    }
    Ok((header, start))
}

/// Returns the CRC-32 of everything before the first section except the checksum itself.
fn checksum(text: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&MAGIC);
    hasher.update(&VERSION.to_le_bytes());
    hasher.update(&(text.len() as u64).to_le_bytes());
    hasher.update(text);
    hasher.finalize()
}

fn check_length(length: u64) -> Result<(), PackageError> {
    if length > HEADER_LIMIT {
        return Err(PackageError::HeaderTooLong { length, limit: HEADER_LIMIT });
    }
    Ok(())
}

fn check_file_length(expected: u64, found: u64) -> Result<(), PackageError> {
    if expected > found {
        return Err(PackageError::Truncated { expected, found });
    }
    Ok(())
}

fn bytes<const N: usize>(reader: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    reader.read_exact(&mut bytes)?;
    Ok(bytes)
}
