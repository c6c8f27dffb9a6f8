//! Errors of reading and writing packages.
//!
//! In: a problem of the reader or writer. Out: a [`PackageError`], whose message names the problem and the remedy.

use crate::codec::options::InvalidOption;
use crate::codec::text::printable;
use crate::scene::ChunkTable;

/// Why a package cannot be read or written. [`CodecError`](crate::codec::CodecError) adds the path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackageError {
    /// The file does not start with the magic bytes.
    #[error("not a .gs4d package (it does not start with \"GS4D\")")]
    NotAPackage,
    /// A format version that this reader does not know.
    #[error("format version {found}, known here is {known}: made by a newer gs4d (update this one), or damaged")]
    UnsupportedVersion {
        /// Version in the file.
        found: u32,
        /// Version this reader knows.
        known: u32,
    },
    /// The file is shorter than its fixed start or header requires.
    #[error("the package is cut off: it should have {expected} bytes and has {found}; copy or download it again")]
    Truncated {
        /// Bytes that the fixed start or the section table require.
        expected: u64,
        /// Bytes in the file.
        found: u64,
    },
    /// Bytes after the last section.
    #[error("{count} bytes too many after the last section; copy or download the package again")]
    TrailingBytes {
        /// Number of bytes.
        count: u64,
    },
    /// A header that is longer than any package needs.
    #[error("a header of {length} bytes is longer than the {limit} allowed: the package is damaged")]
    HeaderTooLong {
        /// Length in the file.
        length: u64,
        /// Length allowed.
        limit: u64,
    },
    /// The checksum of the header is wrong.
    #[error("the header is damaged (its checksum does not match); copy or download the package again")]
    HeaderChecksum,
    /// The header is intact but cannot be parsed.
    #[error("the header cannot be understood: {}", printable(.0))]
    Header(String),
    /// The package requires a feature that this reader does not know.
    #[error("made by a newer gs4d: it needs the feature `{}`; update this one", printable(.name))]
    UnknownFeature {
        /// Name in the header's list of requirements.
        name: String,
    },
    /// A chunk file without the codebooks of its index, or with those of another.
    #[error("a chunk file whose codebooks are in the index of its capture, {index}, {fault}", index = ChunkTable::INDEX)]
    CodebooksOfIndex {
        /// What is wrong with the index.
        fault: String,
    },
    /// Numbers of the header, or parts of a scene to be written, that contradict each other or are invalid.
    #[error("{0}")]
    Inconsistent(&'static str),
    /// A section of color has another number of coefficients than the degrees need.
    #[error(
        "section `{section}` has {found} color coefficients, and degree {degree} with time degree {degree_t} needs \
         {needed}: damaged, or not written by gs4d"
    )]
    Coefficients {
        /// Name of the section.
        section: &'static str,
        /// Coefficients per channel in the header.
        found: usize,
        /// Coefficients that the degrees need.
        needed: usize,
        /// Spatial degree in the header.
        degree: u32,
        /// Time degree in the header.
        degree_t: u32,
    },
    /// More sections than any scene needs.
    #[error("{found} sections are more than the {limit} allowed: the package is damaged, or not written by gs4d")]
    TooManySections {
        /// Number of sections in the header.
        found: usize,
        /// Number allowed.
        limit: usize,
    },
    /// The scene is far larger than the file could hold.
    #[error("{raw} bytes to unpack from a package that may take {limit}: damaged, or a decompression bomb")]
    TooLarge {
        /// Bytes of the scene that the header describes, and of its largest section decompressed.
        raw: u64,
        /// Bytes allowed for a file of this length.
        limit: u64,
    },
    /// The sections of an attribute do not contain every row.
    #[error("section `{name}` is missing, or ends early")]
    MissingSection {
        /// Name of the attribute.
        name: String,
    },
    /// A section does not continue where the one before it ended.
    #[error("section `{name}` starts at {found} and holds {count}, which does not follow the {expected} before it")]
    SectionRange {
        /// Name of the attribute.
        name: String,
        /// First row that the section claims.
        found: usize,
        /// Rows that the section claims.
        count: usize,
        /// First row that was expected.
        expected: usize,
    },
    /// A section is encoded in a way that this reader does not know.
    #[error("section `{name}` is encoded as `{}`, which is not known here: update this gs4d", printable(.encoding))]
    UnknownEncoding {
        /// Name of the attribute.
        name: String,
        /// Encoding in the section table.
        encoding: String,
    },
    /// A length of a section is wrong.
    #[error(
        "section `{}` is damaged: a length of {found} bytes is given where it must be {expected}",
        printable(.name)
    )]
    SectionLength {
        /// Name of the section.
        name: String,
        /// Length that was expected.
        expected: u64,
        /// Length found.
        found: u64,
    },
    /// The checksum of a section is wrong.
    #[error(
        "section `{}` is damaged (its checksum does not match); copy or download the package again",
        printable(.name)
    )]
    SectionChecksum {
        /// Name of the section.
        name: String,
    },
    /// A section is intact, but does not decompress to the length expected.
    #[error("section `{name}` does not decompress: {reason}")]
    SectionBody {
        /// Name of the section.
        name: String,
        /// The cause.
        reason: String,
    },
    /// A level of detail, which is a package itself, cannot be read or written.
    #[error("level of detail {}: {reason}", .index + 1)]
    Level {
        /// Its index, from 0.
        index: usize,
        /// The cause.
        reason: Box<PackageError>,
    },
    /// A chunk file in the file of the index, which is a package itself, cannot be read.
    #[error("chunk file {}: {reason}", .number + 1)]
    ChunkFile {
        /// Its number, from 0.
        number: usize,
        /// The cause.
        reason: Box<PackageError>,
    },
    /// An option that is invalid or contradicts the stored Gaussians.
    #[error(transparent)]
    Option(#[from] InvalidOption),
    /// The file could not be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}
