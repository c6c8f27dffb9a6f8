//! The container of an SPZ file.
//!
//! In: the bytes of a file. Out: [`Payload`]: the values of the header, and the six columns, decompressed. Versions 2
//! and 3 are one stream of gzip, version 4 is a header and one zstd frame for each column. Its numbers are checked
//! against the file size.

use crate::codec::budget::Budget;
use crate::codec::import::error::ImportError;
use crate::codec::start::Start;
use crate::codec::zstd_frames;
use flate2::read::GzDecoder;
use std::io::{ErrorKind, Read};
use std::ops::Range;

/// The first bytes of a header.
const MAGIC: &[u8] = b"NGSP";
/// The first bytes of gzip.
const GZIP: &[u8] = &[0x1f, 0x8b];
/// Bytes of a header up to version 3.
const HEADER: usize = 16;
/// Bytes of the header of version 4.
const HEADER_4: usize = 32;
/// Bytes of memory of a Gaussian, as it is read and as it is drawn, without its coefficients.
const GAUSSIAN: u64 = 160;
/// Bytes of memory of one coefficient of three channels.
const COEFFICIENT: u64 = 12;
/// Most bytes of extension records behind the columns.
const EXTENSIONS: u64 = 64 << 10;
/// The flag of files trained with anti-aliasing, the screen-space filter of Mip-Splatting.
const ANTIALIASED: u8 = 1;
/// The flag of files with extension records.
const EXTENDED: u8 = 2;
/// The type of Adobe's record of the coordinate system.
const COORDINATE_SYSTEM: u32 = 0xadbe_0003;

/// Coefficients per Gaussian and channel of each degree, without that of degree 0.
const COEFFICIENTS: [usize; 5] = [0, 3, 8, 15, 24];

/// The contents of a file.
#[derive(Debug)]
pub(super) struct Payload {
    /// The version, 2 to 4.
    pub version: u32,
    /// Number of Gaussians.
    pub count: usize,
    /// Degree of the colors, 0 to 4.
    pub degree: usize,
    /// Fractional bits of positions.
    pub fractional_bits: u8,
    /// Whether it was trained with anti-aliasing.
    pub is_antialiased: bool,
    /// The number of the coordinate system; 0 if there is no record of it.
    pub system: u32,
    /// All columns, one after the other.
    bytes: Vec<u8>,
}

/// A column of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    Positions,
    Alphas,
    Colors,
    Scales,
    Rotations,
    Harmonics,
}

impl Column {
    /// All columns in the order of the file.
    const ALL: [Self; 6] =
        [Self::Positions, Self::Alphas, Self::Colors, Self::Scales, Self::Rotations, Self::Harmonics];
}

impl Payload {
    /// Returns the bytes of one column.
    pub(super) fn column(&self, column: Column) -> &[u8] {
        let header = (self.version, self.degree);
        let before = Column::ALL.into_iter().take_while(|&other| other != column);
        let first: usize = before.map(|other| width(other, header) * self.count).sum();
        let range: Range<usize> = first..first + width(column, header) * self.count;
        self.bytes.get(range).unwrap_or_default()
    }

    /// Returns the bytes of a Gaussian in a column.
    pub(super) fn width(&self, column: Column) -> usize {
        width(column, (self.version, self.degree))
    }

    /// Returns the number of coefficients per Gaussian and channel without that of degree 0.
    pub(super) fn coefficients(&self) -> usize {
        COEFFICIENTS[self.degree]
    }

    /// Reads a file.
    ///
    /// # Errors
    /// A file that is damaged or cut, of an unknown version, or whose header promises more than its bytes can hold.
    pub(super) fn of(file: &[u8]) -> Result<Self, ImportError> {
        if !file.starts_with(GZIP) {
            let header = Header::of(file)?;
            return if header.version < 4 { header.plain(file, file.len()) } else { header.frames(file) };
        }
        let mut unzipped = GzDecoder::new(file);
        let mut bytes = Vec::new();
        unzipped.by_ref().take(HEADER as u64).read_to_end(&mut bytes).map_err(gzip)?;
        let header = Header::of(&bytes)?;
        if header.version >= 4 {
            return Err(ImportError::damaged("the header of version 4 inside gzip, where only versions 2 and 3 are"));
        }
        let expected = header.checked_size(file.len())?;
        unzipped.take(expected + EXTENSIONS).read_to_end(&mut bytes).map_err(gzip)?;
        header.plain(&bytes, file.len())
    }
}

/// Returns whether a file that starts so is an SPZ file.
pub(crate) fn is_of(start: &Start) -> bool {
    let mut first = [0; MAGIC.len()];
    start.bytes.starts_with(MAGIC)
        || (start.bytes.starts_with(GZIP)
            && GzDecoder::new(&*start.bytes).read_exact(&mut first).is_ok()
            && first == MAGIC)
}

/// Returns the bytes of a Gaussian in a column of a file of this version and degree.
fn width(column: Column, (version, degree): (u32, usize)) -> usize {
    match column {
        Column::Positions => 9,
        Column::Alphas => 1,
        Column::Colors | Column::Scales => 3,
        Column::Rotations if version < 3 => 3,
        Column::Rotations => 4,
        Column::Harmonics => COEFFICIENTS[degree] * 3,
    }
}

struct Header {
    version: u32,
    count: usize,
    degree: usize,
    fractional_bits: u8,
    flags: u8,
}

