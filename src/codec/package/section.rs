//! Sections: one attribute of a run of Gaussians, as bytes.
//!
//! In: words of a scene. Out: a zstd frame of their byte planes and the entry in the section table; and the frame from a reader, checked.
//! `reading` decompresses it.

use super::attribute::Attribute;
use super::error::PackageError;
use super::planes;
use crate::codec::zstd_frames;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::ops::Range;

/// The encoding of lossless sections: byte planes of little-endian float32, compressed by zstd.
pub const FLOAT_PLANES: &str = "f32-planes-zstd";

/// The encoding of sections that contain a package each, without further compression.
pub const PACKAGE: &str = "package";

/// One entry of the section table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Section {
    /// The attribute it holds. Sections of unknown names are skipped.
    pub name: String,
    /// Encoding of the body: [`FLOAT_PLANES`] or [`PACKAGE`].
    pub encoding: String,
    /// First row of the attribute: a Gaussian, a value of the environment map, or a level of detail.
    pub first: usize,
    /// Number of rows.
    pub count: usize,
    /// Bytes in the file.
    pub length: usize,
    /// Bytes when decompressed.
    pub raw_length: usize,
    /// CRC-32 (IEEE) of the bytes in the file.
    pub crc32: u32,
}

/// Returns the entry in the section table and the body of some rows of an attribute within the table `words`.
pub(super) fn encode(
    words: &[u32],
    attribute: &Attribute,
    rows: Range<usize>,
    level: i32,
) -> Result<(Section, Vec<u8>), PackageError> {
    let planes = planes::split(words, attribute, rows.clone());
    let mut body = zstd_frames::compress(&planes, level)?;
    // All bodies stay in memory until the table is complete.
    body.shrink_to_fit();
    let section = Section {
        name: attribute.name.to_owned(),
        encoding: FLOAT_PLANES.to_owned(),
        first: rows.start,
        count: rows.len(),
        length: body.len(),
        raw_length: planes.len(),
        crc32: crc32fast::hash(&body),
    };
    Ok((section, body))
}

/// Returns the entry in the section table of a package inside the package, with this index among the sections of its
/// name.
pub(super) fn of_package(name: &str, index: usize, body: &[u8]) -> Section {
    Section {
        name: name.to_owned(),
        encoding: PACKAGE.to_owned(),
        first: index,
        count: 1,
        length: body.len(),
        raw_length: body.len(),
        crc32: crc32fast::hash(body),
    }
}

/// Writes the length of a body, then the body.
pub(super) fn write_body(writer: &mut impl Write, body: &[u8]) -> Result<(), PackageError> {
    writer.write_all(&(body.len() as u64).to_le_bytes())?;
    Ok(writer.write_all(body)?)
}

impl Section {
    /// Reads the length and the body, and checks both. If one is wrong, the reader is still positioned after the body.
    pub(super) fn read_body(&self, reader: &mut impl Read, body: &mut Vec<u8>) -> Result<(), PackageError> {
        let mut prefix = [0; 8];
        reader.read_exact(&mut prefix)?;
        // The table has been checked against the length of the file.
        body.clear();
        body.resize(self.length, 0);
        reader.read_exact(body)?;
        let (expected, found) = (self.length as u64, u64::from_le_bytes(prefix));
        if expected != found {
            return Err(PackageError::SectionLength { name: self.name.clone(), expected, found });
        }
        if crc32fast::hash(body) != self.crc32 {
            return Err(PackageError::SectionChecksum { name: self.name.clone() });
        }
        Ok(())
    }
}
