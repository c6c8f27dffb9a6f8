//! Sections: one attribute of a run of Gaussians, as bytes.
//!
//! In: words of a scene. Out: a zstd frame of their byte planes and the entry in the section table; and the frame from
//! a reader, checked. `reading` decompresses it.

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
    /// First row of the attribute: a Gaussian, a value of the environment map, a point or a triangle of colliders, a
    /// word of the sound file, or a level of detail.
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
    let mut body = zstd_frames::compress(&planes, attribute.block_length(rows.len()), level)?;
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

/// Returns the entry in the section table of an inner package, with this index among the sections of its name.
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

/// A body of which a part has been read.
pub(super) struct Body {
    /// The length before it.
    length: u64,
    hasher: crc32fast::Hasher,
}

impl Section {
    /// Reads the length before the body, which [`read_some`](Self::read_some) then reads into `body`.
    pub(super) fn begin_body(&self, reader: &mut impl Read, body: &mut Vec<u8>) -> Result<Body, PackageError> {
        let mut prefix = [0; 8];
        reader.read_exact(&mut prefix)?;
        body.clear();
        // The table has been checked against the length of the file.
        body.reserve(self.length);
        Ok(Body { length: u64::from_le_bytes(prefix), hasher: crc32fast::Hasher::new() })
    }

    /// Reads at most `bytes` more of the body. Returns whether it is complete; then the length before it and the
    /// checksum have been checked.
    pub(super) fn read_some(
        &self,
        reader: &mut impl Read,
        begun: &mut Body,
        body: &mut Vec<u8>,
        bytes: usize,
    ) -> Result<bool, PackageError> {
        let start = body.len();
        body.resize(self.length.min(start.saturating_add(bytes)), 0);
        let piece = body.get_mut(start..).unwrap_or_default();
        reader.read_exact(piece)?;
        begun.hasher.update(piece);
        if body.len() < self.length {
            return Ok(false);
        }
        let (expected, found) = (self.length as u64, begun.length);
        if expected != found {
            return Err(PackageError::SectionLength { name: self.name.clone(), expected, found });
        }
        if begun.hasher.clone().finalize() != self.crc32 {
            return Err(PackageError::SectionChecksum { name: self.name.clone() });
        }
        Ok(true)
    }

    /// Reads the length and the body, and checks both. If one is wrong, the reader is still positioned after the body.
    pub(super) fn read_body(&self, reader: &mut impl Read, body: &mut Vec<u8>) -> Result<(), PackageError> {
        let mut begun = self.begin_body(reader, body)?;
        self.read_some(reader, &mut begun, body, usize::MAX).map(drop)
    }
}