impl Header {
    fn of(bytes: &[u8]) -> Result<Self, ImportError> {
        if !bytes.starts_with(MAGIC) {
            return Err(ImportError::damaged("it does not start as an SPZ file"));
        }
        let (Some(version), Some(count), Some(&[degree, fractional_bits, flags, _])) =
            (number(bytes, 4), number(bytes, 8), bytes.get(12..HEADER))
        else {
            return Err(ImportError::damaged("it is cut in its header"));
        };
        if !(2..=4).contains(&version) {
            return Err(ImportError::unsupported(format!(
                "SPZ version {version}, of which versions 2 to 4 are read: convert it with the tools of its maker"
            )));
        }
        if usize::from(degree) >= COEFFICIENTS.len() {
            return Err(ImportError::damaged(format!("colors of degree {degree}, of which 0 to 4 exist")));
        }
        if fractional_bits > 24 {
            return Err(ImportError::damaged(format!(
                "positions have {fractional_bits} fractional bits, of at most 24"
            )));
        }
        Ok(Self { version, count: count as usize, degree: usize::from(degree), fractional_bits, flags })
    }

    /// Returns the bytes of all columns, which may be allocated.
    fn checked_size(&self, length: usize) -> Result<u64, ImportError> {
        let gaussian: usize = Column::ALL.iter().map(|&column| width(column, (self.version, self.degree))).sum();
        let size = self.count as u64 * gaussian as u64;
        let made = self.count as u64 * (GAUSSIAN + COEFFICIENT * COEFFICIENTS[self.degree] as u64);
        Budget::of(length as u64).take(size + made).map_err(|over| {
            ImportError::damaged(format!(
                "its header promises {} Gaussians, more than its {length} bytes can hold: the set of them {over}",
                self.count
            ))
        })?;
        Ok(size)
    }

    /// Returns the contents of a file whose columns follow the header without compression, or have been decompressed.
    fn plain(self, bytes: &[u8], length: usize) -> Result<Payload, ImportError> {
        let size = self.checked_size(length)? as usize;
        let rest = bytes.get(HEADER..).unwrap_or_default();
        let Some((columns, records)) = rest.split_at_checked(size) else {
            return Err(ImportError::damaged(format!(
                "it is cut: {} Gaussians need {size} bytes, of which {} are there",
                self.count,
                rest.len()
            )));
        };
        let system = self.system(records)?;
        Ok(self.payload(system, columns.to_vec()))
    }

    /// Returns the contents of a file of version 4.
    fn frames(self, file: &[u8]) -> Result<Payload, ImportError> {
        let cut = || ImportError::damaged("it is cut in its header or in its table of contents");
        let size = self.checked_size(file.len())? as usize;
        let streams = usize::from(*file.get(15).ok_or_else(cut)?);
        let table = number(file, 16).ok_or_else(cut)? as usize;
        let columns = &Column::ALL[..if self.degree == 0 { 5 } else { 6 }];
        if streams != columns.len() {
            return Err(ImportError::damaged(format!("{streams} columns, where {} belong", columns.len())));
        }
        let system = self.system(file.get(HEADER_4..table).ok_or_else(cut)?)?;
        let mut entries = file.get(table..).ok_or_else(cut)?;
        let mut frames = entries.get(streams * 16..).ok_or_else(cut)?;
        let mut bytes = Vec::with_capacity(size);
        for &column in columns {
            let (entry, others) = entries.split_at_checked(16).ok_or_else(cut)?;
            let (length, raw) = (long(entry, 0).ok_or_else(cut)?, long(entry, 8).ok_or_else(cut)?);
            let expected = width(column, (self.version, self.degree)) * self.count;
            let damaged = |reason: String| ImportError::damaged(format!("column {column:?}: {reason}"));
            if raw != expected as u64 {
                return Err(damaged(format!("{raw} bytes, where {} Gaussians have {expected}", self.count)));
            }
            let parts = usize::try_from(length).ok().and_then(|length| frames.split_at_checked(length));
            let (frame, rest) = parts.ok_or_else(|| damaged("it is cut".to_owned()))?;
            let raw = zstd_frames::decompress(frame, expected).map_err(|error| damaged(error.to_string()))?;
            if raw.len() != expected {
                return Err(damaged(format!("it holds {} bytes instead of {expected}", raw.len())));
            }
            bytes.extend_from_slice(&raw);
            (entries, frames) = (others, rest);
        }
        Ok(self.payload(system, bytes))
    }

    /// Returns the coordinate system in extension records: each has a type and a length before its contents.
    fn system(&self, mut records: &[u8]) -> Result<u32, ImportError> {
        let cut = || ImportError::damaged("an extension record is cut");
        let mut system = 0;
        while self.flags & EXTENDED != 0 && !records.is_empty() {
            let (kind, length) = (number(records, 0).ok_or_else(cut)?, number(records, 4).ok_or_else(cut)?);
            let (contents, rest) = records[8..].split_at_checked(length as usize).ok_or_else(cut)?;
            if kind == COORDINATE_SYSTEM {
                system = number(contents, 0).ok_or_else(cut)?;
            }
            records = rest;
        }
        Ok(system)
    }

    fn payload(self, system: u32, bytes: Vec<u8>) -> Payload {
        Payload {
            version: self.version,
            count: self.count,
            degree: self.degree,
            fractional_bits: self.fractional_bits,
            is_antialiased: self.flags & ANTIALIASED != 0,
            system,
            bytes,
        }
    }
}

/// Returns the error of damaged gzip.
fn gzip(error: std::io::Error) -> ImportError {
    if error.kind() == ErrorKind::UnexpectedEof {
        ImportError::damaged("it is cut: its gzip stream has no end")
    } else {
        ImportError::damaged(format!("its gzip stream is damaged: {error}"))
    }
}

/// Returns the 32-bit number at a place.
fn number(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}

/// Returns the 64-bit number at a place.
fn long(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..)?.first_chunk().copied().map(u64::from_le_bytes)
}
